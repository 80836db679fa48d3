//! Models as they were opened: on their way, and whole.

use crate::clip::clipped;
use crate::coarse::Coarse;
use particlegs_core::codec::Decoder;
use particlegs_core::model::{Block, Model};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};

/// Gaussians that are decoded in a step, about: some tens of milliseconds.
const STEP: usize = 65_536;

/// A model, as far as it was decoded.
pub(crate) enum Opened {
    /// On its way.
    Opening(Box<Opening>),
    /// All of it; and for motion, where that is less.
    Whole { whole: Part, coarse: Option<Part> },
    /// It turned out to be corrupt.
    Failed(String),
}

/// A model on its way.
pub(crate) struct Opening {
    decoder: Decoder<'static>,
    /// Pieces that are left, the next one last.
    left: Vec<usize>,
    /// What stands for all of it meanwhile, a block for each piece; nothing where all of it is small, or its law does
    /// not add up.
    sketch: Option<(Coarse, Part)>,
}

/// A model, and what of it lies inside the box that was last asked for.
pub(crate) struct Part {
    pub model: Model,
    clipped: Option<(Bounds, Model, Vec<usize>)>,
}

impl Opened {
    /// A model none of which was decoded.
    pub(crate) fn new(decoder: Decoder<'static>) -> Self {
        // Pieces that follow each other lie beside each other: with the bits of their numbers reversed, the next one is
        // far from all that were read, and the picture grows sharper everywhere.
        let mut left: Vec<usize> = (0..decoder.pieces()).collect();
        left.sort_by_key(|piece| std::cmp::Reverse(piece.reverse_bits()));
        let sketch = Coarse::of(decoder.info()).filter(|_| left.len() > 1).map(|coarse| {
            (coarse, Part::new(coarse.outline(&decoder)))
        });
        Opened::Opening(Box::new(Opening { decoder, left, sketch }))
    }

    /// Decodes a step more; gives the share of Gaussians that were decoded.
    ///
    /// # Errors
    /// [`Error::Corrupt`], now and ever after.
    pub(crate) fn step(&mut self) -> Result<f64> {
        let Opened::Opening(opening) = self else { return self.whole().map(|_| 1.0) };
        match opening.step() {
            Ok(share) if share < 1.0 => Ok(share),
            Ok(_) => self.whole().map(|_| 1.0),
            Err(error) => Err(self.fail(error)),
        }
    }

    fn fail(&mut self, error: Error) -> Error {
        *self = Opened::Failed(error.to_string());
        error
    }

    /// All of it; what is left is decoded now.
    ///
    /// # Errors
    /// [`Error::Corrupt`].
    pub(crate) fn whole(&mut self) -> Result<&mut Part> {
        if let Opened::Opening(_) = self {
            
        }
        match self {
            Opened::Whole { whole, .. } => Ok(whole),
            Opened::Failed(error) => Err(Error::argument(error.clone())),
            Opened::Opening(_) => unreachable!(),
        }
    }
}
