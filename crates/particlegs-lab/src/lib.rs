//! What models are measured against, and the experiments that do it.
//!
//! [`Baseline`] is a compressor with an absolute bound on every coordinate: [`lcp`] written from its paper, [`quantised`]
//! bins and pco, [`external`] SZ3 and ZFP by their own libraries in a Python that the user names. [`rate`] finds the
//! bound of a size, and runs a baseline with its bound verified. [`jitter`] is for those that decode at bin centres;
//! [`subset`] is what needs no bound, a random subset drawn larger.
//!
//! [`experiments`] measure models beside them, each [`method`] by the pictures ([`views`]) and the [`density`] that it
//! gives back: they find tables, plots and pictures as data ([`results`]), which [`report`] puts into files. A [`lab::Lab`]
//! keeps results by the hash of what they were made from. Pictures are drawn, and steps taken, by a
//! [`Accelerator`](particlegs_pipeline::train::Accelerator), or the CPU where the settings name none.

#![allow(missing_docs)]

mod bins;
pub mod density;
pub mod experiments;
pub mod external;
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
use particlegs_pipeline::{Error, Result};

/// Positions in columns x, y and z.
pub type PositionColumns = [Vec<f32>; 3];

pub struct CompressedParticles {
    /// All that a decoder needs.
    pub bytes: Vec<u8>,
    /// Which particle comes where in what is decoded; `None` = in their own order.
    pub order: Option<Vec<u32>>,
}

/// A compressor with an absolute bound on every coordinate.
pub trait Baseline: Sync {
    /// What tables call it.
    fn name(&self) -> &'static str;
    /// Where it is from: paper or library, and version.
    fn source(&self) -> String;
    /// Compresses particles so that no decoded coordinate is off by more than `bound`.
    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles>;
    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns>;
}

/// All baselines: those that need nothing else, and those of `external`, where there is one.
pub fn baselines(external: Option<&External>) -> Vec<Box<dyn Baseline>> {
    let mut all: Vec<Box<dyn Baseline>> = vec![Box::new(lcp::Lcp), Box::new(quantised::QuantisedCoder)];
    all.extend(external.into_iter().flat_map(External::baselines));
    all
}

/// The largest error of any decoded coordinate, infinite where one is not a number: what a bound is held to, on every
/// run. Columns of equal lengths, with an order of as many particles.
pub fn largest_error(particles: &PositionColumns, decoded: &PositionColumns, order: Option<&[u32]>) -> f64 {
    errors(particles, decoded, order).map(|e| e.1).fold(0.0, f64::max)
}

/// Each coordinate with the error that it is decoded with.
fn errors<'a>(
    particles: &'a PositionColumns,
    decoded: &'a PositionColumns,
    order: Option<&'a [u32]>,
) -> impl Iterator<Item = (f32, f64)> + 'a {
    let of = move |k: usize| {
        decoded[k].iter().enumerate().map(move |(i, v)| {
            let own = particles[k][order.map_or(i, |o| o[i] as usize)];
            let error = (f64::from(*v) - f64::from(own)).abs();
            // What is kept exactly has no error, be it infinite or no number.
            let same = *v == own || v.is_nan() && own.is_nan();
            let error = if error.is_nan() { f64::INFINITY } else { error };
            (own, if same { 0.0 } else { error })
        })
    };
    (0..3).flat_map(of)
}

/// The smallest and the largest finite number of a column.
fn finite_ends(column: &[f32]) -> [f64; 2] {
    let finite = column.iter().map(|v| f64::from(*v)).filter(|v| v.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |e, v| [e[0].min(v), e[1].max(v)])
}

/// Refuses a bound that is none.
fn check_bound(bound: f64) -> Result<()> {
    match bound > 0.0 && bound.is_finite() {
        true => Ok(()),
        false => Err(Error::argument(format!("the bound must be positive and finite, not {bound}"))),
    }
}

#[cfg(test)]
mod testing;
