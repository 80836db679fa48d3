//! The Gaussians as the file will give them: training that knows the coder's quantisation.
//!
//! Every so many steps the Gaussians are coded and decoded. Steps are then taken from the decoded
//! ones, and move both alike: a gradient that goes straight through the rounding (Bengio et al. 2013,
//! straight-through estimator). So Gaussians learn to make up for each other's rounding.
//!
//! That lasts only as long as the rounding does. The coder's trellis rounds anew whatever lies after
//! a number that changed, and another precision is another lattice. So towards the end the run
//! settles: the precision stays, and what is coded is drawn to what was decoded before, which codes
//! to the same bytes again. A number then changes where the pictures insist, and the file that comes
//! out is the one that was trained.

use super::columns::DepthGaussians;
use particlegs_core::Result;
use particlegs_core::codec::{Encoder, Precision, decode_block};
use particlegs_core::model::{Block, Mixture};
use particlegs_core::space::Bounds;

/// Shares of the budget that settled Gaussians may take, and the one that a new precision aims at.
const FILLED: std::ops::RangeInclusive<f64> = 0.98..=1.0;
const AIM: f64 = 0.999;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Budget {
    pub bounds: Bounds,
    pub count: u64,
    pub bytes: u64,
}

/// Decoded Gaussians and the precision that they were coded at.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DecodedGaussians {
    pub exact: DepthGaussians,
    /// Multiple of the nominal steps.
    pub factor: f64,
    /// Bytes over the budget.
    pub filled: f64,
}

impl DecodedGaussians {
    /// Codes and decodes `gaussians` at `factor` times the nominal steps.
    pub fn new(gaussians: Mixture, budget: &Budget, factor: f64) -> Result<DecodedGaussians> {
        let m = gaussians.len();
        let mass = gaussians.masses().map_or(budget.count as f64, |m| m.iter().sum());
        let encoder = Encoder::new(&Block { bounds: budget.bounds, count: budget.count, mass, gaussians })?;
        let bytes = encoder.encode(&Precision::BALANCED.scaled(factor));
        let decoded = decode_block(&bytes, "the Gaussians in training")?.gaussians;
        let mut rank = vec![0u32; m];
        for (k, &i) in encoder.order().iter().enumerate() {
            rank[i as usize] = k as u32;
        }
        let exact = DepthGaussians::from_mixture(&decoded, |i| rank[i] as usize);
        Ok(DecodedGaussians { exact, factor, filled: bytes.len() as f64 / budget.bytes as f64 })
    }

    /// Whether the file fits, and nearly fills its budget.
    pub fn fits(&self) -> bool {
        FILLED.contains(&self.filled)
    }

    /// The factor that leads to the budget, for Gaussians like these.
    pub fn better_factor(&self, budget: &Budget) -> f64 {
        let excess = (self.filled - AIM) * budget.bytes as f64;
        let doublings = Precision::doublings(excess, self.exact.0.len()).clamp(-1.0, 1.0);
        let [finest, coarsest] = Precision::FACTORS;
        (self.factor * doublings.exp2()).clamp(finest, coarsest)
    }
}
