//! What models are measured against, and the experiments that do it.
//!
//! [`Baseline`] is a compressor with an absolute bound on every coordinate; [`lcp`] is written from its paper.
//! [`experiments`] measure models beside them: each gives [`found::Found`], tables, plots and pictures as data, which
//! [`report`] puts into files. A [`lab::Lab`] keeps results by the hash of what they were made from.

pub mod experiments;
pub mod found;
pub mod lab;
pub mod lcp;
pub mod plot;
pub mod report;
pub mod store;
pub mod views;

use particlegs::Result;

/// Positions in columns x, y and z.
pub type Columns = [Vec<f32>; 3];

/// What a compressor made of particles.
pub struct Coded {
    /// All that a decoder needs.
    pub bytes: Vec<u8>,
    /// Which particle comes where in what is decoded; `None` = in their own order.
    pub order: Option<Vec<u32>>,
}

/// A compressor with an absolute bound on every coordinate.
pub trait Baseline: Sync {
    /// What tables call it.
    fn name(&self) -> &'static str;
    /// Compresses particles so that no decoded coordinate is off by more than `bound`.
    ///
    /// # Errors
    /// [`particlegs::Error::Argument`] for a bound that is not positive and finite.
    fn compress(&self, particles: &Columns, bound: f64) -> Result<Coded>;
    /// The particles.
    ///
    /// # Errors
    /// [`particlegs::Error::Input`] for bytes that it did not make.
    fn decompress(&self, bytes: &[u8]) -> Result<Columns>;
}

/// The largest error of any decoded coordinate: what a bound is held to, on every run.
pub fn largest_error(particles: &Columns, decoded: &Columns, order: Option<&[u32]>) -> f64 {
    let of = |k: usize| {
        decoded[k].iter().enumerate().map(move |(i, v)| {
            let own = particles[k][order.map_or(i, |o| o[i] as usize)];
            (f64::from(*v) - f64::from(own)).abs()
        })
    };
    (0..3).flat_map(of).fold(0.0, f64::max)
}
