//! From views to files: what `render` and `reference` have in common.

pub mod colours;
pub mod film;
pub mod finish;
pub mod frames;
mod gif;
pub mod layers;
pub mod panels;
pub mod provenance;
pub mod run;

use particlegs::Result;
use particlegs::camera::View;
use particlegs::picture::{Gray8, Plane, Size};

/// What is seen in a view, before it has its colours.
pub enum Seen {
    /// Grey levels.
    Levels(Gray8),
    /// Grey levels of everything, and the mixed colour of the layers at each pixel.
    Layers(Gray8, Vec<[u8; 3]>),
    /// Surface density.
    Density(Plane),
}

/// Something that can be drawn.
pub trait Painter: Sync {
    /// Draws a view.
    fn draw(&self, view: &View, size: Size) -> Result<Seen>;

    /// May several views be drawn side by side?
    fn side_by_side(&self) -> bool;
}
