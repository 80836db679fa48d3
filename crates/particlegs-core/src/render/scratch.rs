//! Buffers kept from one picture to the next: fresh memory costs more than drawing a small scene.

use crate::Result;
use crate::context::Context;
use crate::memory::reserved;
use crate::render::tone::{LazyResponse, Tones};
use std::sync::Arc;

/// Working memory of the renderer, some 5.4 bytes a pixel of the largest picture drawn with it. Its
/// contents do not matter: any picture may follow any other.
#[derive(Debug, Default)]
pub struct Scratch {
    /// The planes of a picture, finest first.
    planes: Vec<Vec<f32>>,
    /// That of the last picture: its opacity is mostly that of the next.
    response: Option<Arc<LazyResponse>>,
}

impl Scratch {
    /// The tone curves of an opacity and a splat radius in pixels.
    pub(super) fn tones(&mut self, opacity: f64, radius_px: f64) -> Tones {
        let response = LazyResponse::new(opacity, self.response.as_ref());
        self.response = Some(response.clone());
        Tones::with_response(response, radius_px)
    }

    /// One plane of each length, of any values.
    pub(super) fn planes(
        &mut self,
        lengths: impl ExactSizeIterator<Item = usize>,
        context: &Context<'_>,
    ) -> Result<&mut [Vec<f32>]> {
        let number = lengths.len();
        if self.planes.len() < number {
            self.planes.resize_with(number, Vec::new);
        }
        for (plane, length) in self.planes.iter_mut().zip(lengths) {
            if plane.capacity() < length {
                // The old one goes before the new one comes.
                *plane = Vec::new();
                *plane = reserved("a picture", length, context)?;
            }
            plane.resize(length, 0.0);
        }
        Ok(&mut self.planes[..number])
    }
}
