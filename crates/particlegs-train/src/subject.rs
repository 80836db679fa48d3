//! What a run learns from.

use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::progress::Progress;
use particlegs_core::splat::Look;

/// The particles of a run: their pictures to learn from and to be scored on, and where they lie.
/// `particlegs::reference::Reference` is one.
pub trait Subject: Sync {
    /// Number of particles.
    fn len(&self) -> usize;

    /// No particles?
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position of particle `i`, world units.
    fn position(&self, i: usize) -> [f64; 3];

    /// The picture of all particles in a look, shot noise and all.
    ///
    /// # Errors
    /// [`particlegs_core::Error::Argument`] for a view out of range; [`particlegs_core::Error::Memory`],
    /// [`particlegs_core::Error::Cancelled`].
    fn draw(&self, view: &View, size: Size, look: Look, progress: &dyn Progress) -> Result<Gray8>;

    /// The noise-free optical depth a pixel.
    ///
    /// # Errors
    /// As [`Subject::draw`].
    fn optical_depth(&self, view: &View, size: Size, progress: &dyn Progress) -> Result<Plane>;
}
