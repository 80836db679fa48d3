//! The laboratory: other compressors, and the experiments that compare models with them.
//!
//! A [`Baseline`] is a compressor with an absolute error bound on every coordinate: [`lcp`] follows its paper,
//! [`quantised`] combines bins with pco, and [`external`] runs the libraries SZ3 and ZFP in the user's Python. [`rate`]
//! finds the bound for a file size, runs a baseline and verifies its bound. [`jitter`] moves particles that decode at
//! bin centres. [`subset`] has no bound: it keeps a random subset of the particles and draws it larger.
//!
//! [`experiments`] compare each [`method`] by its pictures ([`views`]) and its [`density`]. They return tables, plots
//! and pictures as data ([`results`]), which [`report`] writes to files. A [`lab::Lab`] caches results by the hash of
//! their inputs. An [`Accelerator`](particlegs_train::Accelerator) draws and trains, or the CPU if the
//! settings name none.
//!
//! A baseline is a file that implements [`Baseline`] (a library in Python: a class in `lab/compressors.py`, with its
//! pin and licence beside it); an experiment is a file with `EXPERIMENT` and its entry in `experiments/mod.rs`; a data
//! set is a generator in `lab/datasets`.

#![allow(missing_docs)]

pub mod bench;
mod bins;
pub mod density;
pub mod experiments;
pub mod external;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod jitter;
pub mod lab;
pub mod lcp;
pub mod method;
mod morton;
mod packed;
pub mod quantised;
pub mod rate;
pub mod report;
pub mod results;
pub mod settings;
pub mod snapshot;
pub mod store;
pub mod subset;
mod training;
pub mod views;

use external::External;
use particlegs_core::{Error, Result};

/// Positions in columns x, y and z.
pub type PositionColumns = [Vec<f32>; 3];

pub struct CompressedParticles {
    pub bytes: Vec<u8>,
    /// Input index of each decoded particle; `None` = the input order.
    pub order: Option<Vec<u32>>,
}

/// A compressor with an absolute bound on every coordinate.
pub trait Baseline: Sync {
    /// Name in tables.
    fn name(&self) -> &'static str;
    /// Paper or library, and version.
    fn source(&self) -> String;
    /// Compresses particles so that no decoded coordinate is off by more than `bound`.
    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles>;
    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns>;
}

/// The built-in baselines, and those of `external` if it is given.
pub fn baselines(external: Option<&External>) -> Vec<Box<dyn Baseline>> {
    let mut all: Vec<Box<dyn Baseline>> = vec![Box::new(lcp::Lcp), Box::new(quantised::QuantisedCoder)];
    all.extend(external.into_iter().flat_map(External::baselines));
    all
}

/// The largest error of any decoded coordinate; infinite if one is NaN. All columns and the order have the same length.
pub fn largest_error(particles: &PositionColumns, decoded: &PositionColumns, order: Option<&[u32]>) -> f64 {
    errors(particles, decoded, order).map(|e| e.1).fold(0.0, f64::max)
}

/// Each coordinate with its error after decoding.
fn errors<'a>(
    particles: &'a PositionColumns,
    decoded: &'a PositionColumns,
    order: Option<&'a [u32]>,
) -> impl Iterator<Item = (f32, f64)> + 'a {
    let column_errors = move |k: usize| {
        decoded[k].iter().enumerate().map(move |(i, v)| {
            let original = particles[k][order.map_or(i, |o| o[i] as usize)];
            let error = (f64::from(*v) - f64::from(original)).abs();
            // Exactly kept values have no error, even if they are infinite or NaN.
            let same = *v == original || v.is_nan() && original.is_nan();
            let error = if error.is_nan() { f64::INFINITY } else { error };
            (original, if same { 0.0 } else { error })
        })
    };
    (0..3).flat_map(column_errors)
}

/// The smallest and the largest finite number of a column.
fn finite_ends(column: &[f32]) -> [f64; 2] {
    let finite = column.iter().map(|v| f64::from(*v)).filter(|v| v.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |e, v| [e[0].min(v), e[1].max(v)])
}

fn check_bound(bound: f64) -> Result<()> {
    match bound > 0.0 && bound.is_finite() {
        true => Ok(()),
        false => Err(Error::argument(format!("the bound must be positive and finite, not {bound}"))),
    }
}

#[cfg(test)]
mod testing;
