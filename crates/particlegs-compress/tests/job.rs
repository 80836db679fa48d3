//! A block that is stopped anywhere goes on to the same bytes; what was kept of other work is not gone on
//! from.

#![allow(clippy::disallowed_methods)]

mod common;

use common::layer;
use particlegs_compress::job::JobFolder;
use particlegs_compress::{Checkpoint, Compression, FineTuning, Options, Target, certify, compress};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::model::{CertificateLevel, LawKind, Limit, Mass, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, codec};
use particlegs_fit::Effort;
use particlegs_particles::{Column, LayeredParticles, Particles, Storage};
use particlegs_train::{Config, Limits, Preset};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Says stop at the n-th question.
fn cancel_at_question(n: u64) -> impl Fn() -> bool + Sync {
    let left = AtomicU64::new(n);
    move || left.load(Ordering::SeqCst) == 0 || left.fetch_sub(1, Ordering::SeqCst) == 1
}

/// The sample as two layers: a fit each, so that one may be finished while the other is not.
fn sample() -> Particles {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64");
    let particles = Particles::open_raw(&[folder]).unwrap();
    let n = particles.len();
    particles.with_layers(vec![layer("first", 0..130_000), layer("second", 130_000..n)])
}

/// A job in two blocks.
fn planned(folder: &Path) -> JobFolder {
    let (target, certificate) = (Target::Ratio(200.0), CertificateLevel::None);
    common::planned(&sample(), folder, Options { target, certificate, blocks: Some(2), ..Options::default() })
}

/// A sound block with a right report is refused where it is another block's.
#[test]
fn blocks_that_changed_places_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let job = planned(&folder.path().join("job"));
    let source = || -> particlegs_core::Result<LayeredParticles> { panic!("buckets are enough") };
    for block in 0..2 {
        job.block(block, source, &Context::SILENT).unwrap();
    }
    job.verify(None, &Context::SILENT).unwrap();
    let path = |block: u32, kind: &str| job.folder.join(format!("blocks/{block:05}.{kind}"));
    std::fs::copy(path(0, "pgs"), path(1, "pgs")).unwrap();
    let report = std::fs::read_to_string(path(0, "json")).unwrap();
    std::fs::write(path(1, "json"), report.replace("\"block\": 0", "\"block\": 1")).unwrap();
    let error = job.verify(None, &Context::SILENT).unwrap_err().to_string();
    assert!(error.contains("00001.pgs") && error.contains("not those of block 1"), "{error}");
}

#[test]
fn a_block_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let source = || -> particlegs_core::Result<LayeredParticles> { panic!("buckets are enough") };
    let job = planned(&folder.path().join("whole"));
    job.block(0, source, &Context::SILENT).unwrap();
    let whole = std::fs::read(job.folder.join("blocks/00000.pgs")).unwrap();

    let job = planned(&folder.path().join("stopped"));
    let checkpoint = job.folder.join("blocks/00000.checkpoint");
    let (mut stops, mut questions) = (0, 20);
    let pieces = loop {
        match job.block(0, source, &Context::SILENT.with_cancel(&cancel_at_question(questions))) {
            Ok(report) => break report.continued.unwrap(),
            Err(Error::Cancelled) => {
                stops += 1;
                questions *= 2;
                assert!(!job.folder.join("blocks/00000.pgs").exists());
            }
            other => panic!("{other:?}"),
        }
    };
    assert!(stops > 2, "{stops} stops");
    assert!(pieces > 0, "no checkpoint was used");
    assert_eq!(std::fs::read(job.folder.join("blocks/00000.pgs")).unwrap(), whole);
    assert!(!checkpoint.exists());
    assert_eq!(job.block(0, source, &Context::SILENT).unwrap().continued, None);
}

/// A few particles in a box.
fn cloud(scale: f32) -> Particles {
    let column = |k: usize| (0..64).map(|i| scale * ((i * (7 + k)) % 64) as f32).collect::<Vec<f32>>();
    let mut particles = Particles::from_columns(column(0), column(1), column(2));
    particles.meta.cell = Some(Cell::orthogonal([100.0; 3]));
    particles
}

