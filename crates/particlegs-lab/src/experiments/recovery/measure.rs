//! Measures models, and particles drawn from them, against the truth.

use super::facts::Facts;
use crate::experiments::published::recovery as paper;
use crate::lab::{Lab, ModelSettings};
use crate::snapshot::Snapshot;
use particlegs_core::Result;
use particlegs_core::model::Model;
use particlegs_fit::recover::Method;
use particlegs_measure::stats::{Convention, Measure, StatsOptions, Subject, compare};
use particlegs_particles::Particles;

/// Recovery methods: the library's own, then the published ones.
pub(super) const METHODS: [Method; 6] =
    [Method::Count, Method::Stratified, Method::Spaced, Method::Volume, Method::Ellipsoid, Method::Grid];

/// The measurements on a set of particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MeasurementScope {
    /// Density, spectra, xi, groups, neighbours.
    All,
    Local,
    /// Density and neighbours in the paper's convention.
    Paper,
}

impl MeasurementScope {
    /// Options of the statistics for this number of particles.
    pub fn options(self, particles: usize, quick: bool) -> StatsOptions {
        let a_side = (particles as f64).cbrt();
        let (pair_budget, neighbour_sample) = if quick { (20_000_000, 50_000) } else { (100_000_000, 200_000) };
        let common = StatsOptions {
            cells: Some(cells(particles)),
            // Twice as many cells as particles along an edge: the particles' Nyquist frequency is half the grid's.
            spectrum_cells: ((2.0 * a_side).round() as usize).clamp(16, 512),
            pair_budget,
            neighbour_sample,
            ..StatsOptions::default()
        };
        match self {
            MeasurementScope::All => StatsOptions {
                measures: vec![
                    Measure::Density,
                    Measure::Spectrum,
                    Measure::Pairs,
                    Measure::Groups,
                    Measure::Neighbours,
                ],
                ..common
            },
            MeasurementScope::Local => {
                StatsOptions { measures: vec![Measure::Density, Measure::Groups, Measure::Neighbours], ..common }
            }
            MeasurementScope::Paper => StatsOptions {
                measures: vec![Measure::Density, Measure::Neighbours],
                convention: Convention::Paper,
                // As published; all particles if there are fewer.
                neighbour_sample: 500_000,
                ..common
            },
        }
    }
}

/// Cells along an edge, for as many particles per cell as in the paper.
pub(super) fn cells(particles: usize) -> usize {
    ((particles as f64 / paper::PARTICLES_A_CELL).cbrt().round() as usize).max(4)
}

pub(super) struct RecoverySource<'a> {
    pub lab: &'a Lab<'a>,
    pub snapshot: &'a Snapshot,
    pub recipe: ModelSettings,
}

impl RecoverySource<'_> {
    /// Statistics of particles drawn from the model, cached.
    pub fn facts(&self, method: Method, seed: u64, depth: MeasurementScope) -> Result<Facts> {
        let (lab, truth) = (self.lab, &self.snapshot.particles);
        let options = depth.options(truth.len(), lab.settings.quick);
        let inputs = (&self.snapshot.hash, &self.recipe, method.name(), seed, &options);
        lab.store.result("recovered", &inputs, || {
            let drawn = self.particles(method, seed)?;
            let compared = compare(Subject::Particles(truth), Subject::Particles(&drawn), &options, lab.context)?;
            Ok(Facts::from_statistics(&compared))
        })
    }

    /// The same for every seed.
    pub fn facts_of_seeds(&self, method: Method, depth: MeasurementScope) -> Result<Vec<Facts>> {
        self.lab.settings.seeds().map(|seed| self.facts(method, seed, depth)).collect()
    }

    /// Density and spectra of the model itself, its mixture integrated over cells.
    pub fn facts_of_model(&self) -> Result<Facts> {
        let (lab, truth) = (self.lab, &self.snapshot.particles);
        let options = StatsOptions {
            measures: vec![Measure::Density, Measure::Spectrum],
            ..MeasurementScope::All.options(truth.len(), lab.settings.quick)
        };
        lab.store.result("of-model", &(&self.snapshot.hash, &self.recipe, &options), || {
            let model = self.model()?.0;
            let compared = compare(Subject::Particles(truth), Subject::Model(&model), &options, lab.context)?;
            Ok(Facts::from_statistics(&compared))
        })
    }

    /// The decoded model and its file.
    pub fn model(&self) -> Result<(Model, Vec<u8>)> {
        let build = self.lab.model(self.snapshot, &self.recipe)?;
        Ok((build.model, build.bytes))
    }

    /// As many particles as the snapshot has, as `particlegs recover` writes them.
    pub fn particles(&self, method: Method, seed: u64) -> Result<Particles> {
        self.lab.drawn(self.model()?.0, method, seed)
    }

    /// Number of Gaussians, file size and ratio.
    pub fn size(&self) -> Result<(u64, u64, f64)> {
        let inputs = (&self.snapshot.hash, &self.recipe);
        let [gaussians, bytes] = self.lab.store.result("model-size", &inputs, || {
            let (model, bytes) = self.model()?;
            Ok([model.gaussians() as u64, bytes.len() as u64])
        })?;
        Ok((gaussians, bytes, self.snapshot.position_bytes() as f64 / bytes as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_as_many_particles_as_in_the_paper() {
        assert_eq!((cells(128 * 128 * 128), cells(64 * 64 * 64), cells(281_000_000), cells(10)), (50, 25, 256, 4));
        let o = MeasurementScope::All.options(64 * 64 * 64, true);
        assert_eq!((o.spectrum_cells, o.cells), (128, Some(25)));
        assert_eq!(MeasurementScope::Paper.options(1000, false).convention, Convention::Paper);
    }
}
