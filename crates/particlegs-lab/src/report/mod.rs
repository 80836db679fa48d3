//! Results as files: CSV tables, Markdown pages and one self-contained HTML page, with their provenance.

mod html;
mod markdown;
mod text;

pub use html::html;
pub use markdown::markdown;
pub use text::{csv, text};

use crate::experiments::Experiment;
use crate::results::ExperimentResults;
use serde::Serialize;

/// An experiment that was run.
pub struct ReportSection {
    pub experiment: &'static Experiment,
    /// Results, or why there are none.
    pub found: Result<ExperimentResults, String>,
}

/// Program, machine and command.
#[derive(Clone, Debug, Serialize)]
pub struct Provenance {
    pub version: String,
    /// Commit of the program, if it was built in a repository.
    pub commit: Option<String>,
    pub command: String,
    /// CPU, as the system names it.
    pub processor: Option<String>,
    pub threads: usize,
    /// Memory in bytes.
    pub memory_bytes: Option<u64>,
    /// Operating system and architecture.
    pub system: String,
    /// Snapshots: name, particles, hash.
    pub snapshots: Vec<(String, u64, String)>,
    /// First seed, and how many.
    pub seeds: [u64; 2],
    /// Versions of other programs that took part.
    pub others: Vec<String>,
}

impl Provenance {
    /// This program on this machine, running `command`.
    pub fn new(command: String, threads: usize) -> Provenance {
        Provenance {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: option_env!("PARTICLEGS_COMMIT").map(str::to_string),
            command,
            processor: line_of("/proc/cpuinfo", "model name"),
            threads,
            memory_bytes: line_of("/proc/meminfo", "MemTotal")
                .and_then(|v| Some(1024 * v.split(' ').next()?.parse::<u64>().ok()?)),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            snapshots: Vec::new(),
            seeds: [0, 0],
            others: Vec::new(),
        }
    }

    pub fn describe(&self) -> Vec<String> {
        let commit = self.commit.as_ref().map_or(String::new(), |c| format!(", commit {c}"));
        let memory = self.memory_bytes.map_or(String::new(), |b| format!(", {:.0} GiB", b as f64 / 1073741824.0));
        let processor = self.processor.as_deref().unwrap_or("unknown CPU");
        let mut lines = vec![
            format!("Command: `{}`", self.command),
            format!("particlegs {}{commit}", self.version),
            format!("Machine: {processor}, {} threads{memory}, {}", self.threads, self.system),
            format!("Seeds: {} seeds, starting at {}", self.seeds[1], self.seeds[0]),
        ];
        for (name, particles, hash) in &self.snapshots {
            lines.push(format!("Snapshot {name}: {particles} particles, BLAKE3 {hash}"));
        }
        lines.extend(self.others.iter().cloned());
        lines
    }
}

/// Looks up a name in a file of `name : value` lines.
pub(crate) fn line_of(path: &str, name: &str) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|l| l.starts_with(name))?;
    Some(line.split_once(':')?.1.trim().to_string())
}
