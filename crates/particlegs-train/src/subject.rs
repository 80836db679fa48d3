//! What a run learns from.

use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::progress::Progress;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use std::ops::Range;

/// The particles of a run: their pictures to learn from and to be scored on, and where they lie.
/// `particlegs::reference::Reference` is one.
pub trait TrainingSubject: Sync {
    fn len(&self) -> usize;

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn position(&self, i: usize) -> [f64; 3];

    /// What positions as they are stored are relative to, world units.
    fn origin(&self) -> [f64; 3];

    /// Positions of particles relative to the origin, as they are stored, in columns.
    fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3];

    /// Bounds of the particles, world units: they say between which distances a view without any draws.
    fn bounds(&self) -> Bounds;

    /// The picture of all particles in a look, shot noise and all.
    fn draw(&self, view: &View, size: Size, look: ToneStyle, progress: &dyn Progress) -> Result<Gray8>;

    /// The noise-free optical depth a pixel.
    fn optical_depth(&self, view: &View, size: Size, progress: &dyn Progress) -> Result<Plane>;
}
