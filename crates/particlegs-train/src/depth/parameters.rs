//! The Gaussians of the optical-depth law in training: what steps move, and what they hold to.

use super::columns::DepthGaussians;
use super::groups::GaussianGroups;
use crate::adam::Averages;
use particlegs_core::model::Mixture;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;

/// Groups of numbers that have a rate each, and their numbers a Gaussian: place, shape, count.
pub const WIDTHS: [usize; 3] = [3, 6, 1];

#[derive(Clone, Debug)]
pub struct Parameters {
    /// Bounds of the particles, world units.
    pub bounds: Bounds,
    pub look: ToneStyle,
    pub now: DepthGaussians,
    /// Their running average, which is scored and kept.
    pub averaged: DepthGaussians,
    /// The same as decoded and moved since, where they are coded on the way: pictures are drawn of these.
    pub decoded: Option<DepthGaussians>,
    /// Neighbours whose counts keep their sum.
    pub groups: GaussianGroups,
    /// ln count at the start.
    pub first_log_count: Vec<f64>,
    /// Adam's averages of each group's numbers, Gaussian by Gaussian.
    pub averages: [Averages; 3],
}

impl Parameters {
    /// Those of a mixture of `particles`, whose counts are kept among so many neighbours (0 = all).
    pub fn new(mixture: &Mixture, particles: u64, kept_among: u64, bounds: Bounds, look: ToneStyle) -> Parameters {
        let now = DepthGaussians::from_mixture(mixture, |i| i);
        Parameters {
            bounds,
            look,
            averaged: now.clone(),
            decoded: None,
            groups: GaussianGroups::new(&now.0, particles, kept_among),
            first_log_count: now.0.iter().map(|n| n[9]).collect(),
            averages: WIDTHS.map(|k| Averages::zeros(k * now.0.len())),
            now,
        }
    }

    pub fn len(&self) -> usize {
        self.now.0.len()
    }

    pub fn is_empty(&self) -> bool {
        self.now.0.is_empty()
    }

    /// The Gaussians that pictures are drawn of.
    pub fn seen(&self) -> &DepthGaussians {
        self.decoded.as_ref().unwrap_or(&self.now)
    }
}
