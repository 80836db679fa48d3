//! SZ3 and ZFP by their own libraries in the user's Python: a child process runs lab/compressors.py and answers
//! requests over pipes. It ends when its input is closed, so never later than this process.

mod child;
#[cfg(test)]
mod tests;

use crate::{Baseline, CompressedParticles, PositionColumns, check_bound, morton, packed};
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
        // A child that fails is not put back, so that the next request starts a new one.
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

/// Order of the columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColumnOrder {
    File,
    /// Morton order of cubes, 2^21 along the longest edge of the box, so that neighbours in space are neighbours in the
    /// columns. It is also the order after decoding.
    Morton,
}

/// A compression library.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CompressionLibrary {
    /// SZ3 (Liang et al., IEEE Trans. Big Data 2023) with an absolute bound; each axis uses the better of two
    /// predictors: interpolation and Lorenzo (the default), or Lorenzo and regression.
    Sz3,
    /// ZFP (Lindstrom, IEEE TVCG 2014) with fixed accuracy; the tolerance is the bound.
    Zfp,
}

impl CompressionLibrary {
    fn name(self) -> &'static str {
        match self {
            CompressionLibrary::Sz3 => "SZ3",
            CompressionLibrary::Zfp => "ZFP",
        }
    }
}

pub struct LibraryBaseline {
    pub external: External,
    pub library: CompressionLibrary,
    pub order: ColumnOrder,
}

impl Baseline for LibraryBaseline {
    fn name(&self) -> &'static str {
        match (self.library, self.order) {
            (CompressionLibrary::Sz3, ColumnOrder::File) => "SZ3, file order",
            (CompressionLibrary::Sz3, ColumnOrder::Morton) => "SZ3, Morton order",
            (CompressionLibrary::Zfp, ColumnOrder::File) => "ZFP, file order",
            (CompressionLibrary::Zfp, ColumnOrder::Morton) => "ZFP, Morton order",
        }
    }

    fn source(&self) -> String {
        self.external.source(self.library.name())
    }

    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles> {
        self.external.coded(self.library.name(), particles, bound, self.order)
    }

    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns> {
        self.external.columns(self.library.name(), bytes)
    }
}

impl External {
    fn coded(
        &self,
        name: &str,
        particles: &PositionColumns,
        bound: f64,
        order: ColumnOrder,
    ) -> Result<CompressedParticles> {
        check_bound(bound)?;
        let n = particles[0].len();
        if u32::try_from(n).is_err() || particles.iter().any(|c| c.len() != n) {
            return Err(Error::argument("the three columns must have one length below 2^32"));
        }
        let order = (order == ColumnOrder::Morton).then(|| morton::order_of(&morton::codes_of_places(particles)));
        let mut data = Vec::with_capacity(12 * n);
        for column in particles {
            match &order {
                None => column.iter().for_each(|v| data.extend(v.to_le_bytes())),
                Some(order) => order.iter().for_each(|i| data.extend(column[*i as usize].to_le_bytes())),
            }
        }
        Ok(CompressedParticles { bytes: self.compress(name, bound, n, &data)?, order })
    }

    fn columns(&self, name: &str, bytes: &[u8]) -> Result<PositionColumns> {
        let data = self.decompress(name, bytes)?;
        let (values, rest) = data.as_chunks::<4>();
        let n = values.len() / 3;
        if !rest.is_empty() || values.len() != 3 * n {
            return Err(Error::input(name, "its columns differ in length"));
        }
        Ok([0, 1, 2].map(|k| values[k * n..(k + 1) * n].iter().map(|v| f32::from_le_bytes(*v)).collect()))
    }
}
