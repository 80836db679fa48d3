//! The picture that a page shows until its own is there.

use particlegs::camera::{View, base_distance, spherical_camera};
use particlegs::model::Model;
use particlegs::picture::{Gray8, Size};
use particlegs::progress::Progress;
use particlegs::render::{Scene, draw as draw_scene};
use particlegs::splat::Look;
use particlegs::{Error, Result};

/// Models of so many Gaussians at most are drawn by the page as soon as a poster would be there.
pub const MORE_THAN: usize = 100_000;
/// Of larger ones a server draws none: it would take as long to decode and to draw as the page, and cores from it.
pub const SERVED_UP_TO: usize = 1_000_000;
/// Size inside a page, where every byte is sent.
pub const SMALL: Size = Size { width: 640, height: 360 };
/// Size from a server: that of a page's own first picture on a small screen.
pub const LARGE: Size = Size { width: 1280, height: 720 };

/// Is a model of so many Gaussians worth a poster?
pub fn wanted(gaussians: usize) -> bool {
    gaussians > MORE_THAN
}

/// A grey PNG of the view that a page opens with: azimuth 0, elevation 0, distance 1, the model's own radius and
/// opacity, look `paraview`.
///
/// # Errors
/// [`Error::Memory`], [`Error::Cancelled`].
pub fn draw(model: &Model, size: Size, progress: &dyn Progress) -> Result<Vec<u8>> {
    let m = &model.metadata;
    let camera = spherical_camera(m.bounds.center(), 0.0, 0.0, base_distance(&m.bounds, size));
    let view = View { name: "poster".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
    png(&draw_scene(&Scene::of(model), &view, size, Look::Paraview, progress)?)
}

fn png(picture: &Gray8) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.size.width as u32, picture.size.height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder.write_header().and_then(|mut w| {
        w.write_image_data(&picture.data)?;
        w.finish()
    });
    written.map_err(|e| Error::io("the poster", e.into()))?;
    Ok(bytes)
}
