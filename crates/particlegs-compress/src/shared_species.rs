//! Species that share Gaussians: fitted together as one layer, each with a share of every Gaussian (docs/format.md,
//! section 15).

use super::Options;
use super::block::CodedBlock;
use super::options::SharingPolicy;
use super::sharing_trial::SharingTrial;
use particlegs_core::codec::{CodedLayer, FieldPrecision, SHARE, StoredSection};
use particlegs_core::context::Context;
use particlegs_core::model::{Block, Layer, Mass, Quantity, SharedSpecies};
use particlegs_core::{Error, Hint, Result, codec};
use particlegs_fit::{BlockField, FieldShape, gather};
use particlegs_particles::{Particles, RUN};
use std::ops::Range;

/// Bytes that a Gaussian and a share of it take about.
const GAUSSIAN: f64 = 3.85;
const SHARE_BYTES: f64 = 0.2;

/// All species of a snapshot as one layer.
pub(super) struct SharedLayer {
    /// The particles as that layer.
    pub particles: Particles,
    pub species: Vec<SharedSpecies>,
    /// The particles of each.
    ranges: Vec<Range<usize>>,
    /// The part of a file's bytes that is for the Gaussians; the rest is for the shares.
    pub gaussians: f64,
}

impl SharedLayer {
    /// Species that can share Gaussians: 2 to 16, whose particles have no masses of their own.
    pub fn new(particles: &Particles) -> Result<SharedLayer> {
        let layers = particles.layers();
        let refused = |reason: &str| {
            let hint = Hint::from("leave out ").option("share-gaussians", "yes");
            Error::argument_with(format!("the particle types cannot share Gaussians: {reason}"), hint)
        };
        if !(2..=SharedSpecies::MOST).contains(&layers.len()) {
            let type_count = if layers.len() == 1 { "one type".into() } else { format!("{} types", layers.len()) };
            return Err(refused(&format!("{type_count} instead of 2 to {}", SharedSpecies::MOST)));
        }
        if let Some(layer) = layers.iter().find(|l| l.mass.is_weighted()) {
            return Err(refused(&format!("those of type `{}` have individual masses", layer.name)));
        }
        let species = |l: &Layer<Range<usize>>| SharedSpecies {
            name: l.name.clone(),
            count: l.content.len() as u64,
            mass: l.mass.unit(),
        };
        let mut species_ranges: Vec<(SharedSpecies, Range<usize>)> =
            layers.iter().map(|l| (species(l), l.content.clone())).collect();
        species_ranges.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        let (species, ranges): (Vec<_>, Vec<_>) = species_ranges.into_iter().unzip();
        let name = SharedSpecies::layer_name(&species);
        if name.len() > 255 {
            return Err(refused("the names of the types have more than 255 characters together"));
        }
        let layer = Layer { name, mass: Mass::Unknown, content: 0..particles.len() };
        let particles = particles.of_layer(&layer);
        let gaussians = GAUSSIAN / (GAUSSIAN + SHARE_BYTES * (species.len() - 1) as f64);
        Ok(SharedLayer { particles, species, ranges, gaussians })
    }

    /// As asked for, of particles whose model will have so many `gaussians` and a default particle `radius`. A trial
    /// decides where nothing is asked for.
    pub fn chosen(
        particles: &Particles,
        options: &Options,
        gaussians_and_radius: (f64, f64),
        context: &Context<'_>,
    ) -> Result<Option<SharedLayer>> {
        if !options.fields.is_empty() && options.sharing == SharingPolicy::Yes {
            return Err(Error::argument_with(
                "particle types that share Gaussians cannot have fields",
                "choose one particle type, or leave the fields out",
            ));
        }
        match (options.sharing, SharedLayer::new(particles)) {
            (SharingPolicy::Automatic, _) if !options.may_share() => Ok(None),
            (SharingPolicy::No, _) | (SharingPolicy::Automatic, Err(_)) => Ok(None),
            (SharingPolicy::Yes, shared) => shared.map(Some),
            (SharingPolicy::Automatic, Ok(shared)) => {
                let trial =
                    SharingTrial::new(particles, gaussians_and_radius, context)?.filter(SharingTrial::is_better);
                Ok(trial.map(|t| SharedLayer { gaussians: t.gaussians.min(1.0), ..shared }))
            }
        }
    }

