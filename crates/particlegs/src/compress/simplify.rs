//! A smaller file from a file, without the particles.

use super::block::{NEAR_NOMINAL, bytes_a_gaussian};
use super::plan::near_pixel;
use super::rate::{Met, meet_size};
use super::target::Target;
use crate::codec::{self, CodedLayer, Encoder, LayerHead, Precision};
use crate::fit::{self, Effort, SimplifyOptions};
use crate::model::{Block, Law, Layer, Metadata, Mixture, Model};
use crate::particles::Bounds;
use crate::progress::Progress;
use crate::{Error, Result};

/// A smaller model's file.
pub struct Simplified {
    /// The file, whole.
    pub bytes: Vec<u8>,
    /// Its Gaussians.
    pub gaussians: usize,
    /// Bytes of the particles that it stands for, as float32.
    pub raw_bytes: u64,
}

/// Reductions tried at most to find a number of Gaussians whose steps are near nominal.
const TRIES: usize = 3;

/// Reduces `model` (of `model_bytes` bytes) to a number of Gaussians or a ratio; every layer becomes
/// one block. What is known about the source stays, its hash with it; the certificate goes.
/// `command` is stored before the model's own.
///
/// # Errors
/// [`Error::Argument`] for a model of the alpha-blend law, whose splats do not add up; for more
/// Gaussians than there are or fewer than layers, or a target that is neither; [`Error::Unreachable`] for a ratio below the model's own, or one that no file reaches;
/// those of [`fit::simplify`].
pub fn simplify(
    model: Model,
    model_bytes: u64,
    target: Target,
    command: &str,
    progress: &dyn Progress,
) -> Result<Simplified> {
    let target = target.check()?;
    let Model { mut metadata, layers, .. } = model;
    if metadata.law != Law::OpticalDepth {
        let what = format!("a model of the {} law cannot be simplified: its splats do not add up", metadata.law.name());
        return Err(Error::Argument { what, hint: "train one with fewer Gaussians on the snapshot".into() });
    }
    metadata.command = format!("{command} of: {}", metadata.command);
    metadata.tool_version = env!("CARGO_PKG_VERSION").to_string();
    let raw_bytes = layers.iter().map(|l| l.count() * if l.is_weighted() { 16 } else { 12 }).sum();
    let mut layers: Vec<Whole> = layers.into_iter().map(Whole::of).collect();
    // The smallest first: what they leave of their room goes to the larger.
    layers.sort_by(|a, b| (a.block.gaussians.len(), &a.name).cmp(&(b.block.gaussians.len(), &b.name)));
    let job = Reduction { metadata, layers, progress };
    let coded = match target {
        Target::Gaussians(k) => job.to_number(k)?,
        Target::Ratio(_) | Target::Size(_) => {
            let bytes = target.bytes(raw_bytes).unwrap_or(0);
            if bytes >= model_bytes {
                let what = format!("{bytes} bytes were asked for; the model has {model_bytes} already");
                return Err(Error::Unreachable { what, hint: "ask for a larger ratio than the model's own".into() });
            }
            job.to_size(bytes, raw_bytes)?
        }
        Target::Default | Target::Psnr(_) => {
            return Err(Error::argument("a model is simplified to a ratio, a size or a number of Gaussians"));
        }
    };
    let gaussians = coded.iter().map(|c| c.gaussians).sum();
    let bytes = job.file(coded)?;
    codec::check(&bytes, "the simplified model", progress)?;
    Ok(Simplified { bytes, gaussians, raw_bytes })
}

/// A layer as one block.
struct Whole {
    name: String,
    particle_mass: Option<f64>,
    block: Block,
}

impl Whole {
    fn of(layer: Layer) -> Whole {
        let (count, weighted) = (layer.count(), layer.is_weighted());
        let mass = layer.blocks.iter().map(|b| b.mass).sum();
        let bounds = layer.blocks.iter().fold(Bounds::empty(), |all, b| all.union(&b.bounds));
        let mut gaussians = Mixture { mass: weighted.then(Vec::new), ..Mixture::default() };
        layer.blocks.iter().for_each(|b| gaussians.append(&b.gaussians));
        Whole { name: layer.name, particle_mass: layer.particle_mass, block: Block { bounds, count, mass, gaussians } }
    }

    fn head(&self) -> LayerHead<'_> {
        let weighted = self.block.gaussians.mass.is_some();
        LayerHead { name: &self.name, particle_mass: self.particle_mass, weighted, blocks: 1 }
    }
}

/// A layer's coded block.
struct Coded {
    bytes: Vec<u8>,
    gaussians: usize,
}

struct Reduction<'a> {
    metadata: Metadata,
    layers: Vec<Whole>,
    progress: &'a dyn Progress,
}

