//! Odd coordinates and boxes: a snapshot becomes a model that can be read, drawn and measured, or is
//! refused in one line.

use particlegs_compress::{Options, Target, compress};
use particlegs_core::camera::{View, base_distance, spherical_camera};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_core::model::{CertificateLevel, Layer, Mass, Model};
use particlegs_core::picture::Size;
use particlegs_core::render::{Scene, draw};
use particlegs_core::space::Cell;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result, codec};
use particlegs_fit::Effort;
use particlegs_measure::stats::{StatsOptions, Subject, compare};
use particlegs_particles::Particles;

const SIZE: Size = Size { width: 40, height: 24 };

/// Clustered points in the unit cube, scaled and moved.
fn snapshot(n: u64, scale: [f32; 3], shift: f32) -> Particles {
    let place = |k: usize| {
        let coordinate = |i: u64| {
            let (mut r, mut c) = (Random::new(7, k as u32, i), Random::new(7, 10 + k as u32, i % 9));
            let x = if i.is_multiple_of(2) { r.uniform() } else { (c.uniform() + 0.01 * r.normal()).rem_euclid(1.0) };
            (x as f32 * scale[k] + shift).clamp(f32::MIN, f32::MAX)
        };
        (0..n).map(coordinate).collect::<Vec<f32>>()
    };
    Particles::from_columns(place(0), place(1), place(2))
}

fn options() -> Options {
    Options {
        target: Target::Gaussians(40),
        effort: Effort::Fast,
        seed: 1,
        certificate: CertificateLevel::None,
        ..Options::default()
    }
}

fn compressed(p: &Particles) -> Result<Model> {
    let compressed_model = compress(p, &options(), &mut NoCheckpoints, &Context::SILENT)?;
    codec::check(&compressed_model.bytes, "made", &Context::SILENT)?;
    codec::decode(&compressed_model.bytes, "made")
}

/// Draws and measures a model of a snapshot.
fn used(p: &Particles, model: &Model) {
    let m = &model.metadata;
    let camera = spherical_camera(m.bounds.center(), 30.0, 20.0, base_distance(&m.bounds, SIZE));
    let view = View { name: "v".into(), camera, radius: m.default_radius, opacity: 0.05 };
    draw(&Scene::new(model), &view, SIZE, ToneStyle::Paraview, &Context::SILENT).unwrap();
    let o = StatsOptions { cells: Some(8), spectrum_cells: 8, pair_budget: 100_000, ..StatsOptions::default() };
    for other in [Subject::Model(model), Subject::Particles(p)] {
        let s = compare(Subject::Particles(p), other, &o, &Context::SILENT).unwrap();
        assert!(s.density.is_some() && s.spectra.is_some());
    }
}

#[test]
fn odd_coordinates_become_models() {
    let n = 400;
    let shapes = [
        snapshot(n, [1e-42; 3], 0.0),
        snapshot(n, [1e-38; 3], 0.0),
        snapshot(n, [1e20; 3], 0.0),
        snapshot(n, [3e38; 3], 0.0),
        snapshot(n, [1e38, 1e-38, 1e-38], 0.0),
        snapshot(n, [1.0, 0.0, 0.0], 0.0),
        snapshot(n, [1.0, 1.0, 0.0], 5.0),
        snapshot(n, [1.0; 3], 1e7),
        snapshot(n, [0.0; 3], 0.7),
        snapshot(1, [1.0; 3], 0.0),
    ];
    for (i, p) in shapes.iter().enumerate() {
        let model = compressed(p).unwrap_or_else(|e| panic!("shape {i}: {e}"));
        assert_eq!(model.metadata.count, p.len() as u64);
        if p.len() > 1 {
            used(p, &model);
        }
    }
}

#[test]
fn outliers_and_boxes_about_the_data_become_models() {
    let mut p = snapshot(400, [100.0; 3], 0.0);
    for length in [100.0, 150.0, 1e30] {
        p.meta.cell = Some(Cell::orthogonal([length; 3]));
        used(&p, &compressed(&p).unwrap());
    }
    let column = |k: usize| (0..400).map(|i| p.position(i)[k] as f32).chain([1e20, -1e20]).collect();
    let out = Particles::from_columns(column(0), column(1), column(2));
    used(&out, &compressed(&out).unwrap());
}

