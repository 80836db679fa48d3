//! Statistics of a certificate: limits up to which P(k), r(k) and groups agree.
//!
//! The measures follow from the number of particles and the level alone, so that the same input gives the same file on
//! every machine, and take less than 500 MB beside the snapshot.

use super::match_groups::GroupFinder;
use crate::stats::{
    Assignment, Grid, Spectra, SpectrumOptions, Subject, longest_link, power_spectra, size_histogram, sizes_within,
};
use particlegs_core::context::Context;
use particlegs_core::model::{
    GROUP_CLASSES, Limit, MassPower, Model, POWER_LAYERS, PowerAgreement, SAMPLED_ABOVE, ScienceMetrics, ScienceSubject,
};
use particlegs_core::{Error, Result};
use particlegs_particles::{Domain, Particles};
use std::f64::consts::PI;

/// Particles up to which as many are drawn from the model; of larger snapshots the mixture's own spectrum is measured.
/// (4.2 million take 560 MiB, 2.1 million 304.)
pub(super) const MOST_DRAWN: u64 = SAMPLED_ABOVE;
/// Cells of the spectrum's grid along the longest edge, for as many particles along it as there are on average.
const CELLS_A_PARTICLE: f64 = 1.5;
const LEAST_CELLS: usize = 32;
const MOST_CELLS: usize = 192;
/// Cells of a grid that resolves the Gaussians, all axes together: 400 MB while particles are added up, 500 in all.
const LARGEST_GRID: usize = 1 << 25;
/// Wave numbers go to this share of the grid's Nyquist frequency. There the nearest image that interlacing leaves is
/// more than twice as far along two axes, and the window of clouds in cells takes all but 1e-4 of it.
const SHARE_OF_NYQUIST: f64 = 1.0 / CELLS_A_PARTICLE;
/// Links as everywhere (`stats`).
const LINKING: f64 = 0.2;
const GROUPS_WITHIN: f64 = 0.1;

/// Measures `model`, and particles `drawn` from it where there are any, against its snapshot, groups apart. `None` in
/// units so small or so large that float32, in which a file keeps wave numbers, does not hold them.
pub(super) fn science(
    model: &Model,
    particles: &Particles,
    drawn: Option<&Particles>,
    domain: &Domain,
    context: &Context<'_>,
) -> Result<Option<ScienceMetrics>> {
    let options = options_for(domain, particles.len(), model);
    if !file_holds(domain, &options) {
        return Ok(None);
    }
    let (subject, other) = match drawn {
        Some(drawn) => (ScienceSubject::DrawnParticles, Subject::Particles(drawn)),
        None => (ScienceSubject::Mixture, Subject::Model(model)),
    };
    let spectra = power_spectra([Subject::Particles(particles), other], domain, &options, context)?;
    Ok(Some(science_metrics(subject, &options, &spectra)))
}

/// Whether float32, in which a file keeps wave numbers, holds these.
pub(super) fn file_holds(domain: &Domain, o: &SpectrumOptions) -> bool {
    [2.0 * PI / domain.longest(), o.k_max].iter().all(|k| (*k as f32).is_normal())
}

/// The linking of groups, `spacing` being the particles' mean one; `None` where the box is thinner than links allow.
pub(super) fn linking(domain: &Domain, spacing: f64) -> Option<GroupFinder<'_>> {
    let length = LINKING * spacing;
    (length <= longest_link(domain)).then_some(GroupFinder { domain, length, spacing })
}

/// The spectrum's grid and largest wave number for `n` particles.
pub fn spectrum_options(domain: &Domain, n: usize) -> SpectrumOptions {
    let spacing = domain.spacing(n);
    let wanted_cells = (CELLS_A_PARTICLE * domain.longest() / spacing * (1.0 - 1e-9)).ceil().min(MOST_CELLS as f64);
    let cells = (wanted_cells.max(LEAST_CELLS as f64) as usize..=MOST_CELLS).find(is_smooth).unwrap_or(MOST_CELLS);
    let nyquist = PI * cells as f64 / domain.longest();
    SpectrumOptions {
        cells,
        assignment: Assignment::Cic,
        interlaced: true,
        deconvolved: true,
        shot_noise_subtracted: true,
        k_max: (PI / spacing).min(SHARE_OF_NYQUIST * nyquist),
    }
}

/// P(k) of mass, of all layers and of each, where masses are known and differ or there are several layers: of the
/// mixture itself, to which no draw adds its noise.
pub(super) fn mass_power(
    model: &Model,
    particles: &Particles,
    domain: &Domain,
    context: &Context<'_>,
) -> Result<Option<MassPower>> {
    let several = particles.layers().len() > 1;
    if particles.weights().is_none() && !(several && particles.meta.particle_mass.is_some()) {
        return Ok(None);
    }
    let options = options_for(domain, particles.len(), model);
    let agreement = |p: &Particles, m: &Model| {
        let spectra = power_spectra([Subject::Particles(p), Subject::Model(m)], domain, &options, context)?;
        Ok::<_, Error>(PowerAgreement {
            largest_deviation: spectra.largest_power_deviation(),
            within_1_percent_to: limit(&spectra, spectra.power_within(0.01)),
        })
    };
    let mut power = MassPower { whole: agreement(particles, model)?, layers: [None; POWER_LAYERS] };
    if several {
        for (place, layer) in power.layers.iter_mut().zip(&model.layers) {
            let Some(particle_layer) = particles.layers().iter().find(|l| l.name == layer.name) else { continue };
            let alone = Model { layers: vec![layer.clone()], certificate: None, metadata: model.metadata.clone() };
            *place = Some(agreement(&particles.of_layer(particle_layer), &alone)?);
        }
    }
    Ok(Some(power))
}

