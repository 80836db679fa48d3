//! Measures of the density that a method keeps, which pictures alone do not show.

use crate::lab::Lab;
use crate::method::{CompressionMethod, FileContent};
use crate::snapshot::Snapshot;
use particlegs_core::{Error, Result};
use particlegs_fit::recover;
use particlegs_measure::stats::{Likelihood, Measure, Statistics, StatsOptions, Subject, compare};
use particlegs_particles::{Domain, Particles};
use serde::{Deserialize, Serialize};

/// Measures of one method at one file size; `None` = not available.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct DensityMeasures {
    /// Likelihood of held-out particles, in bits per particle above a uniform density. Models use their own density;
    /// particles use an adaptive kernel on the other half, kept in as many bytes.
    pub held_out_bits: Option<f64>,
    /// Correlation of counts in cells.
    pub correlation: Option<f64>,
    /// Mean |P(k) ratio - 1| over shells up to a quarter of the largest wave number.
    pub large_scales: Option<f64>,
    /// Largest |P(k) ratio - 1| of any shell.
    pub power: Option<f64>,
    /// r(k) is at least 0.99 up to this share of the largest wave number.
    pub correlated_to: Option<f64>,
    /// Number of groups of 100 particles or more, other / truth.
    pub groups: Option<f64>,
    /// Mass within cores, other / truth.
    pub cores: Option<f64>,
}

/// Mean particles per cell of the density grid.
const A_CELL: f64 = 16.0;

impl DensityMeasures {
    pub fn new(lab: &Lab<'_>, snapshot: &Snapshot, method: CompressionMethod, bytes: u64) -> Result<DensityMeasures> {
        let seed = lab.settings.seed;
        let inputs = (method.source(lab), &snapshot.hash, bytes, seed, lab.settings.quick);
        match lab.store.result("density", &inputs, || measured(lab, snapshot, method, bytes)) {
            // A failed method has no measures. Its error is reported with its pictures and not cached.
            Err(Error::Input { .. } | Error::Argument { .. } | Error::Unreachable { .. }) => {
                lab.context.check()?;
                Ok(DensityMeasures::default())
            }
            other => other,
        }
    }
}

fn measured(lab: &Lab<'_>, snapshot: &Snapshot, method: CompressionMethod, bytes: u64) -> Result<DensityMeasures> {
    let seed = lab.settings.seed;
    let output = method.keep(lab, &snapshot.particles, &snapshot.hash, bytes, seed)?;
    let statistics = match output.content {
        FileContent::Particles(particles, _) => statistics(lab, &snapshot.particles, &particles)?,
        FileContent::Model(model) => {
            statistics(lab, &snapshot.particles, &lab.drawn(*model, recover::Method::Count, seed)?)?
        }
    };
    let s = &statistics.summary;
    let k_max = statistics.spectra.as_ref().and_then(|s| s.shells.last()).map(|s| s.k);
    Ok(DensityMeasures {
        held_out_bits: held_out(lab, snapshot, method, bytes)?,
        correlation: s.density_correlation,
        large_scales: large_scales(&statistics),
        power: s.largest_power_deviation,
        correlated_to: k_max.map(|k| s.r_above_0_99_to.unwrap_or(0.0) / k),
        groups: groups(&statistics),
        cores: s.core_mass,
    })
}

fn statistics(lab: &Lab<'_>, truth: &Particles, other: &Particles) -> Result<Statistics> {
    let cells = (truth.len() as f64 / A_CELL).cbrt().round().max(2.0) as usize;
    let options = StatsOptions {
        measures: vec![Measure::Density, Measure::Spectrum, Measure::Groups],
        cells: Some(cells),
        spectrum_cells: if lab.settings.quick { 64 } else { 256 },
        seed: lab.settings.seed,
        ..StatsOptions::default()
    };
    compare(Subject::Particles(truth), Subject::Particles(other), &options, lab.context)
}

fn large_scales(s: &Statistics) -> Option<f64> {
    let shells = &s.spectra.as_ref()?.shells;
    let most = 0.25 * shells.last()?.k;
    let off: Vec<f64> = shells.iter().filter(|s| s.k <= most).filter_map(|s| Some((s.ratio? - 1.0).abs())).collect();
    (!off.is_empty()).then(|| off.iter().sum::<f64>() / off.len() as f64)
}

/// All groups of 100 particles or more.
fn groups(s: &Statistics) -> Option<f64> {
    s.groups.as_ref()?.classes.iter().find(|c| c.from == 100)?.ratio
}

/// Bits per held-out particle; `None` for fewer than 64 particles.
fn held_out(lab: &Lab<'_>, snapshot: &Snapshot, method: CompressionMethod, bytes: u64) -> Result<Option<f64>> {
    if snapshot.particles.len() < 64 {
        return Ok(None);
    }
    let seed = lab.settings.seed;
    let [fitted, left_out] = snapshot.halves(seed, lab.context)?;
    // The half is another set of particles, so its files must not be taken for those of the whole.
    let hash = format!("{} half {seed}", snapshot.hash);
    let domain = Domain::from_particles(&snapshot.particles);
    match method.keep(lab, &fitted, &hash, bytes, seed)?.content {
        FileContent::Particles(p, _) => Likelihood::kernel_bits(&p, &left_out, &domain, seed, lab.context).map(Some),
        FileContent::Model(model) => {
            let options = StatsOptions { measures: vec![Measure::Likelihood], seed, ..StatsOptions::default() };
            let s = compare(Subject::Particles(&left_out), Subject::Model(&model), &options, lab.context)?;
            Ok(s.likelihood.map(|l| l.bits))
        }
    }
}

/// Held-out bits of a kernel on all particles of the other half: the upper limit for this number of particles.
pub fn all_particles_bits(lab: &Lab<'_>, snapshot: &Snapshot) -> Result<f64> {
    let seed = lab.settings.seed;
    lab.store.result("kernel-bits", &(&snapshot.hash, seed), || {
        let [fitted, left_out] = snapshot.halves(seed, lab.context)?;
        Likelihood::kernel_bits(&fitted, &left_out, &Domain::from_particles(&snapshot.particles), seed, lab.context)
    })
}
