//! Broken files, each of which is refused in one line that names it, at once and in little memory; and damaged copies of
//! every fixture: cut at every byte, bits of the beginning flipped: every one of each format's smallest files, some of
//! the others. None may panic, hang, or take much memory; most are refused.

mod support;

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};
use support::{ResourceUse, measured};

#[global_allocator]
static COUNTING: support::CountingAllocator = support::CountingAllocator;

/// No allocation may be larger.
const MOST_BYTES: usize = 64 << 20;
/// No case may take longer.
const LONGEST: Duration = Duration::from_secs(1);
/// Every byte of so many first and last ones is cut at, and every 97th between.
const FIRST: u64 = 4096;
const LAST: u64 = 1024;
const BETWEEN: usize = 97;
/// Every bit is flipped of so many files of a format, the smallest,
const CLOSELY: usize = 2;
/// and every so-manyth of the others, a number that is coprime to a byte's bits.
const SPARSELY: usize = 5;

/// One damaged copy.
#[derive(Clone, Copy, Debug)]
enum Damage {
    /// Only so many bytes are left.
    Cut(u64),
    /// This bit of this byte is flipped.
    Flip(u64, u8),
}

fn damages(length: u64, step: usize) -> Vec<Damage> {
    // Longest first: the file is then cut shorter and shorter.
    let near = (0..length).rev().filter(|&at| at < FIRST || at + LAST >= length);
    let between = (FIRST..length.saturating_sub(LAST)).step_by(BETWEEN);
    let mut cuts: Vec<u64> = near.chain(between).collect();
    cuts.sort_unstable_by(|a, b| b.cmp(a));
    let flips = (0..length.min(FIRST)).flat_map(|at| (0..8).map(move |bit| Damage::Flip(at, bit)));
    flips.step_by(step).chain(cuts.into_iter().map(Damage::Cut)).collect()
}

/// The formats that a damaged copy is read in: its own, and the one that its content now says.
fn read(path: &Path, format: &str) -> usize {
    let mut refused = usize::from(support::read_everything(path, Some(format)).is_err());
    if let Some(other) = support::format_of(path).filter(|other| *other != format) {
        refused += usize::from(support::read_everything(path, Some(other)).is_err());
    }
    refused
}

/// A run over mutations: the file, and the numbers of cases done and refused.
struct MutationRun {
    name: String,
    format: &'static str,
    bytes: Vec<u8>,
    done: AtomicUsize,
    refused: AtomicUsize,
    faults: Mutex<BTreeSet<String>>,
}

impl MutationRun {
    fn new(path: &Path) -> Result<MutationRun, String> {
        let format = support::format_of(path).ok_or("no known format")?;
        support::read_everything(path, None).map_err(|e| format!("as it is: {e}"))?;
        let name = path.file_name().expect("a file").to_string_lossy().into_owned();
        let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
        Ok(MutationRun { name, format, bytes, done: 0.into(), refused: 0.into(), faults: Mutex::default() })
    }

    fn fault(&self, message: String) {
        self.faults.lock().expect("no thread dies").insert(format!("{}: {message}", self.name));
    }

    fn case(&self, damage: Damage, path: &Path, file: &File) {
        match damage {
            Damage::Cut(length) => file.set_len(length).expect("a file that can be cut"),
            Damage::Flip(at, bit) => {
                file.write_all_at(&[self.bytes[at as usize] ^ 1 << bit], at).expect("a file that can be written")
            }
        }
        let watch = CaseWatchdog::start(format!("{} {damage:?}", self.name));
        let ResourceUse { result, time, largest, .. } = measured(|| read(path, self.format));
        drop(watch);
        match result {
            Ok(refused) => drop(self.refused.fetch_add(refused.min(1), Relaxed)),
            Err(_) => {
                let message = PANIC.lock().unwrap_or_else(|e| e.into_inner());
                self.fault(format!("{damage:?} panics: {message}"));
            }
        }
        // A busy machine may stop any process for a second, but not the same case twice.
        if time > LONGEST && (0..2).all(|_| self.is_slow(path)) {
            self.fault(format!("{damage:?} takes {time:?}"));
        }
        if largest > MOST_BYTES {
            self.fault(format!("{damage:?} takes {} MiB at once", largest >> 20));
        }
        if let Damage::Flip(at, _) = damage {
            file.write_all_at(&self.bytes[at as usize..=at as usize], at).expect("a file that can be written");
        }
        self.done.fetch_add(1, Relaxed);
    }

    fn is_slow(&self, path: &Path) -> bool {
        measured(|| read(path, self.format)).time > LONGEST
    }

    /// All damages, in a copy of the same name; of its bits every `step`-th.
    fn all(&self, step: usize) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(&self.name);
        std::fs::write(&path, &self.bytes).expect("a copy");
        let file = OpenOptions::new().write(true).open(&path).expect("the copy");
        let start = Instant::now();
        for damage in damages(self.bytes.len() as u64, step) {
            self.case(damage, &path, &file);
        }
        let (done, refused) = (self.done.load(Relaxed), self.refused.load(Relaxed));
        println!(
            "{} ({}): {done} cases, {refused} refused, {:.1} s",
            self.name,
            self.format,
            start.elapsed().as_secs_f64()
        );
    }
}

