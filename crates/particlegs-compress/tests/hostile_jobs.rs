//! JobFolder folders whose files were altered on purpose, with checksums that fit: every step ends with a
//! result or an error, without a panic, in bounded time and memory.

#![allow(clippy::disallowed_methods)]
#![allow(missing_docs)]

mod common;

use common::layer;
use particlegs_compress::job::JobFolder;
use particlegs_compress::{Options, Target};
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_core::model::CertificateLevel;
use particlegs_fit::Effort;
use particlegs_particles::{LayeredParticles, Particles};
use serde_json::{Value, json};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Refuses allocations that no small job needs: a process would end by them, or the machine.
struct BoundedAllocator;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it is.
unsafe impl GlobalAlloc for BoundedAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Relaxed);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST.fetch_max(size, Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: BoundedAllocator = BoundedAllocator;

/// The jobs here hold some kilobytes; no allocation may be larger.
const MOST_BYTES: usize = 256 << 20;
/// No step may take longer, on a busy machine and without optimisation.
const LONGEST: Duration = Duration::from_secs(60);

fn particles() -> Particles {
    let mut random = Random::new(5, 1, 0);
    let mut column = || (0..900).map(|_| (100.0 * random.uniform()) as f32).collect::<Vec<f32>>();
    let particles = Particles::from_columns(column(), column(), column());
    particles.with_layers(vec![layer("gas", 0..500), layer("stars", 500..900)])
}

fn planned(folder: &Path) -> JobFolder {
    let (target, effort, certificate) = (Target::Gaussians(8), Effort::Fast, CertificateLevel::None);
    common::planned(
        &particles(),
        folder,
        Options { target, effort, certificate, blocks: Some(2), ..Options::default() },
    )
}

/// A whole job to be altered: planned, one of two blocks done.
fn prepared(folder: &Path) {
    let job = planned(folder);
    job.block(0, || Ok(LayeredParticles::from_particles(&particles())), &Context::SILENT).unwrap();
}

fn copy(from: &Path, to: &Path) {
    for part in ["", "blocks", "scatter"] {
        std::fs::create_dir_all(to.join(part)).unwrap();
        for entry in std::fs::read_dir(from.join(part)).unwrap().map(|e| e.unwrap()) {
            if entry.file_type().unwrap().is_file() {
                std::fs::copy(entry.path(), to.join(part).join(entry.file_name())).unwrap();
            }
        }
    }
}

/// Every step on a folder; the errors in words.
fn steps(folder: &Path, alteration: &str) -> Vec<String> {
    let began = Instant::now();
    LARGEST.store(0, Relaxed);
    let source = || Ok(LayeredParticles::from_particles(&particles()));
    let run = || -> Vec<String> {
        // Ends work that goes on beyond its time, so that a fault is told instead of a hung suite.
        let late = || began.elapsed() > LONGEST;
        let until = Context::SILENT.with_cancel(&late);
        let mut errors = Vec::new();
        let mut note = |result: particlegs_core::Result<()>| errors.extend(result.err().map(|e| e.to_string()));
        let job = match JobFolder::open(folder) {
            Ok(job) => job,
            Err(e) => return vec![e.to_string()],
        };
        let _ = (job.task_bytes(), job.merge_bytes());
        note(job.status().map(drop));
        note(job.verify(None, &until));
        note(job.verify(source().ok(), &until));
        note(job.scatter(source, 0, &until).map(drop));
        (0..2).for_each(|b| note(job.block(b, source, &until).map(drop)));
        note(job.merge(CertificateLevel::None, None, &until).map(drop));
        errors
    };
    let done = std::panic::catch_unwind(run);
    let errors = done.unwrap_or_else(|_| panic!("a panic after {alteration}"));
    assert!(began.elapsed() < LONGEST, "{:?} after {alteration}", began.elapsed());
    assert!(LARGEST.load(Relaxed) <= MOST_BYTES, "{} bytes at once after {alteration}", LARGEST.load(Relaxed));
    assert!(errors.iter().all(|e| !e.is_empty() && e.len() < 600), "{alteration}: {errors:?}");
    errors
}

/// Replaces four checksum bytes by those that fit what is before them.
fn seal(bytes: &mut [u8], end: usize) {
    let crc = crc32fast::hash(&bytes[..end]).to_le_bytes();
    bytes[end..end + 4].copy_from_slice(&crc);
}

const HEAD: usize = 60;
/// Offset, two layers' counts, checksum of the particles; then the entry's own.
const ENTRY: usize = 8 + 8 * 2 + 4 + 4;

/// Names the plan that is there now in the files that belong to it.
fn adopt(folder: &Path) {
    let text = std::fs::read(folder.join("plan.json")).unwrap();
    let id = blake3::hash(&text);
    let mut runs = std::fs::read(folder.join("runs.bin")).unwrap();
    runs[8..40].copy_from_slice(id.as_bytes());
    let end = runs.len() - 4;
    seal(&mut runs, end);
    std::fs::write(folder.join("runs.bin"), runs).unwrap();
    let bucket = folder.join("scatter/00000.bin");
    let mut bytes = std::fs::read(&bucket).unwrap();
    bytes[8..40].copy_from_slice(id.as_bytes());
    seal(&mut bytes, HEAD - 4);
    std::fs::write(bucket, bytes).unwrap();
    let report = folder.join("blocks/00000.json");
    let mut value: Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    value["plan"] = id.to_hex().to_string().into();
    std::fs::write(report, value.to_string()).unwrap();
}

/// The places of all values within a document.
fn places(value: &Value, here: &str, out: &mut Vec<String>) {
    out.push(here.to_string());
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| places(v, &format!("{here}/{k}"), out)),
        Value::Array(items) => items.iter().enumerate().for_each(|(i, v)| places(v, &format!("{here}/{i}"), out)),
        _ => {}
    }
}

