//! The two subjects that are compared, in one box, and the options.

use super::points::local_positions;
use super::{Convention, Domain, Measure, StatsOptions, Subject};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_particles::Particles;

pub(super) struct ComparisonJob<'a> {
    pub pair: [Subject<'a>; 2],
    pub domain: Domain,
    pub o: &'a StatsOptions,
    pub context: &'a Context<'a>,
}

impl ComparisonJob<'_> {
    pub fn paper(&self) -> bool {
        self.o.convention == Convention::Paper
    }

    /// Mean spacing of one side.
    pub fn spacing(&self, side: usize) -> f64 {
        self.domain.spacing(self.pair[side].count() as usize)
    }

    /// Particles of the larger side; 0 of a model.
    pub fn most_particles(&self) -> u64 {
        self.pair.iter().filter_map(|s| s.particles()).map(|p| p.len() as u64).max().unwrap_or(0)
    }

    pub fn notes(&self) -> Vec<String> {
        let mut notes = vec![];
        if self.wants(&[Measure::Spectrum, Measure::Momentum]) && self.domain.periodic.contains(&false) && !self.paper()
        {
            notes.push("some axes are not periodic, but P(k) treats them as periodic".into());
        }
        let bounds = self.pair[0].bounds();
        for k in (0..3).filter(|k| bounds.extent()[*k] == 0.0 && bounds.extent() != [0.0; 3]) {
            let (axis, length) = (["x", "y", "z"][k], self.domain.length[k]);
            notes.push(format!(
                "all particles have the same {axis}: volumes, spacing and g(r) assume a box {length:.4e} thick there"
            ));
        }
        if self.wants(&[Measure::Density, Measure::Profile]) && self.domain.tilt.is_some() {
            notes.push("the box is tilted: cells, slices and profiles follow the edges of its reduced cell".into());
        }
        if self.pair.iter().any(|s| s.particles().is_some_and(|p| p.weights().is_some())) {
            notes.push("pairs, groups, neighbours and g(r) count particles and ignore their weights".into());
        }
        let gridded = self.wants(&[Measure::Density, Measure::Spectrum]);
        if gridded && self.pair.iter().any(|s| s.particles().is_none()) {
            notes.push(
                "the model's density is its mixture, integrated over the cells (NGP window, no shot noise)".into(),
            );
        }
        let alpha = |s: &Subject<'_>| matches!(s, Subject::Model(m) if m.metadata.law == LawKind::AlphaBlend);
        if self.pair.iter().any(alpha) {
            notes.push(
                "the density of an alpha-blend model follows its opacities, which were fitted to pictures".into(),
            );
        }
        if self.paper() {
            notes.push(
                "the published convention uses NGP on a grid stretched over the bounds, one box length for k, no \
                 correction for shot noise or window, and neighbours in a random subset"
                    .into(),
            );
        }
        notes
    }

    /// The particles, where both sides are some.
    pub fn both_particles(&self) -> Option<[&Particles; 2]> {
        let [truth, other] = self.pair.map(|s| s.particles());
        Some([truth?, other?])
    }

    pub fn wants(&self, measures: &[Measure]) -> bool {
        measures.iter().any(|m| self.o.measures.contains(m))
    }

    /// Positions of either side, where it has any and something is measured of them.
    pub fn positions(&self) -> Result<[Vec<[f64; 3]>; 2]> {
        let of_pairs = self.both_particles().is_some() && self.wants(&[Measure::Pairs, Measure::Groups, Measure::Rdf]);
        let needed = of_pairs || self.wants(&[Measure::Haloes, Measure::Dispersion]);
        let particles = self.pair.map(|s| s.particles().filter(|_| needed));
        let bytes = particles.iter().flatten().map(|p| 24 * p.len() as u64).sum();
        particlegs_files::memory::require("positions", bytes)?;
        Ok(particles.map(|p| p.map_or(Vec::new(), |p| local_positions(p, &self.domain))))
    }
}
