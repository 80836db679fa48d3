//! A rendered view without colours.

use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size};

/// The content of a view.
pub enum ViewContent {
    /// Grey levels.
    Levels(Gray8),
    /// Grey levels of everything, and the mixed colour of the layers per pixel.
    Layers(Gray8, Vec<[u8; 3]>),
    /// Surface density.
    Density(Plane),
    /// Values of a field, not numbers where there is no mass; and what shades them, if anything does.
    Field(Plane<f64>, Option<Plane>),
}

/// A picture with a lower mean grey level is dark.
const DARK: f64 = 10.0;

impl ViewContent {
    /// The mean grey level of a dark picture.
    pub fn dark(&self) -> Option<f64> {
        let ViewContent::Levels(grey) = self else { return None };
        let sum: f64 = grey.data.iter().map(|v| f64::from(*v)).sum();
        Some(sum / grey.data.len() as f64).filter(|mean| *mean < DARK)
    }

    /// Warns if a density is empty.
    pub fn say_if_empty(&self, view: &View, context: &Context<'_>) {
        let empty = match self {
            ViewContent::Density(plane) => plane.data.iter().all(|v| *v == 0.0),
            ViewContent::Field(plane, _) => plane.data.iter().all(|v| v.is_nan()),
            _ => false,
        };
        if empty {
            let name = &view.name;
            context.warn(&format!(
                "view `{name}` is empty: no particle lies in its window; move its centre, or make it wider and deeper"
            ));
        }
    }
}

/// Something that can be drawn.
pub struct ViewRenderer<'a> {
    /// Draws a view.
    pub draw: Box<dyn Fn(&View, Size) -> Result<ViewContent> + Sync + 'a>,
    /// Whether several views can be drawn in parallel.
    pub side_by_side: bool,
}
