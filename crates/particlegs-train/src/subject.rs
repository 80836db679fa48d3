//! The particles that a run learns from.

use particlegs_core::render::Renderer;
use particlegs_core::space::Bounds;
use std::ops::Range;

/// The particles of a run: their pictures to learn from and to be scored on, and where they lie.
/// `particlegs_reference::Reference` is one.
pub trait TrainingSubject: Renderer {
    fn len(&self) -> usize;

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn position(&self, i: usize) -> [f64; 3];

    /// Origin of positions as they are stored, world units.
    fn origin(&self) -> [f64; 3];

    /// Positions of particles relative to the origin, as they are stored, in columns.
    fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3];

    /// Bounds of the particles, world units: they say between which distances a view without any draws.
    fn bounds(&self) -> Bounds;
}
