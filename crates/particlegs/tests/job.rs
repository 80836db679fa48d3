//! A block that is stopped anywhere goes on to the same bytes.

use particlegs::Error;
use particlegs::compress::{Options, Target};
use particlegs::job::{Done, Job, Source, Task, plan};
use particlegs::particles::{Layered, ParticleLayer, Particles, open_raw};
use particlegs::progress::{Progress, Silent};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Says stop at the n-th question.
struct StopsAt(AtomicU64);

impl Progress for StopsAt {
    fn cancelled(&self) -> bool {
        self.0.load(Ordering::SeqCst) == 0 || self.0.fetch_sub(1, Ordering::SeqCst) == 1
    }
}

/// The sample as two layers: a fit each, so that one may be finished while the other is not.
fn sample() -> Particles {
    let mut particles = open_raw(&[Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64")]).unwrap();
    let kind = |name: &str, range| ParticleLayer { name: name.into(), range, particle_mass: None, weighted: false };
    particles.kinds = vec![kind("first", 0..130_000), kind("second", 130_000..particles.len())];
    particles
}

fn planned(folder: &Path) -> Job {
    let options =
        Options { target: Target::Ratio(200.0), seed: 3, certificate: false, blocks: Some(2), ..Options::default() };
    let task = Task { options: &options, snapshot: "a sample".into(), place: "here", replace: false };
    plan(Source::Now(sample()), &task, folder, &Silent).unwrap().job
}

/// A sound block with a right report is refused where it is another block's.
#[test]
fn blocks_that_changed_places_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let job = planned(&folder.path().join("job"));
    let source = || -> particlegs::Result<Layered> { panic!("buckets are enough") };
    for block in 0..2 {
        job.block(block, source, &Silent).unwrap();
    }
    job.verify(None, &Silent).unwrap();
    let path = |block: u32, kind: &str| job.folder.join(format!("blocks/{block:05}.{kind}"));
    std::fs::copy(path(0, "pgs"), path(1, "pgs")).unwrap();
    let report = std::fs::read_to_string(path(0, "json")).unwrap();
    std::fs::write(path(1, "json"), report.replace("\"block\": 0", "\"block\": 1")).unwrap();
    let error = job.verify(None, &Silent).unwrap_err().to_string();
    assert!(error.contains("00001.pgs") && error.contains("not those of block 1"), "{error}");
}

#[test]
fn a_block_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let source = || -> particlegs::Result<Layered> { panic!("buckets are enough") };
    let job = planned(&folder.path().join("whole"));
    job.block(0, source, &Silent).unwrap();
    let whole = std::fs::read(job.folder.join("blocks/00000.pgs")).unwrap();

    let job = planned(&folder.path().join("stopped"));
    let checkpoint = job.folder.join("blocks/00000.checkpoint");
    let (mut stops, mut questions) = (0, 20);
    let pieces = loop {
        match job.block(0, source, &StopsAt(AtomicU64::new(questions))) {
            Ok(Done::Now(_, before)) => break before,
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
    assert!(matches!(job.block(0, source, &Silent), Ok(Done::Before(_))));
}
