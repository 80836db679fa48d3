//! SZ3 and ZFP by their own libraries in the user's Python: a child process runs lab/compressors.py and answers
//! requests over pipes. It ends when its input is closed, so never later than this process.

mod baselines;
mod child;

pub use baselines::{ColumnOrder, CompressionLibrary, LibraryBaseline};

use crate::{Baseline, packed};
use child::{Child, ChildReply};
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The child's program and its requirements.
const SCRIPT: &str = include_str!("../../lab/compressors.py");
const REQUIREMENTS: &str = include_str!("../../lab/requirements.txt");

/// The compressors of a Python. Clones share one child; if it dies, the next request starts it again.
#[derive(Clone)]
pub struct External {
    shared: Arc<SharedChild>,
}

struct SharedChild {
    program: PathBuf,
    arguments: Vec<String>,
    child: Mutex<Option<Child>>,
    /// Versions of the compressors.
    sources: Vec<(String, String)>,
}

struct Request<'a> {
    what: u8,
    name: &'a str,
    bound: f64,
    particles: u64,
    data: &'a [u8],
}

impl External {
    /// Starts a Python, given by its path or by a command name.
    pub fn start(python: &Path) -> Result<External> {
        External::from_command(python, ["-u", "-c", SCRIPT].map(String::from).to_vec())
    }

    fn from_command(program: &Path, arguments: Vec<String>) -> Result<External> {
        let child = Mutex::new(None);
        let mut shared = SharedChild { program: program.into(), arguments, child, sources: Vec::new() };
        let answer = shared.ask(&Request { what: b'v', name: "", bound: 0.0, particles: 0, data: &[] })?;
        let text = String::from_utf8_lossy(&answer).into_owned();
        let lines = text.lines().filter_map(|l| l.split_once(' '));
        shared.sources = lines.map(|(name, source)| (name.into(), source.into())).collect();
        Ok(External { shared: Arc::new(shared) })
    }

    /// SZ3 and ZFP, each in the input order and in Morton order.
    pub fn baselines(&self) -> Vec<Box<dyn Baseline>> {
        let baselines_of = |library| {
            [ColumnOrder::File, ColumnOrder::Morton].map(|order| -> Box<dyn Baseline> {
                Box::new(LibraryBaseline { external: self.clone(), library, order })
            })
        };
        [CompressionLibrary::Sz3, CompressionLibrary::Zfp].into_iter().flat_map(baselines_of).collect()
    }

    /// Version of a compressor.
    fn source(&self, name: &str) -> String {
        self.shared.sources.iter().find(|s| s.0 == name).map_or(String::new(), |s| s.1.clone())
    }

    /// Compresses three columns one after the other, behind a checksum.
    fn compress(&self, name: &str, bound: f64, particles: usize, columns: &[u8]) -> Result<Vec<u8>> {
        let request = Request { what: b'c', name, bound, particles: particles as u64, data: columns };
        Ok(packed::sealed(self.shared.ask(&request)?, 0))
    }

    /// Three columns one after the other.
    fn decompress(&self, name: &str, bytes: &[u8]) -> Result<Vec<u8>> {
        let wrong = || Error::input(name, "the data are corrupt");
        let (data, _) = packed::opened(bytes).ok_or_else(wrong)?;
        self.shared.ask(&Request { what: b'd', name, bound: 0.0, particles: 0, data })
    }
}

impl SharedChild {
    fn ask(&self, request: &Request<'_>) -> Result<Vec<u8>> {
        let mut head = vec![request.what, request.name.len() as u8];
        head.extend(request.name.bytes());
        head.extend(request.bound.to_le_bytes());
        head.extend(request.particles.to_le_bytes());
        let mut slot = self.child.lock().unwrap_or_else(PoisonError::into_inner);
        let mut child = match slot.take() {
            Some(child) => child,
            None => Child::start(&self.program, &self.arguments).map_err(|e| self.not_started(&e))?,
        };
        match child.ask(&[&head, request.data]) {
            Ok(answer) => {
                *slot = Some(child);
                match answer {
                    ChildReply::Bytes(bytes) => Ok(bytes),
                    ChildReply::Error(text) if request.name.is_empty() => Err(Error::input(&self.program, text)),
                    ChildReply::Error(text) => Err(Error::input(request.name, text)),
                    ChildReply::Missing(packages) => Err(self.lacks(&packages)),
                }
            }
            Err(broken) => {
                let last = child.last_words();
                let doing = if request.name.is_empty() { String::new() } else { format!(" during {}", request.name) };
                Err(Error::input(&self.program, format!("{broken}{doing}: {last}")))
            }
        }
    }

    fn not_started(&self, error: &std::io::Error) -> Error {
        let hint = "use a Python 3 that has the packages of lab/requirements.txt";
        Error::input_with(&self.program, format!("the program cannot be started: {error}"), hint)
    }

    fn lacks(&self, packages: &str) -> Error {
        let pinned = REQUIREMENTS.lines().filter(|l| l.contains("==")).collect::<Vec<_>>().join(" ");
        let install = format!("{} -m pip install {pinned}", self.program.display());
        Error::input_with(&self.program, format!("is missing the packages {}", packages.replace(' ', ", ")), install)
    }
}

#[cfg(test)]
mod tests;
