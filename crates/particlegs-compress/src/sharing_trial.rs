//! Whether species are described better by Gaussians that they share: a trial on part of the particles.

use super::{Options, SharingPolicy, Target, compress};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::codec::StoredBlock;
use particlegs_core::context::Context;
use particlegs_core::model::{BANDS, CertificateLevel, Effort, Model};
use particlegs_core::{Result, codec};
use particlegs_measure::score::{particles_of_region, spectrum_options};
use particlegs_measure::stats::{Shell, Subject, likelihood, power_spectra};
use particlegs_particles::{Domain, Particles, Selection, Storage};
use std::collections::BTreeMap;

/// Particles of a region that is fitted, at most, and numbers that choose regions.
const PARTICLES: u64 = 1 << 17;
const REGIONS: [u64; 2] = [0b01_0110_1001, 0b10_1001_0110];
/// Particles of which a trial says nothing.
const FEWEST: usize = 4000;
/// Power spectra may be off by so much more, of any species, on average over bands.
const POWER: f64 = 0.03;
/// Wave numbers up to which spectra are compared, over those that half the particles resolve: halves have no shot noise
/// in common.
const BEYOND: f64 = 1.5;
/// Bytes of a section of shares before its stream.
const SECTION_HEAD: f64 = 66.0;

/// The change by sharing for the species that it serves least, at as many bytes: fast fits to half the particles of up
/// to two regions, with and without, scored on the other half.
#[derive(Clone, Copy, Debug)]
pub(super) struct SharingTrial {
    /// Bits gained, a particle that the fit has not seen.
    gain: f64,
    /// Increase of the deviation of its power, on average over bands.
    power: f64,
    /// The part of the bytes that Gaussians take without the shares.
    pub gaussians: f64,
}

/// The change by sharing for a species, added up over regions.
#[derive(Clone, Copy, Default)]
struct SpeciesChange {
    bits: f64,
    particles: f64,
    power: f64,
    regions: f64,
}

/// Half the particles of a region, and the other half.
struct RegionHalves {
    fitted: Particles,
    others: Particles,
    domain: Domain,
    seed: u64,
}

impl SharingTrial {
    /// For a model of so many `gaussians` of particles of such a `radius`. `None` where too few particles are together
    /// to tell.
    pub fn new(
        particles: &Particles,
        (gaussians, radius): (f64, f64),
        context: &Context<'_>,
    ) -> Result<Option<SharingTrial>> {
        // Progress and messages of trial fits would be taken for those of the model.
        let context = &context.with_sink(Context::SILENT.sink());
        let (mut changes, mut bytes_of_all) = (BTreeMap::<String, SpeciesChange>::new(), [0.0; 2]);
        for seed in REGIONS {
            let Some(region) = RegionHalves::new(particles, seed, context)? else { continue };
            let number = gaussians * region.fitted.len() as f64 / particles.len() as f64;
            let (separate, bytes) = region.fit(SharingPolicy::No, number, radius, context)?;
            let (mut shared, with_shares) = region.fit(SharingPolicy::Yes, number, radius, context)?;
            bytes_of_all = [bytes_of_all[0] + bytes, bytes_of_all[1] + with_shares];
            // Shares take bytes, so the second model is made again for both to take as many.
            let scale = bytes / with_shares;
            if (scale - 1.0).abs() > 0.01 {
                shared = region.fit(SharingPolicy::Yes, number * scale, radius, context)?.0;
            }
            for layer in region.others.layers() {
                let change = changes.entry(layer.name.clone()).or_default();
                region.compare(&layer.name, [&separate, &shared], change, context)?;
            }
        }
        let [bytes, with_shares] = bytes_of_all;
        let least = changes.values().map(|c| c.bits / c.particles).min_by(f64::total_cmp);
        let power = changes.values().map(|c| c.power / c.regions).fold(0.0, f64::max);
        Ok(least.map(|gain| SharingTrial { gain, power, gaussians: bytes / with_shares }))
    }

    /// Whether no species is served worse.
    pub fn is_better(&self) -> bool {
        self.gain > 0.0 && self.power < POWER
    }
}

