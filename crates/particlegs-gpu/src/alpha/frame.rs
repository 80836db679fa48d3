//! The records that kernels read, as frame.wgsl has them.

use super::fixed;
use bytemuck::{Pod, Zeroable};
use particlegs_core::render::alpha::project::{LEAST_RATIO, LOW_PASS};
use particlegs_core::render::alpha::{BRIGHTEST, CutOffs, Eye, Tiles};
use particlegs_core::{Error, Hint, Result};

/// The error of a camera whose place fixed.wgsl does not hold.
const TOO_FAR: &str = "the camera is more than a million boxes away, too far for GPU arithmetic";

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct AlphaFrameRecord {
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
    to_middle: [[u32; 4]; 3],
    axes: [[u32; 4]; 9],
    center: [f32; 2],
    guard: [f32; 2],
    range: [f32; 2],
    focal: f32,
    low_pass: f32,
    least_ratio: f32,
    least_alpha: f32,
    most_alpha: f32,
    least_transmittance: f32,
    brightest: f32,
    across: u32,
    size: [u32; 2],
    count: u32,
    first: u32,
    pad: [u32; 2],
}

/// Blocks of 64 footprints, in the order of their depth, that are listed and blended together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SlabRecord {
    pub gaussians: u32,
    pub first: u32,
    pub blocks: u32,
    pub entries: u32,
    pub is_first: u32,
    pub pad: [u32; 3],
}

impl AlphaFrameRecord {
    /// Of a camera, for `count` Gaussians from `first` on.
    pub fn new(eye: &Eye, first: u32, count: u32) -> Result<AlphaFrameRecord> {
        let four = |v: [f32; 3]| [v[0], v[1], v[2], 0.0];
        let [right, down, forward] = eye.axes.map(|a| four(a.map(|v| v as f32)));
        let mut to_middle = [[0; 4]; 3];
        for (words, v) in to_middle.iter_mut().zip(eye.position) {
            // The negative: kernels add it to a Gaussian's place to get the way from the camera to it.
            let coordinate = fixed::place(-v).ok_or_else(|| Error::argument_with(TOO_FAR, Hint::use_cpu()))?;
            words[..2].copy_from_slice(&coordinate);
        }
        let mut axes = [[0; 4]; 9];
        axes.iter_mut().zip(eye.axes.as_flattened()).for_each(|(words, v)| *words = fixed::axis(*v));
        let cut = CutOffs::PUBLISHED;
        Ok(AlphaFrameRecord {
            right,
            down,
            forward,
            to_middle,
            axes,
            center: eye.center.map(|v| v as f32),
            guard: eye.guard.map(|v| v as f32),
            range: eye.range.map(at_most),
            focal: eye.focal as f32,
            low_pass: LOW_PASS as f32,
            least_ratio: LEAST_RATIO as f32,
            least_alpha: cut.least_alpha,
            most_alpha: cut.most_alpha,
            least_transmittance: cut.least_transmittance,
            brightest: BRIGHTEST,
            across: Tiles::new(eye.size).across as u32,
            size: [eye.size.width as u32, eye.size.height as u32],
            count,
            first,
            pad: [0; 2],
        })
    }
}

/// The largest finite float32 that is no larger: float32 depths lie above it where they lie above the number itself.
fn at_most(v: f64) -> f32 {
    let near = (v as f32).min(f32::MAX);
    if f64::from(near) > v { near.next_down() } else { near }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_lie_on_the_same_side_in_both_precisions() {
        assert_eq!(at_most(0.25), 0.25);
        assert!(f64::from(at_most(0.2)) < 0.2 && f64::from(at_most(0.2).next_up()) > 0.2);
        assert_eq!(at_most(f64::INFINITY), f32::MAX);
        assert_eq!(at_most(1e300), f32::MAX);
    }
}