/// Every option that can change a byte, and everything that is known of the snapshot, is in the name of the
/// work; where it is done, and how far training goes, is not.
#[test]
fn other_options_are_other_work() {
    let id = |p: &Particles, o: &Options| Compression::plan(p, &[], o, &Context::SILENT).unwrap().id();
    let base = Options { target: Target::Gaussians(8), ..Options::default() };
    let training = |law| Some(Config::preset(Preset::Fast, law));
    let options = [
        Options { target: Target::Gaussians(9), ..base.clone() },
        Options { effort: Effort::Fast, ..base.clone() },
        Options { radius: Some(0.1), ..base.clone() },
        Options { opacity: Some(0.1), ..base.clone() },
        Options { blocks: Some(2), ..base.clone() },
        Options { training: training(LawKind::OpticalDepth), ..base.clone() },
        Options { training: training(LawKind::AlphaBlend), ..base.clone() },
        Options { training: training(LawKind::OpticalDepth).map(|c| c.scaled(0.5).unwrap()), ..base.clone() },
        Options { seed: 1, ..base.clone() },
        Options { certificate: CertificateLevel::None, ..base.clone() },
        Options { read: [("every".into(), "2".into())].into(), ..base.clone() },
    ];
    let particles = cloud(1.0);
    let mut ids: Vec<[u8; 32]> = options.iter().map(|o| id(&particles, o)).collect();
    let snapshots: [fn(&mut Particles); 7] = [
        |p| p.meta.cell = Some(Cell::orthogonal([200.0; 3])),
        |p| p.meta.cell = None,
        |p| p.meta.units = Units::new(Some("kpc"), None, None),
        |p| p.meta.units = Units::new(None, Some("Msun"), None),
        |p| p.meta.name = "another".into(),
        |p| p.origin = [1.0, 0.0, 0.0],
        |p| *p = cloud(1.5),
    ];
    ids.extend(snapshots.iter().map(|change| {
        let mut other = cloud(1.0);
        change(&mut other);
        id(&other, &base)
    }));
    ids.push(id(&particles, &base));
    let mut different = ids.clone();
    different.sort_unstable();
    different.dedup();
    assert_eq!(different.len(), ids.len());

    let folder = tempfile::tempdir().unwrap();
    let limits = Limits { seconds: Some(60.0), ..Limits::default() };
    let same = Options { storage: Storage::Disk(folder.path().into()), limits, memory: Some(1 << 40), ..base.clone() };
    assert_eq!(id(&particles, &same), id(&particles, &base));

    // What was kept of one is not gone on from by another.
    let path = folder.path().join("m.checkpoint");
    let mut checkpoint = Checkpoint::fresh(path.clone(), &ids[0]);
    particlegs_core::checkpoint::CheckpointStore::keep_now(&mut checkpoint, "train", vec![1]).unwrap();
    assert_eq!(Checkpoint::open(path.clone(), &ids[0]).unwrap().len(), 1);
    for other in &ids[1..] {
        let opened = Checkpoint::open(path.clone(), other).unwrap();
        assert!(opened.is_empty() && opened.fault().is_some());
    }
}

#[test]
fn other_fine_tuning_is_other_work() {
    let base = FineTuning::default();
    let other = [
        FineTuning { target: Target::Ratio(7.0), ..base.clone() },
        FineTuning { training: Config::fine_tuning().scaled(0.5).unwrap(), ..base.clone() },
        FineTuning { seed: 1, ..base.clone() },
        FineTuning { certificate: CertificateLevel::None, ..base.clone() },
    ];
    let mut ids: Vec<[u8; 32]> = other.iter().map(|o| o.id(b"model")).collect();
    ids.extend([base.id(b"model"), base.id(b"another")]);
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), other.len() + 2);
    assert_eq!(FineTuning { memory: Some(1), ..base.clone() }.id(b"model"), base.id(b"model"));
}

/// A job in three blocks, each measured by its own task, done in this order.
fn measured(folder: &Path, order: [u32; 3]) -> JobFolder {
    let (target, effort, certificate) = (Target::Ratio(200.0), Effort::Fast, CertificateLevel::Blocks);
    let options = Options { target, effort, certificate, blocks: Some(3), ..Options::default() };
    let job = common::planned(&sample(), folder, options);
    for block in order {
        job.block(block.into(), || panic!("buckets are enough"), &Context::SILENT).unwrap();
    }
    job
}