/// Values that stand in a value's place.
fn odd_values() -> Vec<Value> {
    vec![
        json!(0),
        json!(1),
        json!(2),
        json!(-1),
        json!(1e308),
        json!(-1e308),
        json!(5e-324),
        json!(1e-9),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(1u64 << 53),
        json!(null),
        json!(true),
        json!("x\u{1b}[2J"),
        json!([]),
        json!({}),
        json!([0, 0, 0]),
        json!("x".repeat(400)),
    ]
}

/// `count` altered documents: one or two values of each replaced.
fn altered(original: &Value, count: u64, seed: u64) -> Vec<(Value, String)> {
    let (mut all, odd) = (Vec::new(), odd_values());
    places(original, "", &mut all);
    (0..count)
        .map(|case| {
            let mut random = Random::new(seed, 2, case);
            let mut pick = |n: usize| ((random.uniform() * n as f64) as usize).min(n - 1);
            let (mut value, mut alteration) = (original.clone(), String::new());
            for _ in 0..1 + case % 2 {
                let (place, by) = (&all[1 + pick(all.len() - 1)], &odd[pick(odd.len())]);
                if let Some(at) = value.pointer_mut(place) {
                    *at = by.clone();
                    alteration += &format!("{place} = {by} ");
                }
            }
            (value, alteration)
        })
        .collect()
}

/// Alters copies of a prepared job by `alter`, and runs every step on each.
fn each(cases: impl IntoIterator<Item = HostileCase>) -> Vec<Vec<String>> {
    let dir = tempfile::tempdir().unwrap();
    let (whole, broken) = (dir.path().join("whole"), dir.path().join("broken"));
    prepared(&whole);
    let run = |(alteration, alter): HostileCase| {
        copy(&whole, &broken);
        alter(&broken);
        let errors = steps(&broken, &alteration);
        std::fs::remove_dir_all(&broken).unwrap();
        errors
    };
    cases.into_iter().map(run).collect()
}

type HostileCase = (String, Box<dyn Fn(&Path)>);

fn write(name: &'static str, bytes: Vec<u8>) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| std::fs::write(folder.join(name), &bytes).unwrap())
}

#[test]
fn a_sound_job_passes_every_step() {
    let none: Box<dyn Fn(&Path)> = Box::new(|_| {});
    let adopted: Box<dyn Fn(&Path)> = Box::new(adopt);
    for errors in each([("nothing".to_string(), none), ("its own seals".to_string(), adopted)]) {
        // Verifying twice and merging twice: blocks done in between are found.
        assert!(errors.is_empty(), "{errors:?}");
    }
}