#[test]
fn boxes_that_do_not_hold_the_data_are_said_or_refused() {
    let mut p = snapshot(400, [100.0; 3], 0.0);
    p.meta.name = "snap".into();
    for length in [5e-324, 1e-60, 1e-3, 30.0, 1e60] {
        p.meta.cell = Some(Cell::orthogonal([length; 3]));
        assert!(matches!(compressed(&p).unwrap_err(), crate::Error::Input { .. }), "{length}");
        let stats = compare(Subject::Particles(&p), Subject::Particles(&p), &StatsOptions::default(), &Context::SILENT);
        assert!(matches!(stats.unwrap_err(), crate::Error::Input { .. }), "{length}");
    }
    p.meta.cell = Some(Cell::orthogonal([80.0; 3]));
    let notes = compress(&p, &options(), &mut NoCheckpoints, &Context::SILENT).unwrap().notes;
    assert!(notes.iter().any(|m| m.contains("snap: ") && m.contains("of 400 particles are outside")), "{notes:?}");
}

#[test]
fn models_with_odd_boxes_are_measured_or_refused() {
    let p = snapshot(400, [1.0; 3], 0.0);
    let mut model = compressed(&p).unwrap();
    for length in [5e-324, 1e-310, 1e-3, 1e300] {
        model.metadata.cell = Some(Cell::orthogonal([length; 3]));
        let subject = Subject::Model(&model);
        assert!(matches!(
            compare(subject, subject, &StatsOptions::default(), &Context::SILENT).unwrap_err(),
            crate::Error::Input { .. }
        ));
    }
}

#[test]
fn nothing_is_no_snapshot_and_empty_layers_are_none() {
    let nothing = Particles::from_columns(vec![], vec![], vec![]);
    assert!(matches!(compressed(&nothing), Err(Error::Input { .. })));
    let mut p = snapshot(400, [1.0; 3], 0.0);
    let layer = |name: &str, content| Layer { name: name.into(), mass: Mass::Unknown, content };
    p = p.with_layers(vec![layer("gas", 0..0), layer("dm", 0..400), layer("stars", 400..400)]);
    for target in [Target::Gaussians(40), Target::Ratio(4.0)] {
        let done = compress(&p, &Options { target, ..options() }, &mut NoCheckpoints, &Context::SILENT).unwrap();
        let names: Vec<&str> = done.model.layers.iter().map(|l| &l.name[..]).collect();
        assert_eq!(names, ["dm"]);
    }
    let two = compress(&p, &Options { blocks: Some(2), ..options() }, &mut NoCheckpoints, &Context::SILENT).unwrap();
    assert_eq!(two.model.metadata.count, 400);
}

#[test]
fn tiny_opacities_are_stored_and_drawn() {
    let p = snapshot(400, [1.0; 3], 0.0);
    for opacity in [1e-9, 1e-300, f64::MIN_POSITIVE] {
        let options = Options { opacity: Some(opacity), ..options() };
        let model = compress(&p, &options, &mut NoCheckpoints, &Context::SILENT).unwrap().model;
        let m = &model.metadata;
        let camera = spherical_camera(m.bounds.center(), 30.0, 20.0, base_distance(&m.bounds, SIZE));
        for radius in [1e-300, m.default_radius, 1e100] {
            let view = View { name: "v".into(), camera, radius, opacity };
            let picture = draw(&Scene::new(&model), &view, SIZE, ToneStyle::ParaviewNoFxaa, &Context::SILENT).unwrap();
            assert!(picture.data.iter().all(|v| *v == 0), "splats of opacity {opacity} change no 8-bit buffer");
        }
    }
}