/// Measurements of the blocks add up, in any order, to those of the whole: without the particles.
#[test]
fn certificates_add_up_over_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [[2, 0, 1], [0, 1, 2]].map(|order| measured(&folder.path().join(format!("{order:?}")), order));
    let bytes = a.merge(CertificateLevel::Blocks, None, &Context::SILENT).unwrap();
    assert!(bytes == b.merge(CertificateLevel::Blocks, None, &Context::SILENT).unwrap());

    let model = codec::decode(&bytes, "the file").unwrap();
    let added = model.certificate.unwrap();
    let whole = |level| certify(&model, 5000, &sample(), 3, level, &Context::SILENT).unwrap();
    let (one, quick) = (whole(CertificateLevel::Blocks), whole(CertificateLevel::Quick));
    assert_eq!((added.blocks, one.blocks), (Some(3), Some(1)));
    for other in [one, quick] {
        for (o, orbit) in added.views.orbits.iter().zip(&other.views.orbits) {
            let [a, b] = [o, orbit].map(|o| o.expected.model.unwrap());
            let off = a.masked_psnr.unwrap() - b.masked_psnr.unwrap();
            assert!(off.abs() < 0.01 && (a.ssim - b.ssim).abs() < 1e-3, "{off}");
        }
        let [a, b] = [added, other].map(|c| c.density);
        assert!((a.correlation - b.correlation).abs() < 1e-6);
        assert!((a.uniform_mean_absolute_error - b.uniform_mean_absolute_error).abs() < 1e-6);
        let cells = [added, other].map(|c| c.densities.unwrap());
        assert!(cells[0].iter().zip(&cells[1]).all(|(a, b)| (a.correlation - b.correlation).abs() < 1e-5));
    }
    let (added_up, of_one) = (added.science.unwrap(), one.science.unwrap());
    let held = |v: Limit| v.place().map(|k| k as f32);
    assert_eq!(held(added_up.r_above_0_9_to), held(of_one.r_above_0_9_to));
    assert_eq!(held(added_up.power_within_5_percent_to), held(of_one.power_within_5_percent_to));
    assert!(added_up.r_above_0_9_to.place().is_some());
    assert_eq!((quick.blocks, added.views.orbits[0].paraview.model), (None, None));
}

/// As in most snapshots of gas and dark matter.
#[test]
fn a_layer_with_weights_lies_beside_one_without_in_a_block() {
    let (sample, folder) = (sample(), tempfile::tempdir().unwrap());
    let weight = |i: usize| if i < 130_000 { 5.0 } else { 1.0 + (i % 3) as f32 };
    let weights = Column::owned((0..sample.len()).map(weight).collect());
    let mut layers = sample.layers().to_vec();
    (layers[0].mass, layers[1].mass) = (Mass::Each(5.0), Mass::Weights(None));
    let particles = sample.with_weights(weights).with_layers(layers);
    let (target, effort, certificate) = (Target::Ratio(200.0), Effort::Fast, CertificateLevel::None);
    let options = Options { target, effort, certificate, blocks: Some(2), ..Options::default() };
    let job = common::planned(&particles, &folder.path().join("job"), options.clone());
    (0..2).for_each(|b| drop(job.block(b, || panic!("buckets are enough"), &Context::SILENT).unwrap()));
    let merged = job.merge(CertificateLevel::None, None, &Context::SILENT).unwrap();
    let options = Options { seed: 3, ..options };
    assert!(merged == compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT).unwrap().bytes);
}

/// Sums that are missing are measured again, without another fit, and altered ones are named.
#[test]
fn broken_sums_are_found_and_measured_again() {
    let folder = tempfile::tempdir().unwrap();
    let job = measured(&folder.path().join("job"), [0, 1, 2]);
    job.verify(None, &Context::SILENT).unwrap();
    let path = job.folder.join("blocks/00001.sums");
    let sums = std::fs::read(&path).unwrap();
    for at in [3, 20, sums.len() / 2, sums.len() - 1] {
        let mut altered = sums.clone();
        altered[at] ^= 1;
        std::fs::write(&path, altered).unwrap();
        let error = job.verify(None, &Context::SILENT).unwrap_err().to_string();
        assert!(error.contains("00001.sums"), "{at}: {error}");
    }
    std::fs::remove_file(&path).unwrap();
    assert!(
        job.merge(CertificateLevel::Blocks, None, &Context::SILENT)
            .unwrap_err()
            .to_string()
            .contains("not fitted yet: 1")
    );
    assert_eq!(job.block(1, || panic!("buckets are enough"), &Context::SILENT).unwrap().continued, None);
    assert!(std::fs::read(&path).unwrap() == sums);
    // Other levels need the particles; none needs nothing.
    assert!(job.merge(CertificateLevel::Quick, None, &Context::SILENT).is_err());
    let bytes = job.merge(CertificateLevel::None, None, &Context::SILENT).unwrap();
    assert!(codec::read_info(&bytes, "the file").unwrap().certificate.is_none());
}