impl Reduction<'_> {
    fn reduced(&self, layer: &Whole, number: usize) -> Result<Encoder> {
        let options = SimplifyOptions {
            gaussians: number,
            radius: self.metadata.default_radius,
            pixel: near_pixel(&self.metadata.bounds),
        };
        let gaussians = fit::simplify(&layer.block.gaussians, &options, self.progress)?;
        Encoder::new(&Block { gaussians, ..layer.block })
    }

    /// `number` Gaussians at the nominal precision, every layer by the same factor.
    fn to_number(&self, number: u64) -> Result<Vec<Coded>> {
        let there: usize = self.layers.iter().map(|l| l.block.gaussians.len()).sum();
        let fewest = self.layers.len();
        if number > there as u64 || number < fewest as u64 {
            let what =
                format!("{number} Gaussians were asked for: the model has {there}, and {fewest} at least are needed");
            return Err(Error::argument(what));
        }
        let (mut left, mut there_left) = (number as usize, there);
        let mut coded = Vec::with_capacity(fewest);
        for (i, layer) in self.layers.iter().enumerate() {
            let own = layer.block.gaussians.len();
            let share = (left as f64 * own as f64 / there_left as f64).round() as usize;
            // One at least for this layer and for each that is still to come.
            let share = share.clamp(1, left - (fewest - 1 - i)).min(own);
            let encoder = self.reduced(layer, share)?;
            coded.push(Coded { bytes: encoder.encode(&Precision::BALANCED), gaussians: encoder.len() });
            (left, there_left) = (left - share, there_left - own);
        }
        Ok(coded)
    }

    /// The best file of at most `target` bytes.
    fn to_size(&self, target: u64, raw_bytes: u64) -> Result<Vec<Coded>> {
        let heads: Vec<LayerHead<'_>> = self.layers.iter().map(Whole::head).collect();
        let overhead = codec::size_without_blocks(&self.metadata, false, &heads) as u64;
        let mut room = target.saturating_sub(overhead);
        let mut there: usize = self.layers.iter().map(|l| l.block.gaussians.len()).sum();
        let mut coded = Vec::with_capacity(self.layers.len());
        let mut too_large = false;
        for layer in &self.layers {
            let own = layer.block.gaussians.len();
            let (met, gaussians) = self.layer_to_size(layer, (room as f64 * own as f64 / there as f64) as u64)?;
            too_large = met.too_large;
            room = room.saturating_sub(met.bytes.len() as u64);
            there -= own;
            coded.push(Coded { bytes: met.bytes, gaussians });
        }
        if too_large {
            let smallest = overhead + coded.iter().map(|c| c.bytes.len() as u64).sum::<u64>();
            let what = format!("{target} bytes were asked for; the smallest file of this model has {smallest} bytes");
            let hint = format!("ask for a ratio of {:.4} or less", raw_bytes as f64 / smallest as f64);
            return Err(Error::Unreachable { what, hint });
        }
        Ok(coded)
    }

    /// A layer's block of at most `room` bytes, its steps near nominal where that can be.
    fn layer_to_size(&self, layer: &Whole, room: u64) -> Result<(Met, usize)> {
        let most = layer.block.gaussians.len();
        let number = |each: f64| ((room as f64 / each) as usize).clamp(1, most);
        let mut wanted = number(bytes_a_gaussian(Effort::Default));
        let (mut met, mut gaussians, mut nominal) = self.met_with(layer, wanted, room)?;
        for _ in 1..TRIES {
            let better = number(nominal / gaussians as f64);
            if !met.too_large && NEAR_NOMINAL.contains(&met.factor) || better == wanted {
                break;
            }
            wanted = better;
            (met, gaussians, nominal) = self.met_with(layer, wanted, room)?;
        }
        if met.too_large && wanted > 1 {
            (met, gaussians, _) = self.met_with(layer, 1, room)?;
        }
        Ok((met, gaussians))
    }

    /// The block, its Gaussians, and its bytes at the nominal steps.
    fn met_with(&self, layer: &Whole, number: usize, room: u64) -> Result<(Met, usize, f64)> {
        let encoder = self.reduced(layer, number)?;
        let encode = |q| {
            self.progress.check()?;
            Ok(encoder.encode(&Precision::BALANCED.scaled(q)))
        };
        let (met, nominal) = meet_size(room, encoder.len(), None, encode)?;
        Ok((met, encoder.len(), nominal as f64))
    }

    fn file(self, coded: Vec<Coded>) -> Result<Vec<u8>> {
        let layer =
            |(l, c): (Whole, Coded)| CodedLayer { name: l.name, particle_mass: l.particle_mass, blocks: vec![c.bytes] };
        codec::assemble(&self.metadata, None, self.layers.into_iter().zip(coded).map(layer).collect())
    }
}