impl RegionHalves {
    /// `None` where there are few particles, or not all species.
    fn new(particles: &Particles, seed: u64, context: &Context<'_>) -> Result<Option<RegionHalves>> {
        let whole = Domain::from_particles(particles);
        let Some((mut inside, bounds)) = particles_of_region(particles, &whole, seed, PARTICLES, context)? else {
            return Ok(None);
        };
        let domain = Domain::upright(bounds.min, bounds.extent(), [false; 3]);
        if inside.len() < FEWEST || domain.length.iter().any(|l| *l <= 0.0) {
            return Ok(None);
        }
        // A region does not repeat at its own faces.
        inside.meta.cell = None;
        let half = |left_out| {
            let half = Selection { sample: Some(inside.len() as u64 / 2), left_out, seed, ..Selection::all() };
            inside.select(half, &Storage::Memory, context)
        };
        let (fitted, others) = (half(false)?, half(true)?);
        let all = |p: &Particles| p.layers().len() == particles.layers().len();
        Ok((all(&fitted) && all(&others)).then_some(RegionHalves { fitted, others, domain, seed }))
    }

    /// A model of so many Gaussians, and its bytes.
    fn fit(&self, sharing: SharingPolicy, number: f64, radius: f64, context: &Context<'_>) -> Result<(Model, f64)> {
        let options = Options {
            target: Target::Gaussians((number as u64).max(self.fitted.layers().len() as u64)),
            effort: Effort::Fast,
            certificate: CertificateLevel::None,
            seed: self.seed,
            radius: Some(radius),
            sharing,
            ..Options::default()
        };
        let done = compress(&self.fitted, &options, &mut NoCheckpoints, context)?;
        Ok((done.model, coded_bytes(&done.bytes)?))
    }

    /// Adds the change by the second model for a species against the first.
    fn compare(
        &self,
        species: &str,
        models: [&Model; 2],
        change: &mut SpeciesChange,
        context: &Context<'_>,
    ) -> Result<()> {
        let layer_of = |all: &Particles| all.layers().iter().find(|l| l.name == species).map(|l| all.of_layer(l));
        let (Some(fitted), Some(others)) = (layer_of(&self.fitted), layer_of(&self.others)) else { return Ok(()) };
        let mut options = spectrum_options(&self.domain, others.len());
        // Halves of the particles show less than all, on which a certificate is measured.
        options.k_max *= BEYOND;
        // Halves have no shot noise in common.
        let halves = [Subject::Particles(&fitted), Subject::Particles(&others)];
        let truth = power_spectra(halves, &self.domain, &options, context)?.shells;
        let (mut bits, mut off) = ([0.0; 2], [0.0; 2]);
        for (i, model) in models.into_iter().enumerate() {
            let species_model = model.clone().only(&[species.to_string()])?;
            bits[i] = likelihood(&species_model, &others, &self.domain, self.seed, context)?.bits;
            let pair = [Subject::Model(&species_model), Subject::Particles(&others)];
            let power = power_spectra(pair, &self.domain, &options, context)?.shells;
            off[i] = deviation(&truth, &power, options.k_max);
        }
        let n = others.len() as f64;
        change.bits += n * (bits[1] - bits[0]);
        change.particles += n;
        change.power += off[1] - off[0];
        change.regions += 1.0;
        Ok(())
    }
}

/// Relative difference of the power of the first field from the cross power of `truth`, on average over bands.
fn deviation(truth: &[Shell], power: &[Shell], k_max: f64) -> f64 {
    let (mut from, mut sum, mut bands) = (0.0, 0.0, 0.0f64);
    for share in BANDS {
        let to = share * k_max * (1.0 + 1e-9);
        let inside = |s: &&Shell| s.k > from && s.k <= to;
        let in_band = |shells: &[Shell], value: &dyn Fn(&Shell) -> f64| -> f64 {
            shells.iter().filter(inside).map(|s| s.modes as f64 * value(s)).sum()
        };
        let (truth, model_power) = (in_band(truth, &|s| s.cross), in_band(power, &|s| s.power[0]));
        if truth > 0.0 {
            sum += (model_power / truth - 1.0).abs();
            bands += 1.0;
        }
        from = to;
    }
    sum / bands.max(1.0)
}

/// Bytes of a file's Gaussians and shares, without what each section says once.
fn coded_bytes(file: &[u8]) -> Result<f64> {
    let layers = codec::coded_layers(file, "a trial")?;
    let shares =
        |b: &StoredBlock| b.sections.iter().map(|s| (s.bytes.len() as f64 - SECTION_HEAD).max(0.0)).sum::<f64>();
    Ok(layers.iter().flat_map(|l| &l.content).map(|b| b.bytes.len() as f64 + shares(b)).sum())
}
