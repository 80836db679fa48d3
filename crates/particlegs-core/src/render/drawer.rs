//! What draws in place of the processor.

use crate::Result;
use crate::camera::View;
use crate::context::Context;
use crate::picture::{Gray8, Plane, Size};

/// Draws a model and its snapshot elsewhere, on a graphics card say, as this program's stages draw them. Views have a
/// clipping range.
pub trait Drawer: Sync {
    /// ParaView's own picture of all particles before FXAA, shot noise and all.
    ///
    /// # Errors
    /// For a view out of range or not in perspective; where the caller stops; those of whatever draws.
    fn particles(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Gray8>;

    /// The noise-free optical depth of all particles.
    fn particles_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane>;

    /// The optical depth of the model.
    ///
    /// # Errors
    /// For a view out of range; those of whatever draws.
    fn model_depth(&self, view: &View, size: Size) -> Result<Plane>;
}
