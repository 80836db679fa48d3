//! Three small programs as users write them, each below 25 lines, run on small data.

use particlegs::haloes::{HaloOptions, find_haloes};
use particlegs::input::FrameChoice;
use particlegs::metadata::Effort;
use particlegs::prelude::*;
use particlegs::stats::Subject;
use particlegs::{Choice, ExportOptions, Outputs, Selection, Series, SeriesOptions, make_series, pictures::Colormap};
use std::path::{Path, PathBuf};

const SIZE: Size = Size { width: 64, height: 48 };

/// Two snapshots become a series, and a picture of the moment between them.
fn picture_between(snapshots: &[PathBuf], folder: &Path) -> Result<()> {
    let context = Context::default().with_memory(&available_memory);
    let run = folder.join("run.pgs");
    let compress = CompressOptions { effort: Effort::Fast, ..CompressOptions::gaussians(20) };
    let options = SeriesOptions { compress, ..SeriesOptions::default() };
    make_series(snapshots, &Choice::default(), &run, &options, &context)?;
    let series = Series::open(&run)?;
    let times: Vec<f64> = series.times().into_iter().flatten().collect();
    let model = series.at(0.5 * (times[0] + times[1]), &context)?;
    println!("{model:?}, between the {} {times:?}", series.clock());
    model.render(&model.orbit(30.0, 20.0, SIZE), SIZE, &context)?.save_png(folder.join("between.png"))?;
    series.model(&FrameChoice::Number(-1), &context)?.save(folder.join("last.pgs"))
}

/// A snapshot with velocities becomes a model, with a map of velocities, haloes, a page and a verdict.
fn velocities_haloes_page(snapshot: &Path, folder: &Path) -> Result<()> {
    let (context, snapshot) = (Context::default(), Snapshot::open(snapshot)?);
    let options = CompressOptions { fields: vec!["velo".into()], ..CompressOptions::gaussians(40) };
    let model = compress(&snapshot, &options, &context)?;
    let map = model.field_map("velo.los", &model.whole_view(SIZE)?, SIZE, &context)?;
    println!("from {:?} to {:?}", map.data.iter().copied().reduce(f64::min), map.data.iter().copied().reduce(f64::max));
    let haloes = find_haloes(Subject::Model(model.decoded()), &HaloOptions::default(), &context);
    println!("{} haloes", haloes.map_or(0, |catalogue| catalogue.len()));
    let (page, outputs) = (folder.join("model.html"), Outputs::new(false));
    model.export(&page, &ExportOptions::default(), &outputs, &context)?;
    model.verdict().iter().for_each(|use_case| println!("{:?}: {}", use_case.word, use_case.why));
    model.verify(Some(&snapshot), (false, 42), &context)?.judge()
}

/// A tenth of a snapshot becomes a model, its density a picture, and particles drawn from it a file.
fn map_and_particles(snapshot: &Path, folder: &Path) -> Result<()> {
    let context = Context::default();
    let snapshot = Snapshot::open(snapshot)?.select(Selection::one_in(10));
    let model = compress(&snapshot, &CompressOptions::gaussians(30), &context)?;
    let density = model.density_map(&model.whole_view(SIZE)?, SIZE, &context)?;
    density.save_png(folder.join("density.png"))?;
    density.colored(Colormap::Viridis, None).save_png(folder.join("viridis.png"))?;
    let drawn = model.recover_snapshot(&RecoverOptions { particles: Some(500), ..Default::default() }, &context)?;
    let file = drawn.save(folder.join("drawn.hdf5"), &context)?;
    println!("{model:?}: {} particles in {} bytes", file.particles, file.bytes);
    Ok(())
}

/// An XYZ file of 2000 particles in clumps with velocities, in a box of edge 10.
fn write_snapshot(path: &Path, time: f64) -> PathBuf {
    let wave = |i: u64, k: u64| ((i * k % 997) as f64 / 997.0 - 0.5).powi(3) * 4.0;
    let row = |i: u64| {
        let place = [(7, 2.0), (11, 5.0), (13, 8.0)].map(|(k, at)| at + time + wave(i, k) + (i % 3) as f64 * 0.3);
        format!("A {} {} {} {} 0 1\n", place[0], place[1], place[2], wave(i, 17))
    };
    let rows: String = (0..2000).map(row).collect();
    let head = format!("Lattice=\"10 0 0 0 10 0 0 0 10\" Properties=species:S:1:pos:R:3:velo:R:3 Time={time}");
    std::fs::write(path, format!("2000\n{head}\n{rows}")).unwrap();
    path.to_path_buf()
}

#[test]
fn three_programs_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let snapshots = [write_snapshot(&at("a.xyz"), 0.0), write_snapshot(&at("b.xyz"), 0.1)];
    picture_between(&snapshots, folder.path()).unwrap();
    velocities_haloes_page(&snapshots[0], folder.path()).unwrap();
    map_and_particles(&snapshots[1], folder.path()).unwrap();
    for name in ["between.png", "last.pgs", "model.html", "density.png", "viridis.png", "drawn.hdf5"] {
        assert!(at(name).metadata().unwrap().len() > 100, "{name}");
    }
}