/// As [`spectrum_options`]; where the mixture's own spectrum is measured the grid also resolves its Gaussians, as far
/// as memory goes: k to pi over their mean spacing. A certificate that the model has says what its grid was.
fn options_for(domain: &Domain, particles: usize, model: &Model) -> SpectrumOptions {
    let usual = spectrum_options(domain, particles);
    if particles as u64 <= MOST_DRAWN {
        return usual;
    }
    let stored = model.certificate.and_then(|c| c.science).map(|s| usize::from(s.spectrum_grid));
    let cells = match stored.filter(|cells| (LEAST_CELLS..=LARGEST_GRID).contains(&Grid::new(domain, *cells).len())) {
        Some(cells) => cells,
        None => resolving(domain, [particles, model.gaussians()]).max(usual.cells),
    };
    let nyquist = PI * cells as f64 / domain.longest();
    SpectrumOptions { cells, k_max: (PI / domain.spacing(particles)).min(SHARE_OF_NYQUIST * nyquist), ..usual }
}

/// Cells along the longest edge whose wave numbers go to pi over the mean spacing of the Gaussians, no further than
/// that of the particles, and no more than [`LARGEST_GRID`].
fn resolving(domain: &Domain, [particles, gaussians]: [usize; 2]) -> usize {
    let cells = |n: usize| domain.longest() / (SHARE_OF_NYQUIST * domain.spacing(n));
    let wanted_cells =
        (cells(gaussians).min(cells(particles)) * (1.0 - 1e-9)).ceil().clamp(1.0, f64::from(u16::MAX)) as usize;
    let fits = |n: &usize| Grid::new(domain, *n).len() <= LARGEST_GRID;
    let from_above = (wanted_cells..2 * wanted_cells).filter(is_smooth).find(fits);
    from_above.or_else(|| (LEAST_CELLS..wanted_cells).rev().filter(is_smooth).find(fits)).unwrap_or(LEAST_CELLS)
}

/// Whether a number has the factors 2, 3 and 5 alone, which transforms divide well.
fn is_smooth(n: &usize) -> bool {
    [2, 3, 5].into_iter().fold(*n, |n, p| (0..16).fold(n, |n, _| if n % p == 0 { n / p } else { n })) == 1
}

/// Limits that spectra give, groups apart.
pub(super) fn science_metrics(subject: ScienceSubject, o: &SpectrumOptions, spectra: &Spectra) -> ScienceMetrics {
    ScienceMetrics {
        of: subject,
        spectrum_grid: o.cells as u16,
        k_max: spectra.shells.last().map_or(0.0, |s| s.k),
        power_within_1_percent_to: limit(spectra, spectra.power_within(0.01)),
        power_within_5_percent_to: limit(spectra, spectra.power_within(0.05)),
        r_above_0_99_to: limit(spectra, spectra.r_above(0.99)),
        r_above_0_9_to: limit(spectra, spectra.r_above(0.9)),
        groups_within_10_percent_from: Limit::NotMeasured,
    }
}

/// The limit at `place`, where `spectra` have any shell.
fn limit(spectra: &Spectra, place: Option<f64>) -> Limit {
    if spectra.shells.is_empty() { Limit::NotMeasured } else { Limit::measured(place) }
}

/// The size from which on numbers of groups agree; not measured where there are too few.
pub(super) fn numbers_agree_from(truth: &[u64], drawn: &[u64]) -> Limit {
    let histogram = size_histogram([truth, drawn], GROUP_CLASSES[0]);
    match sizes_within(&histogram, GROUPS_WITHIN) {
        None => Limit::NotMeasured,
        Some(size) => Limit::measured(size.map(|n| n as f64)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_grids_resolve_the_gaussians_and_stay_in_memory() {
        let slab = Domain::upright([0.0; 3], [100.0, 400.0, 400.0], [true; 3]);
        let cube = Domain { length: [400.0; 3], ..slab };
        // 2.7 million Gaussians of 268 million particles: pi over a spacing of 1.81 wants 332 cells.
        assert_eq!(resolving(&slab, [1 << 28, 2_700_000]), 360);
        assert_eq!(resolving(&cube, [1 << 33, 1 << 24]), 320);
        assert_eq!(resolving(&cube, [1 << 24, 1 << 26]), 320);
        assert!(resolving(&cube, [1 << 24, 1]) < 16);
    }

    #[test]
    fn grids_follow_from_counts_and_stay_small() {
        let cube = Domain::upright([0.0; 3], [50.0; 3], [true; 3]);
        let options_of = |domain: &Domain, n: usize| {
            let o = spectrum_options(domain, n);
            (o.cells, o.k_max)
        };
        let (cells, k) = options_of(&cube, 128 * 128 * 128);
        assert!(cells == 192 && (k - PI * 128.0 / 50.0).abs() < 1e-9, "{cells} {k}");
        assert_eq!(options_of(&cube, 64 * 64 * 64).0, 96);
        assert_eq!(options_of(&cube, 2).0, LEAST_CELLS);
        // More particles than the grid resolves: two thirds of its Nyquist frequency.
        let (cells, k) = options_of(&cube, usize::MAX);
        assert!(cells == 192 && (k - PI * 128.0 / 50.0).abs() < 1e-9, "{cells} {k}");
        let needle = Domain::upright([0.0; 3], [1e6, 1.0, 1.0], [false; 3]);
        assert_eq!(options_of(&needle, 1000).0, 192);
    }
}
