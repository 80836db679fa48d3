//! The picture that a page shows until it has drawn its own.

use crate::opening::PageOpening;
use particlegs_core::Result;
use particlegs_core::camera::{DensityView, View, base_distance, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Model};
use particlegs_core::picture::{Colormap, DensityColors, Size};
use particlegs_core::render::{Scene, draw as draw_scene, surface_density};
use particlegs_core::splat::ToneStyle;
use particlegs_files::png::png_bytes;

/// Up to this number of Gaussians the page draws as soon as a poster would be ready.
pub const MORE_THAN: usize = 100_000;
/// Above this number a server draws no poster: that would take as long as the page itself and slow it down.
pub const SERVED_UP_TO: usize = 1_000_000;
/// Size in an offline page, where every byte counts.
pub const SMALL: Size = Size { width: 640, height: 360 };
/// Size from a server: the size of a page's picture on a small screen.
pub const LARGE: Size = Size { width: 1280, height: 720 };

/// Whether a page gets a poster, which shows the default view; circles are drawn over it.
pub fn wanted(gaussians: usize, opening: &PageOpening) -> bool {
    gaussians > MORE_THAN && *opening == PageOpening { circles: opening.circles.clone(), ..PageOpening::default() }
}

#[derive(Clone, Debug)]
pub struct Poster {
    pub png: Vec<u8>,
    /// Surface densities of the first and the last colour; `None` for an alpha-blend model.
    pub range: Option<[f64; 2]>,
}

/// Draws the default view of a page: azimuth 0, elevation 0, distance 1, surface density of all layers. For the
/// alpha-blend law it has style `paraview` at the model's default radius and opacity.
pub fn draw(model: &Model, size: Size, context: &Context<'_>) -> Result<Poster> {
    let m = &model.metadata;
    let camera = spherical_camera(m.bounds.center(), 0.0, 0.0, base_distance(&m.bounds, size));
    let view = View { name: "poster".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
    let scene = Scene::new(model);
    if m.law == LawKind::AlphaBlend {
        let picture = draw_scene(&scene, &view, size, ToneStyle::Paraview, context)?;
        return Ok(Poster { png: png_bytes(size, &picture.data)?, range: None });
    }
    let plane = surface_density(&scene, &DensityView::of_view(&view, scene.bounds()), size, context)?;
    let range = plane.first_range();
    // Where every pixel is empty, any range gives the same picture.
    let colors = DensityColors::new(Colormap::default(), false, range.unwrap_or([1.0, 10.0]));
    let pixels: Vec<u8> = plane.data.iter().flat_map(|v| colors.of(*v)).collect();
    Ok(Poster { png: png_bytes(size, &pixels)?, range })
}