    /// The layer, and its number of particles.
    pub fn layer(&self) -> Layer<u64> {
        let layer = &self.particles.layers()[0];
        layer.with(layer.content.len() as u64)
    }

    /// Adds the shares of the species to all coded blocks of the layer, in steps so fine that the blocks take `most`
    /// bytes where that is possible. Gives the part of the bytes that the Gaussians take with the finest shares, if
    /// these do not fit.
    pub fn add_shares(
        &self,
        blocks: &mut [CodedBlock],
        most: Option<u64>,
        context: &Context<'_>,
    ) -> Result<Option<f64>> {
        let mut stored: Vec<&mut codec::StoredBlock> =
            blocks.iter_mut().flat_map(|b| &mut b.layers).flat_map(|l: &mut CodedLayer| &mut l.content).collect();
        let decoded = stored.iter().map(|b| codec::decode_block(&b.bytes, "the block just coded"));
        let decoded = decoded.collect::<Result<Vec<Block>>>()?;
        let quantities: Vec<Quantity> = self.species.iter().map(SharedSpecies::quantity).collect();
        // The last species has what the others leave of each Gaussian (docs/format.md, section 15).
        let coded = &quantities[..quantities.len() - 1];
        let shapes: Vec<FieldShape<'_>> = coded.iter().map(FieldShape::new).collect();
        let read = |run: u64, out: &mut Vec<Vec<f64>>| {
            let first = run as usize * RUN;
            let run = first..self.particles.len().min(first + RUN);
            let is_of = |k: usize, i: usize| f64::from(u8::from(self.ranges[k].contains(&i)));
            out.extend((0..coded.len()).map(|k| run.clone().map(|i| is_of(k, i)).collect()));
            Ok(())
        };
        let gathered = gather(&decoded, &self.particles, &shapes, &read, context)?;
        let beside: usize = stored.iter().map(|b| codec::stored_bytes(&b.bytes)).sum();
        let code = |coarser: f32| -> Vec<Vec<StoredSection>> {
            let default_precision = FieldPrecision::default();
            let precision =
                FieldPrecision { shares: default_precision.shares.map(|s| s * coarser), ..default_precision };
            let section = |block: &Block, (k, f): (usize, &BlockField)| {
                let numbered_quantity = (k as u8, &coded[k]);
                let bytes =
                    codec::encode_field(numbered_quantity, &f.moments, &block.gaussians, &f.sums, &precision, None);
                StoredSection { tag: SHARE, bytes }
            };
            let of_block = |(block, fields): (&Block, &Vec<BlockField>)| {
                fields.iter().enumerate().map(|f| section(block, f)).collect()
            };
            decoded.iter().zip(&gathered).map(of_block).collect()
        };
        let bytes =
            |sections: &[Vec<StoredSection>]| -> usize { sections.iter().flatten().map(StoredSection::size).sum() };
        let mut sections = code(1.0);
        let whole = beside + bytes(&sections);
        // By the finest shares, whatever is stored: the caller may fit again with more room for them.
        let too_small = most.filter(|most| whole as u64 > *most).map(|_| beside as f64 / whole as f64);
        for coarser in COARSER {
            if most.is_none_or(|most| (beside + bytes(&sections)) as u64 <= most) {
                break;
            }
            sections = code(coarser);
        }
        stored.iter_mut().zip(sections).for_each(|(b, s)| b.sections = s);
        Ok(too_small)
    }
}

/// Multiples of the steps of shares that are tried in turn until they fit.
const COARSER: [f32; 4] = [1.5, 2.5, 4.0, 8.0];
