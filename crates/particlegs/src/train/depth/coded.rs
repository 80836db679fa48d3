//! The Gaussians as the file will give them: training that knows the coder's quantisation.
//!
//! Every so many steps the Gaussians are coded and decoded. Steps are then taken from the decoded
//! ones, and move both alike: a gradient that goes straight through the rounding (Bengio et al. 2013,
//! straight-through estimator). So Gaussians learn to make up for each other's rounding.

use super::columns::Columns;
use crate::Result;
use crate::codec::{Encoder, Precision, decode_block};
use crate::model::Block;
use crate::particles::Bounds;

/// Parameters of a Gaussian: each doubling of all steps saves about a bit for each.
const PARAMETERS: f64 = 10.0;
/// Step factors are kept within this.
const FACTORS: [f64; 2] = [1.0 / 64.0, 32.0];

/// Decoded Gaussians and the precision that they were coded at.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Coded {
    /// As decoded, moved since like the others.
    pub columns: Columns,
    /// Multiple of the nominal steps.
    pub factor: f64,
}

/// Codes and decodes at `factor` times the nominal steps; the factor for the next time leads to
/// `bytes`.
pub(super) fn code(columns: &Columns, bounds: Bounds, count: u64, factor: f64, bytes: u64) -> Result<Coded> {
    let gaussians = columns.mixture();
    let m = gaussians.len();
    let encoder = Encoder::new(&Block { bounds, count, mass: count as f64, gaussians })?;
    let coded = encoder.encode(&Precision::BALANCED.scaled(factor));
    let decoded = decode_block(&coded, "the Gaussians in training")?.gaussians;
    let mut place = vec![0u32; m];
    for (k, &i) in encoder.order().iter().enumerate() {
        place[i as usize] = k as u32;
    }
    let octaves = 8.0 * (coded.len() as f64 - bytes as f64) / (PARAMETERS * m as f64);
    let factor = (factor * octaves.clamp(-1.0, 1.0).exp2()).clamp(FACTORS[0], FACTORS[1]);
    Ok(Coded { columns: Columns::of(&decoded, |i| place[i] as usize), factor })
}
