//! Pictures of a model file, by `particlegs-core` alone: [`pictures`] here and, exported from WebAssembly, there.

use particlegs_core::camera::{DensityView, View, Window, base_distance, spherical_camera};
use particlegs_core::{codec, Error, Result};
use particlegs_core::context::Context;
use particlegs_core::picture::{Pixels, Size};
use particlegs_core::render::{Scene, Scratch, draw_into, optical_depth_into, surface_density};
use particlegs_core::splat::ToneStyle;

const SIZE: Size = Size { width: 320, height: 180 };

/// Decodes a model file and draws it from outside and from within: of each view the depths as little-endian
/// f32, then the levels of every look; the surface density as f32 in the end.
///
/// # Errors
/// [`Error::Corrupt`] and others for a file that is no model.
pub fn pictures(model: &[u8], context: &Context<'_>) -> Result<Vec<u8>> {
    let model = codec::decode_with(model, "the model", context)?;
    let scene = Scene::new(&model);
    let m = &model.metadata;
    let mut scratch = Scratch::default();
    let mut out = Vec::new();
    let (mut depth, mut levels) = (vec![0f32; SIZE.pixels()], vec![0u8; SIZE.pixels()]);
    // From afar, and from among the Gaussians, with splats of several sizes.
    for (share, radius) in [(1.0, 1.0), (0.2, 0.3), (0.05, 4.0)] {
        let camera = spherical_camera(m.bounds.center(), 30.0, 20.0, share * base_distance(&m.bounds, SIZE));
        let view =
            View { name: "a test".into(), camera, radius: radius * m.default_radius, opacity: m.default_opacity };
        optical_depth_into(&scene, &view, Pixels::new(SIZE, &mut depth)?, &mut scratch, context)?;
        out.extend(depth.iter().flat_map(|v| v.to_le_bytes()));
        for look in ToneStyle::ALL {
            draw_into(&scene, &view, look, Pixels::new(SIZE, &mut levels)?, &mut scratch, context)?;
            out.extend_from_slice(&levels);
        }
    }
    let e = m.bounds.extent();
    let width = e[0].max(e[1]).max(e[2]);
    let window = Window { center: m.bounds.center(), angles_deg: [30.0, 20.0], width, depth: None };
    let window = DensityView::orthographic("a test", &window, SIZE, &m.bounds, None)?;
    let density = surface_density(&scene, &window, SIZE, context)?;
    out.extend(density.data.iter().flat_map(|v| v.to_le_bytes()));
    if depth.iter().all(|v| *v == 0.0) || density.data.iter().all(|v| *v == 0.0) {
        return Err(Error::argument("nothing was drawn"));
    }
    Ok(out)
}

#[cfg(target_arch = "wasm32")]
mod exported {
    //! Memory is handed over by address and length; what a caller gets stays until the instance ends.

    use particlegs_core::context::Context;

    /// Room for `length` bytes.
    #[unsafe(no_mangle)]
    pub extern "C" fn room(length: usize) -> *mut u8 {
        Vec::leak(vec![0; length]).as_mut_ptr()
    }

    /// The pictures of the model at `model`: 1 and what [`super::pictures`] gives, or 0 and an error's text.
    /// The address in the low 32 bits, the length in the others.
    ///
    /// # Safety
    /// `model` comes from [`room`], with its length.
    #[unsafe(no_mangle)]
    pub unsafe extern "C" fn pictures(model: *const u8, length: usize) -> u64 {
        // SAFETY: the caller's promise.
        let model = unsafe { std::slice::from_raw_parts(model, length) };
        let (good, bytes) = match super::pictures(model, &Context::SILENT) {
            Ok(bytes) => (1, bytes),
            Err(error) => (0, error.to_string().into_bytes()),
        };
        let all = Vec::leak([&[good], &bytes[..]].concat());
        (all.len() as u64) << 32 | all.as_ptr() as u64
    }
}
