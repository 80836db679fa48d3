//! Renderers of scenes and of particles.

use super::Scene;
use crate::Result;
use crate::camera::View;
use crate::context::Context;
use crate::picture::{Gray8, Plane, Size};
use crate::splat::ToneStyle;

/// Draws one thing, a scene or all particles of a snapshot, on the CPU or on a GPU.
pub trait Renderer: Sync {
    /// The picture in a look. ParaView's looks of particles have their shot noise.
    ///
    /// # Errors
    /// For a view out of range, or of particles not in perspective; where the caller stops; those of the device.
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8>;

    /// The picture without shot noise, which scenes never have.
    fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        self.draw(view, size, style, context)
    }

    /// The optical depth of each pixel, without shot noise; of an alpha-blend scene the depth that looks as bright.
    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane>;
}

impl Renderer for Scene<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        super::draw(self, view, size, style, context)
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        super::optical_depth(self, view, size, context)
    }
}
