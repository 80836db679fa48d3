//! The share of a block in the whole, and the file of all blocks together: whether it meets its target.

use super::block::{BlockParticles, CodedBlock};
use super::clock::Clock;
use super::layer::Share;
use super::plan::CompressionPlan;
use super::shared_species::SharedLayer;
use super::size::{SizeOutcome, bytes_a_gaussian};

use particlegs_core::codec::CodedLayer;
use particlegs_core::context::Context;
use particlegs_core::model::{Certificate, DEFAULT_RATIO, Metadata, Target};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Hint, Result, codec};

impl CompressionPlan {
    /// The share of a block of what `target` asks of the whole.
    pub(super) fn share(&self, target: Target, block: &BlockParticles) -> Result<Share> {
        match (target, target.bytes(self.raw_bytes())) {
            (_, Some(bytes)) => {
                let left = bytes.saturating_sub(self.overhead());
                let share = block.raw_bytes as f64 / self.raw_bytes() as f64;
                Ok(Share::Bytes((left as f64 * share) as u64))
            }
            (Target::Gaussians(number), _) => {
                let share = block.count as f64 / self.metadata.count as f64;
                Ok(Share::Gaussians(((number as f64 * share).round() as u64).max(1)))
            }
            _ => Err(Error::argument("a quality target cannot be divided among blocks: use a size or a ratio")),
        }
    }

    /// Blocks that `fit` makes at a target, with the shares of species that share their Gaussians.
    pub(super) fn with_shares(
        &self,
        target: Target,
        shared: &SharedLayer,
        fit: &mut dyn FnMut(Target) -> Result<Vec<CodedBlock>>,
        context: &Context<'_>,
    ) -> Result<Vec<CodedBlock>> {
        let add_shares = |coded: &mut [CodedBlock], most| -> Result<Option<f64>> {
            let mut clock = Clock::default();
            let part = clock.time("fit", || shared.add_shares(coded, most, context))?;
            coded.first_mut().into_iter().for_each(|b| b.clock.append(std::mem::take(&mut clock)));
            Ok(part)
        };
        let Some(bytes) = target.bytes(self.raw_bytes()) else {
            let mut coded = fit(target)?;
            add_shares(&mut coded, None)?;
            return Ok(coded);
        };
        let most = Some(bytes.saturating_sub(self.overhead()));
        let part_of_target = |part: f64| Target::Size((bytes as f64 * part) as u64);
        let mut coded = fit(part_of_target(shared.gaussians))?;
        // What shares take is known once there are Gaussians: too little room for them is mended once.
        if let Some(part) = add_shares(&mut coded, most)?.filter(|part| *part < 0.99 * shared.gaussians) {
            coded = fit(part_of_target(part))?;
            add_shares(&mut coded, most)?;
        }
        Ok(coded)
    }

    /// About how many Gaussians there will be.
    pub(super) fn gaussians(&self) -> f64 {
        let target = self.recipe().target;
        let bytes = target.bytes(self.raw_bytes()).map_or(self.raw_bytes() as f64 / DEFAULT_RATIO, |b| b as f64);
        if let Target::Gaussians(number) = target {
            number as f64
        } else {
            bytes / bytes_a_gaussian(self.recipe().effort)
        }
    }

    /// A note for the user on how all blocks together meet their target.
    pub(crate) fn judge(&self, blocks: &[CodedBlock]) -> Result<Option<String>> {
        let Some(target) = self.recipe().target.bytes(self.raw_bytes()) else { return Ok(None) };
        let smallest = blocks.iter().map(|b| b.size() as u64).sum::<u64>() + self.overhead();
        if blocks.iter().any(|b| b.size_met == SizeOutcome::TooLarge) {
            let message = format!("the target is {target} bytes, but the smallest possible file has {smallest} bytes");
            // Nobody asked for the default size, so a larger file is a note and no error.
            if self.recipe().target != Target::Default {
                let ratio = self.raw_bytes() as f64 / smallest as f64;
                let hint = Hint::larger_file(smallest).words(", or for ").option("ratio", format!("{ratio:.4}"));
                return Err(Error::unreachable(message, hint.words(" or less")));
            }
            return Ok(Some(message));
        }
        Ok(blocks.iter().all(|b| b.size_met == SizeOutcome::TooSmall).then(|| {
            format!(
                "the file has {smallest} bytes, less than the target of {target}: more Gaussians would fit the \
                 particles' noise (set a number of Gaussians to get more)"
            )
        }))
    }

    /// The file of all blocks, with the network of block 0 (paper section III-D).
    pub(crate) fn file(&self, blocks: &[CodedBlock], certificate: Option<&Certificate>) -> Result<Vec<u8>> {
        self.file_within(self.metadata.bounds, blocks, certificate)
    }

    /// The file of one block on its own: a model of its particles, drawn as the whole is.
    pub(crate) fn block_file(&self, block: &CodedBlock) -> Result<Vec<u8>> {
        self.file_within(block.bounds, std::slice::from_ref(block), None)
    }

    fn file_within(&self, bounds: Bounds, blocks: &[CodedBlock], certificate: Option<&Certificate>) -> Result<Vec<u8>> {
        let mut layers: Vec<CodedLayer> = Vec::new();
        for layer in blocks.iter().flat_map(|b| &b.layers) {
            match layers.iter_mut().find(|l| l.name == layer.name) {
                Some(l) => l.content.extend(layer.content.iter().cloned()),
                None => layers.push(layer.clone()),
            }
        }
        let (count, mass) = codec::sums(&layers)?;
        let metadata = Metadata { count, mass, bounds, ..self.metadata.clone() };
        let network = blocks.first().and_then(|b| b.vizmapper.as_ref());
        codec::assemble_with(&metadata, network, certificate, layers)
    }
}