#[test]
fn altered_plans_are_refused_or_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let original: Value =
        serde_json::from_slice(&std::fs::read(planned(dir.path()).folder.join("plan.json")).unwrap()).unwrap();
    let case = |(plan, alteration): (Value, String)| -> HostileCase {
        let text = plan.to_string();
        let alter = move |folder: &Path| {
            std::fs::write(folder.join("plan.json"), &text).unwrap();
            adopt(folder);
        };
        (format!("plan.json: {alteration}"), Box::new(alter))
    };
    let errors = each(altered(&original, 160, 11).into_iter().map(case));
    let refused = errors.iter().filter(|e| !e.is_empty()).count();
    assert!(refused > 80, "{refused} of {} were refused", errors.len());
}

#[test]
fn trees_whose_walks_never_end_are_refused() {
    // Every cut has one child twice: walks through it would never end.
    let nodes: Vec<Value> = (0..60)
        .map(|i| json!({ "cut": { "axis": 0, "at": 0.0, "below": i + 1, "above": i + 1 } }))
        .chain([json!({ "block": 0 }), json!({ "block": 1 })])
        .collect();
    let alter = move |folder: &Path| {
        let path = folder.join("plan.json");
        let mut plan: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        plan["plan"]["tree"]["nodes"] = nodes.clone().into();
        plan["chunks"] = 0.into();
        std::fs::write(path, plan.to_string()).unwrap();
        adopt(folder);
    };
    let errors = each([("tree".to_string(), Box::new(alter) as Box<dyn Fn(&Path)>)]);
    assert!(errors[0][0].contains("the plan is not valid"), "{errors:?}");
}

#[test]
fn altered_files_of_a_job_are_refused_or_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    prepared(dir.path());
    let read = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    let mut cases: Vec<HostileCase> = Vec::new();
    for name in ["plan.json", "runs.bin", "scatter/00000.bin", "blocks/00000.json", "blocks/00000.pgs"] {
        let bytes = read(name);
        cases.push((format!("{name}: empty"), write(name, Vec::new())));
        cases.push((format!("{name}: zeros"), write(name, vec![0; 70_000])));
        cases.push((format!("{name}: cut"), write(name, bytes[..bytes.len() / 2].to_vec())));
        cases.push((format!("{name}: longer"), write(name, [&bytes[..], b"more"].concat())));
    }
    let checkpoint = [&b"PGSCKPT2"[..], &[0; 32], &[255; 40]].concat();
    cases.push(("blocks/00001.checkpoint: garbage".into(), write("blocks/00001.checkpoint", checkpoint)));
    let numbers: [[u8; 4]; 6] = [f32::NAN, f32::INFINITY, -1e38, 1e38, 1e-45, 0.0].map(f32::to_le_bytes);
    for number in numbers {
        // Bounds of the first run, and a coordinate in a bucket, with the right checksums.
        let mut runs = read("runs.bin");
        runs[40..44].copy_from_slice(&number);
        let end = runs.len() - 4;
        seal(&mut runs, end);
        cases.push((format!("runs.bin: a bound of {number:?}"), write("runs.bin", runs)));
        let mut buckets = read("scatter/00000.bin");
        let entry = HEAD + ENTRY;
        let at = u64::from_le_bytes(buckets[entry..entry + 8].try_into().unwrap()) as usize;
        buckets[at..at + 4].copy_from_slice(&number);
        let counts = [8, 16].map(|i| u64::from_le_bytes(buckets[entry + i..][..8].try_into().unwrap()) as usize);
        let crc = crc32fast::hash(&buckets[at..at + 12 * (counts[0] + counts[1])]).to_le_bytes();
        buckets[entry + 24..entry + 28].copy_from_slice(&crc);
        seal(&mut buckets[entry..], 28);
        cases.push((format!("a bucket's coordinate: {number:?}"), write("scatter/00000.bin", buckets)));
    }
    for (field, value) in [0, 8, 16].into_iter().flat_map(|f| [0, 1, 1 << 20, 1 << 40, u64::MAX].map(|v| (f, v))) {
        let mut buckets = read("scatter/00000.bin");
        let entry = HEAD + ENTRY;
        buckets[entry + field..entry + field + 8].copy_from_slice(&u64::to_le_bytes(value));
        seal(&mut buckets[entry..], 28);
        cases.push((format!("a bucket's entry at {field}: {value}"), write("scatter/00000.bin", buckets)));
    }
    let report: Value = serde_json::from_slice(&read("blocks/00000.json")).unwrap();
    for (value, alteration) in altered(&report, 40, 13) {
        cases.push((format!("report: {alteration}"), write("blocks/00000.json", value.to_string().into_bytes())));
    }
    each(cases);
}
