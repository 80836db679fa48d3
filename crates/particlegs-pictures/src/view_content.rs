//! Rendered views, at first without colours: grey levels, densities, layers by hue, fields.

use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Colormap, DensityColors, Gray8, Plane, Rgb8, Size};
use particlegs_figure::{FigureImage, PaperColour};

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

/// Most decades of a common range, as for a single picture ([`particlegs_core::picture::Plane::log_range`]).
const DECADES: f64 = 1e-4;

/// One range for all: from the lowest to the highest, at most four decades.
pub fn common_range(ranges: impl IntoIterator<Item = Option<[f64; 2]>>) -> [f64; 2] {
    let both = ranges.into_iter().flatten().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let [lo, hi] = both.unwrap_or(Plane::EMPTY_RANGE);
    [lo.max(hi * DECADES), hi]
}

/// Colours of densities over a range, on a background.
pub fn densities(map: Colormap, ground: PaperColour, range: [f64; 2]) -> DensityColors {
    DensityColors::new(map, ground == PaperColour::White, range)
}

/// Turns a rendered view that is no field into a picture; of a field its shade.
pub fn image(content: ViewContent, map: Colormap, range: [f64; 2], ground: PaperColour) -> FigureImage {
    match content {
        ViewContent::Levels(gray) => match ground {
            PaperColour::Black => FigureImage::Gray(gray),
            PaperColour::White => FigureImage::Gray(gray).inverted(),
        },
        ViewContent::Field(plane, _) => {
            let data = plane.data.iter().map(|v| *v as f32).collect();
            image(ViewContent::Density(Plane { size: plane.size, data }), map, range, ground)
        }
        ViewContent::Density(plane) => FigureImage::Color(densities(map, ground, range).image(&plane)),
        ViewContent::Layers(gray, hues) => FigureImage::Color(Rgb8::tinted(&gray, &hues, ground == PaperColour::White)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::picture::{Gray8, Size};

    #[test]
    fn the_range_ignores_specks() {
        let size = Size { width: 100, height: 100 };
        let mut plane = Plane { size, data: (0..10_000).map(|i| 1.0 + (i % 100) as f32).collect() };
        plane.data[5] = 1e30;
        plane.data[6] = 1e-30;
        let [lo, hi] = plane.log_range().unwrap();
        assert!(lo >= 1.0 && hi <= 101.0);
        assert_eq!(Plane::zeros(size).log_range(), None);
        assert_eq!(common_range([None, Some([3.0, 5.0]), Some([2.0, 4.0])]), [2.0, 5.0]);
        assert_eq!(common_range([Some([1e-9, 1.0]), Some([0.5, 10.0])]), [1e-3, 10.0]);
        assert_eq!(common_range([None]), [1.0, 10.0]);
    }

    #[test]
    fn white_backgrounds_have_dark_ink() {
        let size = Size { width: 3, height: 1 };
        let gray = || Gray8 { size, data: vec![0, 100, 255] };
        let image_of = |content, ground| image(content, Colormap::Grey, [1.0, 100.0], ground);
        assert_eq!(image_of(ViewContent::Levels(gray()), PaperColour::White).bytes(), [255, 155, 0]);
        assert_eq!(image_of(ViewContent::Levels(gray()), PaperColour::Black).bytes(), [0, 100, 255]);
        let hues = || vec![[255, 0, 51]; 3];
        let layers = image_of(ViewContent::Layers(gray(), hues()), PaperColour::White);
        assert_eq!((layers.pixel(0, 0), layers.pixel(2, 0)), ([255; 3], [255, 0, 51]));
        assert_eq!(image_of(ViewContent::Layers(gray(), hues()), PaperColour::Black).pixel(0, 0), [0; 3]);
        let plane = || Plane { size, data: vec![0.0, 10.0, f32::NAN] };
        let [a, b, c] = [0, 1, 2].map(|x| image_of(ViewContent::Density(plane()), PaperColour::White).pixel(x, 0)[0]);
        assert!(a == 255 && (90..115).contains(&b) && c == 255, "{a} {b} {c}");
    }
}
