//! Particles on their way to a picture.

use super::Points;
use particlegs_core::Result;

/// Particles, piece by piece in their order, as often as a picture asks for them.
pub trait Pieces {
    /// Calls `work` with every piece.
    ///
    /// # Errors
    /// Those of `work`, and of pieces that cannot be had.
    fn each(&self, work: &mut dyn FnMut(&Points) -> Result<()>) -> Result<()>;
}

/// Pieces that are on the device.
impl Pieces for Vec<Points> {
    fn each(&self, work: &mut dyn FnMut(&Points) -> Result<()>) -> Result<()> {
        self.iter().try_for_each(work)
    }
}
