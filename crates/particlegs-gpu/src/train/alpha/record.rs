//! Adam's numbers of a step, as step.wgsl has them.

use particlegs_core::model::VizRanges;
use particlegs_core::render::alpha::Eye;
use particlegs_core::render::alpha::network::Setting;
use particlegs_train::Averages;
use particlegs_train::alpha::{Gaussians, StepSize};

/// Decays of Adam's means (3DGS and PyTorch).
const BETA: [f32; 2] = [0.9, 0.999];

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct AlphaStepRecord {
    rate: [f32; 4],
    unroot: [f32; 4],
    rate_more: [f32; 2],
    unroot_more: [f32; 2],
    beta: [f32; 2],
    half: [f32; 2],
    wanted: [f32; 2],
    shares: [f32; 2],
    floor: f32,
    hold: f32,
    clip: f32,
    count: u32,
}

impl AlphaStepRecord {
    /// Of the next step of these Gaussians.
    pub fn new(gaussians: &Gaussians, eye: &Eye, setting: Setting, size: &StepSize) -> AlphaStepRecord {
        let [position, scale, rotation, opacity, feature] = &gaussians.averages;
        let corrected = |averages: &Averages, rate: f64| {
            let steps = (averages.steps + 1).min(i32::MAX as u64) as i32;
            let [first, second] = BETA.map(|beta| 1.0 - f64::from(beta).powi(steps));
            [(rate / first) as f32, (1.0 / second) as f32]
        };
        let r = size.rates;
        let pairs = [position, scale, rotation, opacity].into_iter().zip(r).map(|(a, rate)| corrected(a, rate));
        let corrections: Vec<[f32; 2]> = pairs.collect();
        let more = [corrected(feature, r[4]), corrected(&gaussians.mapper_averages, size.network)];
        let ranges = gaussians.mapper.as_ref().map_or(VizRanges::TRAINING, |m| m.ranges);
        AlphaStepRecord {
            rate: std::array::from_fn(|k| corrections[k][0]),
            unroot: std::array::from_fn(|k| corrections[k][1]),
            rate_more: more.map(|m| m[0]),
            unroot_more: more.map(|m| m[1]),
            beta: BETA,
            half: eye.half.map(|v| v as f32),
            wanted: [setting.radius, setting.opacity].map(|v| v as f32),
            shares: [ranges.scale, ranges.opacity].map(|v| v as f32),
            floor: ranges.floor as f32,
            hold: (2.0 * size.identity / gaussians.parameters.len().max(1) as f64) as f32,
            clip: size.clip as f32,
            count: gaussians.parameters.len() as u32,
        }
    }
}
