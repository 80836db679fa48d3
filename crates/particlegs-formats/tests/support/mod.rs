//! Functions that the suites share: places of files, counted memory, reading a whole file.
// Each suite uses its part.
#![allow(dead_code)]

use particlegs_core::context::Context;
use particlegs_formats::{Choice, PathKind, Snapshot};
use particlegs_particles::{RUN, SnapshotReader};
use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// The files of this crate that hold the sample's first fifty particles.
pub fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// Other files of this crate, by folder.
pub fn data(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(folder)
}

/// Files of a folder that are no scripts and no pages, by name.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path());
    let mut files: Vec<PathBuf> = entries.filter(|p| p.is_file()).collect();
    files.retain(|p| p.extension().is_none_or(|e| e != "py" && e != "md"));
    files.sort();
    files
}

/// The first particles of the bundled sample.
pub fn sample(count: usize) -> Vec<[f64; 3]> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64");
    let column = |name: &str| -> Vec<f64> {
        let bytes = std::fs::read(folder.join(name)).expect("the sample");
        bytes[..4 * count].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into()).collect()
    };
    let (x, y, z) = (column("xx.f32"), column("yy.f32"), column("zz.f32"));
    (0..count).map(|i| [x[i], y[i], z[i]]).collect()
}

/// Counts what is allocated.
pub struct CountingAllocator;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static LARGEST: AtomicUsize = AtomicUsize::new(0);

fn grown(by: usize) {
    let live = LIVE.fetch_add(by, Relaxed) + by;
    PEAK.fetch_max(live, Relaxed);
}

// SAFETY: every call goes to the system's allocator as it is.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        LARGEST.fetch_max(layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        LARGEST.fetch_max(layout.size(), Relaxed);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // The old stretch lives until the new one is filled.
        grown(size);
        LIVE.fetch_sub(layout.size(), Relaxed);
        LARGEST.fetch_max(size, Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Memory in use now; peaks are counted from here on.
fn start_counting() -> usize {
    let live = LIVE.load(Relaxed);
    PEAK.store(live, Relaxed);
    LARGEST.store(0, Relaxed);
    live
}

/// The largest sum of memory in use, and the largest single allocation, since the last start.
fn counted() -> (usize, usize) {
    (PEAK.load(Relaxed), LARGEST.load(Relaxed))
}

/// The result of a piece of work, or that it panicked, and the time and memory that it took.
pub struct ResourceUse<T> {
    pub result: std::thread::Result<T>,
    pub time: Duration,
    /// Bytes that were taken beside those before.
    pub peak: usize,
    /// Bytes of the largest allocation.
    pub largest: usize,
}

/// Does some work, and counts.
pub fn measured<T>(work: impl FnOnce() -> T) -> ResourceUse<T> {
    let before = start_counting();
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(work));
    let (peak, largest) = counted();
    ResourceUse { result, time: start.elapsed(), peak: peak.saturating_sub(before), largest }
}

/// The name of the format that a file's content has.
pub fn format_of(path: &Path) -> Option<&'static str> {
    match PathKind::from_path(path) {
        PathKind::Snapshot(format) => Some(format.name),
        _ => None,
    }
}

/// Opens a file, optionally with a format and a frame.
pub fn open(path: &Path, format: Option<&str>, frame: Option<i64>) -> particlegs_core::Result<Box<dyn Snapshot>> {
    let options = Choice { format: format.map(String::from), frame, ..Choice::default() };
    options.open(&[path.to_path_buf()])
}

/// Opens a file and reads every particle of every species; NaN and infinity are errors, as they
/// are for those who load particles. Gives the number of particles.
pub fn read_everything(path: &Path, format: Option<&str>) -> particlegs_core::Result<u64> {
    let snapshot = open(path, format, None)?;
    let mut total = 0;
    for species in 0..snapshot.description().species.len() {
        let reader = snapshot.reader(species, &Choice::default())?;
        let runs = reader.count().div_ceil(RUN as u64);
        reader.read(0..runs, &Context::SILENT, &|_, chunk| {
            let columns = chunk.position.iter().chain(&chunk.weight);
            match columns.flat_map(|c| c.iter()).find(|v| !v.is_finite()) {
                Some(v) => Err(particlegs_core::Error::input(path, format!("a particle lies at {v}"))),
                None => Ok(()),
            }
        })?;
        drop(reader.in_place());
        total += reader.count();
    }
    Ok(total)
}

/// All positions of a reader, and its weights, in order.
pub fn positions(reader: &dyn SnapshotReader) -> particlegs_core::Result<(Vec<[f64; 3]>, Vec<f32>)> {
    let origin = reader.origin();
    let count = reader.count() as usize;
    let weights = if reader.has_weights() { count } else { 0 };
    let all = Mutex::new((vec![[f64::NAN; 3]; count], vec![f32::NAN; weights]));
    reader.read(0..count.div_ceil(RUN) as u64, &Context::SILENT, &|run, chunk| {
        let mut all = all.lock().expect("no reader panics");
        let start = run as usize * RUN;
        for i in 0..chunk.len() {
            all.0[start + i] = std::array::from_fn(|k| origin[k] + f64::from(chunk.position[k][i]));
        }
        if let Some(w) = chunk.weight {
            all.1[start..start + w.len()].copy_from_slice(w);
        }
        Ok(())
    })?;
    Ok(all.into_inner().expect("no reader panics"))
}

/// The particles of a species: position and weight, 0 without weights.
pub fn particles(snapshot: &dyn Snapshot, species: usize, choice: &Choice) -> particlegs_core::Result<Vec<[f64; 4]>> {
    let (positions, weights) = positions(&*snapshot.reader(species, choice)?)?;
    let weight = |i: usize| weights.get(i).map_or(0.0, |w| f64::from(*w));
    Ok(positions.iter().enumerate().map(|(i, &[x, y, z])| [x, y, z, weight(i)]).collect())
}
