//! Whole commands as child processes: seconds, CPU time and peak memory; and the raw float32 files that they read: the
//! snapshot's positions, and parts and copies of them.

use super::clock::{digits, load};
use crate::lab::Lab;
use crate::results::TableCell;
use crate::snapshot::Snapshot;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_files::output::FileSet;
use particlegs_particles::{RawForm, SelectedParticles, Selection, Tiling};
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Interval between two looks at a running child.
const EVERY: Duration = Duration::from_millis(1);
/// Clock ticks per second in /proc, the same on every Linux.
const TICKS: f64 = 100.0;
/// Most characters of a failed child's message.
const MOST_WORDS: usize = 300;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Cost {
    /// Wall-clock seconds.
    pub seconds: f64,
    /// CPU seconds over all threads; `None` without /proc.
    pub processor: Option<f64>,
    /// Peak of the memory that no file backs (RssAnon and RssShmem), bytes; `None` without /proc.
    pub peak: Option<u64>,
    /// Load of the machine at the end.
    pub load: Option<f64>,
}

impl Cost {
    /// Seconds, CPU seconds, MiB, load.
    pub fn cells(&self) -> [TableCell; 4] {
        let missing =
            |cell: TableCell| if cell == TableCell::Empty { TableCell::text("not measured: no /proc") } else { cell };
        [
            TableCell::number(self.seconds, digits(self.seconds)),
            missing(TableCell::number(self.processor, 2)),
            missing(TableCell::number(self.peak.map(|b| b as f64 / 1048576.0), 1)),
            TableCell::number(self.load, 1),
        ]
    }
}

/// The cost of a command, or why it failed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct CommandRun {
    /// `None` if it failed.
    pub cost: Option<Cost>,
    /// Its standard output, or the reason of its failure in one line.
    pub said: String,
}

impl CommandRun {
    /// Failed commands are not cached, but tried again the next time.
    pub fn failed(&self) -> bool {
        self.cost.is_none()
    }
}

/// Runs a command to its end; `folder` holds its output.
pub(super) fn run(command: &mut Command, input: &str, folder: &Path, context: &Context<'_>) -> Result<CommandRun> {
    let names = ["stdin", "stdout", "stderr"].map(|n| folder.join(n));
    let io = |path: &Path, e| Error::io(path, e);
    std::fs::write(&names[0], input).map_err(|e| io(&names[0], e))?;
    let open = |i: usize| if i == 0 { File::open(&names[i]) } else { File::create(&names[i]) };
    let [stdin, stdout, stderr] = [open(0), open(1), open(2)];
    let file = |f: std::io::Result<File>| f.map(Stdio::from).map_err(|e| io(folder, e));
    command.stdin(file(stdin)?).stdout(file(stdout)?).stderr(file(stderr)?);
    let before = processor_of_children();
    let start = Instant::now();
    let mut child = command.spawn().map_err(|e| io(Path::new(command.get_program()), e))?;
    let (status, peak) = watch(&mut child, context)?;
    let seconds = start.elapsed().as_secs_f64();
    let processor = processor_of_children().zip(before).map(|(after, before)| after - before);
    let text = |i: usize| String::from_utf8_lossy(&std::fs::read(&names[i]).unwrap_or_default()).into_owned();
    if status.success() {
        return Ok(CommandRun { cost: Some(Cost { seconds, processor, peak, load: load() }), said: text(1) });
    }
    // Ctrl-C also reaches the child, which may end first: report the stop, not a failure.
    context.check()?;
    let words = |l: &&str| !l.is_empty() && !l.starts_with("hint:");
    let last = text(2).lines().rev().map(str::trim).find(words).unwrap_or_default().to_string();
    let why = if last.is_empty() { status.to_string() } else { last };
    Ok(CommandRun { cost: None, said: why.chars().take(MOST_WORDS).collect() })
}

/// Waits for a child; returns its peak memory.
fn watch(child: &mut Child, context: &Context<'_>) -> Result<(std::process::ExitStatus, Option<u64>)> {
    let status = format!("/proc/{}/status", child.id());
    let mut peak = None;
    loop {
        // Read before the wait: a child that was waited for has no status file.
        peak = peak.max(std::fs::read_to_string(&status).ok().and_then(|text| unbacked(&text)));
        match child.try_wait() {
            Ok(Some(status)) => return Ok((status, peak)),
            Ok(None) if context.cancelled() => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(Error::Cancelled);
            }
            Ok(None) => std::thread::sleep(EVERY),
            Err(e) => return Err(Error::io(Path::new(&status), e)),
        }
    }
}

