//! A smaller file from a file, without the particles.

use super::joined_fields::join_fields;
use super::plan::near_pixel;
use super::size::{CodedGaussians, SizeOutcome, SizeTarget, bytes_a_gaussian};
use particlegs_core::codec::Encoder;
use particlegs_core::context::Context;
use particlegs_core::model::{Block, CertificateLevel, LawKind, Layer, Metadata, Mixture, Model, RecipeStep, Target};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, codec};
use particlegs_fit::{Effort, SimplifyOptions};

/// Reduces `model` (of `model_bytes` bytes) to a number of Gaussians, a ratio or a size, fields not counted; every layer
/// becomes one block. Metadata of the snapshot stay, also its hash; the certificate is dropped.
pub fn simplify(model: Model, model_bytes: u64, target: Target, context: &Context<'_>) -> Result<Vec<u8>> {
    let target = target.check()?;
    let Model { mut metadata, layers, .. } = model;
    if metadata.law != LawKind::OpticalDepth {
        let message =
            format!("a model of the {} law cannot be simplified: its splats do not add up", metadata.law.name());
        return Err(Error::argument_with(message, "train a model with fewer Gaussians on the snapshot"));
    }
    let fields = std::mem::take(&mut metadata.fields);
    metadata.recipe.steps.push(RecipeStep::Simplify(target));
    metadata.tool_version = env!("CARGO_PKG_VERSION").to_string();
    let raw_bytes = layers.iter().map(|l| l.count() * l.mass.particle_bytes()).sum();
    let mut layers: Vec<Layer<Block>> = layers.into_iter().map(|l| l.map(joined)).collect();
    // The smallest first: what they leave of their share goes to the larger.
    layers.sort_by(|a, b| (a.content.gaussians.len(), &a.name).cmp(&(b.content.gaussians.len(), &b.name)));
    let old = if fields.is_empty() { Vec::new() } else { layers.clone() };
    let job = Reduction { metadata, layers, context };
    let coded = match target {
        Target::Gaussians(k) => job.to_number(k)?,
        Target::Ratio(_) | Target::Size(_) => {
            let bytes = target.bytes(raw_bytes).unwrap_or(0);
            if bytes >= model_bytes {
                let message = format!("the target is {bytes} bytes, but the model has only {model_bytes}");
                return Err(Error::unreachable(message, "use a larger ratio than the model's own"));
            }
            job.to_size(bytes, raw_bytes)?
        }
        Target::Default | Target::Psnr(_) | Target::Goal(_) => {
            return Err(Error::argument("simplifying needs a ratio, a size or a number of Gaussians as its target"));
        }
    };
    let bytes = join_fields(job.file(coded)?, &old, fields, context)?;
    codec::check(&bytes, "the simplified model", context)?;
    Ok(bytes)
}

/// All blocks of a layer as one.
fn joined(blocks: Vec<Block>) -> Block {
    let bounds = blocks.iter().fold(Bounds::empty(), |all, b| all.union(&b.bounds));
    let (count, mass) = (blocks.iter().map(|b| b.count).sum(), blocks.iter().map(|b| b.mass).sum());
    let mut gaussians = Mixture::new(blocks.iter().any(|b| b.gaussians.masses().is_some()));
    blocks.iter().for_each(|b| gaussians.append(&b.gaussians));
    Block { bounds, count, mass, gaussians }
}

struct Reduction<'a> {
    metadata: Metadata,
    layers: Vec<Layer<Block>>,
    context: &'a Context<'a>,
}

impl Reduction<'_> {
    fn reduced(&self, layer: &Layer<Block>, number: usize) -> Result<Encoder> {
        let options = SimplifyOptions {
            gaussians: number,
            radius: self.metadata.default_radius,
            pixel: near_pixel(&self.metadata.bounds),
        };
        let gaussians = particlegs_fit::simplify(&layer.content.gaussians, &options, self.context)?;
        Encoder::new(&Block { gaussians, ..layer.content })
    }

    /// `number` Gaussians at the nominal precision, every layer by the same factor.
    fn to_number(&self, number: u64) -> Result<Vec<CodedGaussians>> {
        let model_gaussians: usize = self.layers.iter().map(|l| l.content.gaussians.len()).sum();
        let fewest = self.layers.len();
        if number > model_gaussians as u64 || number < fewest as u64 {
            let message = format!("use {fewest} to {model_gaussians} Gaussians for this model, not {number}");
            return Err(Error::argument(message));
        }
        let (mut left, mut gaussians_left) = (number as usize, model_gaussians);
        let mut coded = Vec::with_capacity(fewest);
        for (i, layer) in self.layers.iter().enumerate() {
            let layer_gaussians = layer.content.gaussians.len();
            let share = (left as f64 * layer_gaussians as f64 / gaussians_left as f64).round() as usize;
            // One at least for this layer and for each that is still to come.
            let share = share.clamp(1, left - (fewest - 1 - i)).min(layer_gaussians);
            coded.push(CodedGaussians::at_nominal_steps(&self.reduced(layer, share)?));
            (left, gaussians_left) = (left - share, gaussians_left - layer_gaussians);
        }
        Ok(coded)
    }

    /// The best file of at most `target` bytes.
    fn to_size(&self, target: u64, raw_bytes: u64) -> Result<Vec<CodedGaussians>> {
        let heads: Vec<Layer<usize>> = self.layers.iter().map(|l| l.with(1)).collect();
        let overhead = codec::size_without_blocks(&self.metadata, CertificateLevel::None, &heads) as u64;
        let mut left = target.saturating_sub(overhead);
        let mut gaussians_left: usize = self.layers.iter().map(|l| l.content.gaussians.len()).sum();
        let mut coded = Vec::with_capacity(self.layers.len());
        for layer in &self.layers {
            let layer_gaussians = layer.content.gaussians.len();
            let bytes = (left as f64 * layer_gaussians as f64 / gaussians_left as f64) as u64;
            let done = self.layer_to_size(layer, bytes)?;
            left = left.saturating_sub(codec::stored_bytes(&done.bytes) as u64);
            gaussians_left -= layer_gaussians;
            coded.push(done);
        }
        if coded.last().is_some_and(|c| c.size_met == SizeOutcome::TooLarge) {
            let smallest = overhead + coded.iter().map(|c| codec::stored_bytes(&c.bytes) as u64).sum::<u64>();
            let message = format!("the target is {target} bytes, but the smallest possible file has {smallest} bytes");
            let hint = format!("use a ratio of {:.4} or less", raw_bytes as f64 / smallest as f64);
            return Err(Error::unreachable(message, hint));
        }
        Ok(coded)
    }

    /// A layer's block of at most `bytes`, its steps near nominal where that can be.
    fn layer_to_size(&self, layer: &Layer<Block>, bytes: u64) -> Result<CodedGaussians> {
        let most = layer.content.gaussians.len() as u64;
        let target = SizeTarget { bytes, bytes_a_gaussian: bytes_a_gaussian(Effort::Default), most };
        let (coded, ()) = target.find(|number| {
            let encoder = self.reduced(layer, number as usize)?;
            Ok((CodedGaussians::to_size(&encoder, bytes, None, || self.context.check())?, ()))
        })?;
        Ok(coded)
    }

    fn file(self, coded: Vec<CodedGaussians>) -> Result<Vec<u8>> {
        let layer = |(l, c): (Layer<Block>, CodedGaussians)| l.with(vec![c.bytes.into()]);
        codec::assemble(&self.metadata, None, self.layers.into_iter().zip(coded).map(layer).collect())
    }
}