/// The case that runs, while it runs: the process ends where it hangs, for nothing else would name it.
struct CaseWatchdog;

static CURRENT: Mutex<Option<(Instant, String)>> = Mutex::new(None);

impl CaseWatchdog {
    fn start(case: String) -> CaseWatchdog {
        static DOG: Once = Once::new();
        *CURRENT.lock().expect("no thread dies") = Some((Instant::now(), case));
        DOG.call_once(|| drop(std::thread::spawn(CaseWatchdog::look)));
        CaseWatchdog
    }

    fn look() {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let current = CURRENT.lock().expect("no thread dies");
            if let Some((_, case)) = current.as_ref().filter(|c| c.0.elapsed() > Duration::from_secs(30)) {
                eprintln!("hangs: {case}");
                std::process::abort();
            }
        }
    }
}

impl Drop for CaseWatchdog {
    fn drop(&mut self) {
        *CURRENT.lock().expect("no thread dies") = None;
    }
}

/// The last panic's message.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Runs files through, smallest first, and lists all faults at the end.
fn damage_all(files: &[PathBuf]) {
    // Faults are listed below; every panic's own report would bury them.
    std::panic::set_hook(Box::new(|info| {
        *PANIC.lock().unwrap_or_else(|e| e.into_inner()) = info.to_string().replace('\n', " ");
    }));
    let (mut faults, mut seen) = (Vec::new(), Vec::new());
    for path in files {
        match MutationRun::new(path) {
            Ok(run) => {
                let before = seen.iter().filter(|f| **f == run.format).count();
                seen.push(run.format);
                run.all(if before < CLOSELY { 1 } else { SPARSELY });
                faults.extend(run.faults.into_inner().expect("no thread dies").into_iter().take(8));
            }
            Err(message) => faults.push(format!("{}: {message}", path.display())),
        }
    }
    drop(std::panic::take_hook());
    let formats: BTreeSet<&str> = seen.into_iter().collect();
    assert_eq!(formats.len(), particlegs_formats::Choice::formats().count(), "{formats:?}");
    assert!(faults.is_empty(), "{} faults (8 a file at most):\n{}", faults.len(), faults.join("\n"));
}

/// One at a time: what is allocated is counted for the whole process.
static ONE: Mutex<()> = Mutex::new(());

#[test]
#[ignore = "six hundred thousand damaged files: a minute"]
fn damaged_fixtures_do_no_harm() {
    let _one = ONE.lock().unwrap_or_else(|e| e.into_inner());
    let mut files = support::files(&support::fixtures());
    // The parts of one snapshot are refused as soon as one of them is copied alone, damaged or not.
    files.retain(|p| !p.to_string_lossy().contains("_parts."));
    files.sort_by_key(|p| p.metadata().map_or(0, |m| m.len()));
    damage_all(&files);
}

/// Those that are read: a box of 0 is none, and a header may be that of a larger snapshot, which a note says.
const GOOD: [&str; 2] = ["hdf5_box0.hdf5", "hdf5_count_lies.hdf5"];
/// No broken file may take more in all.
const MOST_IN_ALL: usize = 100 << 20;

fn check(path: &Path, refused: bool) -> Vec<String> {
    let mut wrong = Vec::new();
    let name = path.file_name().expect("a file").to_string_lossy().into_owned();
    let ResourceUse { result, time, peak, largest } = measured(|| support::read_everything(path, None));
    match result {
        Err(_) => wrong.push("it panics".into()),
        Ok(Ok(n)) if refused => wrong.push(format!("it is read: {n} particles")),
        Ok(Ok(_)) => {}
        Ok(Err(e)) if !refused => wrong.push(format!("it is refused: {e}")),
        Ok(Err(e)) => {
            let text = e.to_string();
            println!("{text} | {}", e.hint());
            if text.contains('\n') || e.hint().to_string().contains('\n') {
                wrong.push(format!("more than a line: {text:?}"));
            }
            if !text.contains(&name) {
                wrong.push(format!("the file is not named: {text}"));
            }
        }
    }
    if time > LONGEST {
        wrong.push(format!("it takes {time:?}"));
    }
    if peak > MOST_IN_ALL {
        wrong.push(format!("it takes {} MiB, {} MiB at once", peak >> 20, largest >> 20));
    }
    wrong.into_iter().map(|message| format!("{name}: {message}")).collect()
}

#[test]
fn every_broken_file_is_refused_in_one_line() {
    let _one = ONE.lock().unwrap_or_else(|e| e.into_inner());
    let files = support::files(&support::data("bad"));
    assert!(files.len() >= 75, "{} files", files.len());
    let wrong: Vec<String> = files.iter().flat_map(|p| check(p, !GOOD.iter().any(|good| p.ends_with(good)))).collect();
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}