/// Every number that sizes memory or a loop, at its extremes.
#[test]
fn odd_options_of_statistics_end() {
    #[derive(Debug, PartialEq)]
    enum TrialOutcome {
        Measured,
        Refused,
    }
    let p = snapshot(300, [1.0; 3], 0.0);
    let tried = |change: &dyn Fn(&mut StatsOptions)| {
        let mut o = StatsOptions { cells: Some(8), spectrum_cells: 8, pair_budget: 100_000, ..StatsOptions::default() };
        change(&mut o);
        match compare(Subject::Particles(&p), Subject::Particles(&p), &o, &Context::SILENT) {
            Ok(_) => TrialOutcome::Measured,
            Err(Error::Argument { .. }) => TrialOutcome::Refused,
            Err(e) => panic!("{e}"),
        }
    };
    for pair in [[1e-300, 1e300], [1e-300, 1e-299], [1e299, 1e300], [0.0, 1.0], [1.0, f64::INFINITY], [f64::NAN, 1.0]] {
        tried(&|o| o.separations = Some(pair));
    }
    assert_eq!(tried(&|o| o.separations = Some([1e-300, 1e300])), TrialOutcome::Refused);
    for k in [5e-324, 1e-300, 1e300, f64::INFINITY, f64::NAN, -1.0] {
        tried(&|o| o.k_max = Some(k));
    }
    for v in [0.0, 1e-300, 1e-6, 2.0, 1e300, f64::NAN] {
        tried(&|o| o.linking = v);
        tried(&|o| o.aperture = v);
    }
    for v in [0.0, 5e-324, 1e-300, 0.3, 1e300, f64::INFINITY, f64::NAN] {
        tried(&|o| o.rdf_max = Some(v));
        tried(&|o| (o.halo_radius, o.centers) = (Some(v), Some(vec![([0.5; 3], None)])));
        tried(&|o| o.centers = Some(vec![([v, -1e300, 0.5], Some(v)), ([0.1; 3], None)]));
    }
    assert_eq!(tried(&|o| o.centers = Some(vec![([f64::NAN; 3], None)])), TrialOutcome::Refused);
    assert_eq!(tried(&|o| o.centers = Some(vec![([1e30; 3], Some(1.0)); 3])), TrialOutcome::Measured);
    for n in [0, 1, 2, 9000, usize::MAX] {
        tried(&|o| o.profile_axis = n);
        tried(&|o| o.profile_bins = n);
        tried(&|o| o.halo_bins = n);
        tried(&|o| o.cells = Some(n.min(9000)));
        tried(&|o| o.bins_per_decade = n);
        tried(&|o| o.smallest_group = n);
        tried(&|o| o.neighbour_sample = n);
    }
    assert_eq!(tried(&|o| (o.cells, o.spectrum_cells) = (Some(9000), 9000)), TrialOutcome::Refused);
}

/// Reading what is gone of a mapped file would end this process.
#[cfg(unix)]
#[test]
fn a_file_that_was_cut_since_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).with_extension("f32");
    let bytes: Vec<u8> = (0..8192).flat_map(|i| (i as f32 / 8192.0).to_le_bytes()).collect();
    ["xx", "yy", "zz"].iter().for_each(|name| std::fs::write(path(name), &bytes).unwrap());
    let particles = Particles::open_raw(&[dir.path().to_path_buf()]).unwrap();
    let in_memory = particles.clone().in_memory().unwrap();
    std::fs::File::options().write(true).open(path("yy")).unwrap().set_len(100).unwrap();
    let cut = compress(&particles, &Options::default(), &mut NoCheckpoints, &Context::SILENT).err().unwrap();
    assert!(cut.to_string().contains("it was cut to 100 bytes; it had 32768"), "{cut}");
    assert!(particles.clone().in_memory().is_err() && in_memory.check_files().is_ok());
    assert_eq!(in_memory.position(8191), [8191.0 / 8192.0; 3]);
    // A file in its place is another.
    std::fs::write(path("new"), [0; 4]).unwrap();
    std::fs::rename(path("new"), path("yy")).unwrap();
    assert!(particles.check_files().is_ok());
}
