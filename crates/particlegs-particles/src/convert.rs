//! Snapshot to snapshot: tiling, cropping, thinning, sampling, and float64 to float32.
//!
//! Memory stays at a few runs a thread, whatever the size of the output.

use super::select::SelectedParticles;
use super::write::{RawForm, SnapshotDescription, SnapshotLayout, SnapshotWriter};
use particlegs_core::context::Context;
use particlegs_core::{Result, parallel};
use std::path::Path;

impl SelectedParticles<'_> {
    /// Writes float32 (float64 triples where positions have more digits) at `out`; says how many bytes. Nothing is left at `out` after an error or a stop.
    pub fn write_raw(&self, out: &Path, form: RawForm, context: &Context<'_>) -> Result<u64> {
        let weighted = self.weighted();
        let (count, origin, wide) = (self.total(), self.origin(), self.is_wide());
        let layout = SnapshotLayout { form, count, weighted, origin, wide, fields: &[] };
        let writer = SnapshotWriter::create(out, &layout)?;
        context.begin("writing", self.total());
        let triples = parallel::Scratch::default();
        self.for_each_run(context, &|id, run| {
            triples.with(|triples| writer.write(self.first(id), run, triples))?;
            context.advance(run.columns[0].len() as u64);
            Ok(())
        })?;
        let bytes = writer.particle_bytes(weighted) * self.total();
        writer.finish(&SnapshotDescription {
            meta: self.meta(),
            origin: self.origin(),
            layers: self.layers(),
            order: "layer by layer, tile by tile, particles in input order",
            notes: [("made_from".to_string(), self.notes())].into_iter().collect(),
        })?;
        context.end();
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Column, Particles, Selection, Tiling};
    use particlegs_core::Error;
    use particlegs_core::context::{Context, ProgressEvent, ProgressSink};
    use particlegs_core::math::each_axis;
    use particlegs_core::model::Units;
    use particlegs_core::space::{Bounds, Cell};

    /// More than one run of particles on a ramp, in a box of 100 x 10 x 10.
    /// Writes what a selection keeps; says how many particles that are.
    fn convert(p: &Particles, tiling: Tiling, selection: Selection, out: &Path, context: &Context<'_>) -> Result<u64> {
        let selected_particles = SelectedParticles::new(p, tiling, selection, context)?;
        let form = if out.extension().is_some_and(|e| e == "npy") { RawForm::Npy } else { RawForm::Columns };
        selected_particles.write_raw(out, form, context).map(|_| selected_particles.total())
    }

    fn ramp() -> Particles {
        let n = 70_000;
        let x = (0..n).map(|i| i as f32 * 100.0 / n as f32).collect();
        let mut p = Particles::from_columns(x, vec![2.0; n], (0..n).map(|i| (i % 10) as f32).collect());
        p.meta.cell = Some(Cell::orthogonal([100.0, 10.0, 10.0]));
        p.meta.units = Units::new(Some("Mpc/h"), None, Some(true));
        p
    }

    fn run(p: &Particles, tiling: Tiling, selection: Selection, name: &str) -> Result<Particles> {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join(name);
        let count = convert(p, tiling, selection, &out, &Context::SILENT);
        let left = std::fs::read_dir(dir.path()).unwrap().count();
        assert_eq!(left, usize::from(count.is_ok()), "temporary files are left");
        let back = Particles::open_raw(&[out])?;
        assert_eq!(count?, back.len() as u64);
        Ok(back)
    }

    #[test]
    fn a_copy_is_the_same_and_keeps_what_is_known() {
        let p = ramp();
        let back = run(&p, Tiling::single(), Selection::all(), "copy").unwrap();
        assert!((0..p.len()).all(|i| back.position(i) == p.position(i)));
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("copy.npy");
        convert(&p, Tiling::single(), Selection::all(), &out, &Context::SILENT).unwrap();
        let bytes = std::fs::read(&out).unwrap();
        let triples: Vec<f32> = bytes[bytes.len() - 12 * p.len()..]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        assert!((0..p.len()).all(|i| (0..3).all(|k| f64::from(triples[3 * i + k]) == p.position(i)[k])));
        let back = run(&p, Tiling::single(), Selection::all(), "copy").unwrap();
        assert_eq!((back.meta.cell, back.meta.units), (p.meta.cell, p.meta.units));
    }

    #[test]
    fn far_from_zero_positions_keep_their_digits() {
        let column = |k: f32| (0..100).map(|i| 1e-3 * (i as f32 + k)).collect::<Vec<f32>>();
        let mut p = Particles::from_columns(column(0.0), column(1.0), column(2.0));
        p.origin = [98_765.4, 0.0, 200_000.25];
        let back = run(&p, Tiling::single(), Selection::all(), "far").unwrap();
        assert_eq!(back.origin, p.origin);
        assert!((0..100).all(|i| back.position(i) == p.position(i)));
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("far.npy");
        convert(&p, Tiling::single(), Selection::all(), &out, &Context::SILENT).unwrap();
        let bytes = std::fs::read(&out).unwrap();
        let values: Vec<f64> =
            bytes[bytes.len() - 2400..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        assert!((0..100).all(|i| values[3 * i..3 * i + 3] == p.position(i)));
    }

    #[test]
    fn tiles_follow_each_other() {
        let p = ramp();
        let tiling = Tiling::new([1, 2, 2], &p).unwrap();
        let back = run(&p, tiling, Selection::all(), "tiled").unwrap();
        let n = p.len();
        assert_eq!(back.len(), 4 * n);
        assert_eq!(back.meta.cell.unwrap().lengths(), Some([100.0, 20.0, 20.0]));
        for (tile, shift) in [[0.0; 3], [0.0, 0.0, 10.0], [0.0, 10.0, 0.0], [0.0, 10.0, 10.0]].iter().enumerate() {
            for i in [0, 1, 65_535, 65_536, n - 1] {
                let expected: [f64; 3] = each_axis(|k| p.position(i)[k] + shift[k]);
                assert_eq!(back.position(tile * n + i), expected);
            }
        }
    }

    #[test]
    fn crops_steps_and_samples_keep_what_was_asked_for() {
        let p = ramp();
        let crop = Bounds { min: [20.0, 0.0, 0.0], max: [60.0, 3.0, 100.0] };
        let cropped = run(&p, Tiling::single(), Selection { crop: Some(crop), ..Selection::all() }, "c").unwrap();
        let inside: Vec<usize> = (0..p.len()).filter(|&i| (20.0..60.0).contains(&p.position(i)[0])).collect();
        assert_eq!(cropped.len(), inside.len());
        assert_eq!(cropped.meta.cell, None);
        let thin = Selection { crop: Some(crop), every: 7, ..Selection::all() };
        let thinned = run(&p, Tiling::single(), thin, "t").unwrap();
        assert_eq!(thinned.len(), inside.len().div_ceil(7));
        assert!((0..thinned.len()).all(|j| thinned.position(j) == p.position(inside[7 * j])));
    }

    #[test]
    fn samples_are_exact_seeded_and_spread() {
        let p = ramp();
        let tiling = Tiling::new([1, 1, 2], &p).unwrap();
        let draw = |n, seed| run(&p, tiling, Selection { sample: Some(n), seed, ..Selection::all() }, "s").unwrap();
        let (a, b, c) = (draw(1000, 1), draw(1000, 1), draw(1000, 2));
        assert_eq!([a.len(), c.len()], [1000; 2]);
        let x = |p: &Particles| (0..p.len()).map(|i| p.position(i)[0]).collect::<Vec<_>>();
        assert_eq!(x(&a), x(&b));
        assert_ne!(x(&a), x(&c));
        let mean = x(&a).iter().sum::<f64>() / 1000.0;
        assert!((mean - 50.0).abs() < 5.0, "{mean}");
        for n in [1, 139_999, 140_000] {
            assert_eq!(draw(n, 3).len() as u64, n);
        }
    }

    #[test]
    fn what_a_sample_leaves_out_is_the_rest() {
        let p = ramp();
        let draw = |left_out| {
            let half = Selection { sample: Some(30_000), left_out, seed: 1, ..Selection::all() };
            run(&p, Tiling::single(), half, if left_out { "rest" } else { "half" }).unwrap()
        };
        let x = |p: Particles| (0..p.len()).map(|i| p.position(i).map(f64::to_bits)).collect::<Vec<_>>();
        let mut both = [x(draw(false)), x(draw(true))].concat();
        let mut all = x(p.clone());
        both.sort_unstable();
        all.sort_unstable();
        assert!(both == all);
    }

    #[test]
    fn weights_go_along_or_are_an_error() {
        let p = ramp();
        let weights = (1..=p.len()).map(|i| i as f32).collect();
        let p = p.with_weights(Column::owned(weights));
        let back = run(&p, Tiling::single(), Selection { every: 1000, ..Selection::all() }, "w").unwrap();
        assert_eq!(&back.weights().unwrap()[..3], [1.0, 1001.0, 2001.0]);
        assert!(run(&p, Tiling::single(), Selection::all(), "w.npy").is_err());
    }

    #[test]
    fn nothing_is_left_after_an_error() {
        let p = ramp();
        let fails = |selection| assert!(run(&p, Tiling::single(), selection, "e").is_err());
        fails(Selection { every: 0, ..Selection::all() });
        fails(Selection { sample: Some(1 << 40), ..Selection::all() });
        fails(Selection { crop: Some(Bounds { min: [500.0; 3], max: [600.0; 3] }), ..Selection::all() });
    }

    /// Stops in the middle of writing.
    #[derive(Default)]
    struct CancelledConversion(std::sync::atomic::AtomicBool);

    impl ProgressSink for CancelledConversion {
        fn event(&self, event: ProgressEvent<'_>) {
            self.0.fetch_or(matches!(event, ProgressEvent::Advance(_)), std::sync::atomic::Ordering::SeqCst);
        }
    }

    fn convert_until_stopped(p: &Particles, tiling: Tiling, out: &Path) -> Result<()> {
        let stopped = CancelledConversion::default();
        let cancel = || stopped.0.load(std::sync::atomic::Ordering::SeqCst);
        let context = Context::SILENT.with_sink(&stopped).with_cancel(&cancel);
        convert(p, tiling, Selection::all(), out, &context).map(drop)
    }

    #[test]
    fn nothing_is_left_after_a_stop_and_an_old_output_stays() {
        let p = ramp();
        let dir = tempfile::tempdir().unwrap();
        let tiling = Tiling::new([4, 4, 4], &p).unwrap();
        for out in [dir.path().join("new"), dir.path().to_path_buf()] {
            assert!(matches!(convert_until_stopped(&p, tiling, &out), Err(Error::Cancelled)));
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        }
        convert(&p, Tiling::single(), Selection::all(), dir.path(), &Context::SILENT).unwrap();
        assert!(convert_until_stopped(&p, tiling, dir.path()).is_err());
        assert_eq!(Particles::open_raw(&[dir.path().to_path_buf()]).unwrap().len(), p.len());
    }
}