/// Bytes that no file backs, from /proc/PID/status; `None` if the process has ended.
fn unbacked(status: &str) -> Option<u64> {
    let kibibytes_of = |name: &str| {
        let line = status.lines().find(|l| l.starts_with(name))?;
        line.split_whitespace().nth(1)?.parse::<u64>().ok()
    };
    Some(1024 * (kibibytes_of("RssAnon:")? + kibibytes_of("RssShmem:").unwrap_or(0)))
}

/// CPU seconds of this process's ended children; `None` without /proc.
fn processor_of_children() -> Option<f64> {
    of_children(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

/// cutime and cstime from /proc/PID/stat: fields 16 and 17 (proc(5)).
fn of_children(stat: &str) -> Option<f64> {
    // The second field, a name in parentheses, may contain anything.
    let after: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| after.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(16)? + ticks(17)?) / TICKS)
}

/// Temporary folder; files are written on demand.
pub(super) struct RawCopy<'a> {
    lab: &'a Lab<'a>,
    of: &'a Snapshot,
    set: OnceCell<FileSet>,
}

impl<'a> RawCopy<'a> {
    pub fn new(lab: &'a Lab<'a>, snapshot: &'a Snapshot) -> RawCopy<'a> {
        RawCopy { lab, of: snapshot, set: OnceCell::new() }
    }

    pub fn folder(&self) -> Result<&Path> {
        if self.set.get().is_none() {
            let _ = self.set.set(self.lab.store.scratch()?);
        }
        Ok(self.set.get().map_or(Path::new(""), FileSet::path))
    }

    pub fn snapshot(&self) -> Result<PathBuf> {
        self.written("all", Tiling::single(), Selection::all())
    }

    /// A selection of the tiled snapshot, written to a folder of this name.
    pub fn written(&self, name: &str, tiling: Tiling, selection: Selection) -> Result<PathBuf> {
        let path = self.folder()?.join(name);
        if !path.exists() {
            let particles = SelectedParticles::new(&self.of.particles, tiling, selection, self.lab.context)?;
            particles.write_raw(&path, RawForm::Columns, self.lab.context)?;
        }
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn system_files_are_parsed() {
        let status = "Name:\tx\nVmRSS:\t 900 kB\nRssAnon:\t     512 kB\nRssFile:\t 380 kB\nRssShmem:\t   8 kB\n";
        assert_eq!((unbacked(status), unbacked("State:\tZ\n")), (Some(520 * 1024), None));
        let stat = "7 (a) b) S 1 1 1 0 -1 0 1 2 3 4 50 60 150 25 20 0 1 0 9 9 9";
        assert_eq!(of_children(stat), Some(1.75));
    }

    #[test]
    fn a_child_is_measured_and_its_failure_reported() {
        let (dir, shell) = (tempfile::tempdir().unwrap(), Path::new("/bin/sh"));
        if !shell.exists() || !Path::new("/proc/self/stat").exists() {
            return;
        }
        let run =
            |script: &str| run(Command::new(shell).args(["-c", script]), "in\n", dir.path(), &Context::SILENT).unwrap();
        let ran = run("cat; i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done");
        let cost = ran.cost.unwrap();
        assert_eq!(ran.said, "in\n");
        assert!(cost.seconds > 0.0 && cost.peak.unwrap() > 4096 && cost.processor.unwrap() > 0.0, "{cost:?}");
        let failed = run("echo first >&2; echo 'why not' >&2; echo 'hint: do' >&2; exit 3");
        assert!(failed.cost.is_none() && failed.said == "why not", "{failed:?}");
        assert!(run("exit 4").said.contains('4'));
        assert!(run("exit 4").failed() && !run("exit 0").failed());
        let cancelled = Context::SILENT.with_cancel(&|| true);
        // Whichever of the two ends first.
        for script in ["exit 130", "sleep 5"] {
            let stopped = super::run(Command::new(shell).args(["-c", script]), "", dir.path(), &cancelled);
            assert!(matches!(stopped, Err(Error::Cancelled)), "{script}");
        }
    }
}
