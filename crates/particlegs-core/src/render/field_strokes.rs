//! Footprints of a field on the planes that suit them, and what they add to these: a weight, and that times the value or its
//! moments, eight pixels at once.

use super::bin::{RasterSplat, place_by, suited};
use super::pixel_moments::{DepthCut, LogExcess, PixelValue, WeightFootprint};
use super::project::Footprint;
use super::raster::pyramid::{Level, SHARPEST_FIELD};
use super::raster::{Band, RowSpan, exp2, lanes};
use fearless_simd::prelude::*;
use fearless_simd::{Level as SimdLevel, f32x8};
use std::f64::consts::LOG2_E;

/// Footprints end at these many deviations, squared: 3e-7 of the mass lies beyond.
const CUT: f64 = 30.0;

/// What is summed beside the weight, in units that float32 holds.
#[derive(Clone, Copy, Debug)]
pub struct FieldTerms {
    /// The sums.
    pub kind: SumKind,
    /// The number that is subtracted from values; not from those of exponentials.
    pub reference: f64,
    /// The number by which values are multiplied.
    pub scale: f64,
    /// Whether another field weighs, so that the mass is summed as well.
    pub weighed: bool,
}

/// The sums that follow the weight's; a GPU knows them by their numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SumKind {
    /// Of weight times value.
    Value,
    /// Of weight times the exponential of a logarithm.
    Exponential,
    /// Of weight times value, and times its square.
    Square,
}

impl FieldTerms {
    /// The number of planes.
    pub fn planes(&self) -> usize {
        2 + usize::from(self.kind == SumKind::Square) + usize::from(self.weighed)
    }
}

/// A footprint with what the field is on it.
pub(super) struct FieldFootprint {
    pub footprint: Footprint,
    /// The mean at its centre less the reference, and how it changes per pixel.
    pub value: f64,
    pub tilt: [f64; 2],
    /// Variance about that.
    pub variance: f64,
    /// Of a logarithmic field.
    pub excess: Option<LogExcess>,
    /// The slab that cuts a Gaussian of an orthographic view.
    pub slab: Option<DepthCut>,
    /// Another field that weighs.
    pub by: Option<WeightFootprint>,
}

/// A footprint on its plane.
pub struct FieldStroke {
    /// The number of its plane.
    pub level: usize,
    /// What it adds there, unless another field weighs.
    pub splat: FieldSplat,
    /// Where another field weighs: the footprint in the picture's pixels, and those of a pixel here.
    weighed: Option<(Box<FieldFootprint>, f64)>,
}

/// A footprint and the field on it, in the pixels of its plane: 80 bytes, as a GPU reads them.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct FieldSplat {
    /// Where it is, and its weight.
    pub raster: RasterSplat,
    /// The value at its centre, scaled, or the binary logarithm of an exponential, and its change per pixel.
    value: f32,
    tilt: [f32; 2],
    /// Variance of values, or the least and largest binary logarithm of exponentials.
    variance: f32,
    ends: [f32; 2],
    /// 1 where a slab cuts it.
    is_cut: u32,
    slab: SlabStroke,
}

/// A slab's ends from the mean depth at a pixel, in deviations.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct SlabStroke {
    /// At the footprint's centre.
    ends: [f32; 2],
    /// Change per pixel.
    tilt: [f32; 2],
    /// The value's change over a deviation of depth.
    slope: f32,
}

impl FieldFootprint {
    /// On the plane that suits it; `None` where it does not touch the picture.
    pub fn placed(self, levels: &[Level], sums: &FieldTerms) -> Option<FieldStroke> {
        // Where an end cuts the footprint, its share falls as steeply as depth's deviation lets it.
        let per_deviation = |s: &DepthCut| s.tilt.map(|t| t / s.deviation);
        let steepness = self.slab.as_ref().map(per_deviation).map_or(0.0, |[x, y]| x * x + y * y);
        let plane = |smaller: f64| suited(levels, smaller / (1.0 + smaller * steepness), SHARPEST_FIELD);
        let placed = place_by(levels, &self.footprint, |_, smaller| (CUT, plane(smaller)))?;
        let pixels = 1.0 / placed.scale;
        let (value, unit, offset, ends) = match (sums.kind, &self.excess) {
            (SumKind::Exponential, Some(LogExcess { added, range })) => {
                // `E[q | d] = exp(q(d) + variance / 2 + c)` (docs/law/fields.md).
                let value = sums.reference + self.value + 0.5 * self.variance + added;
                (value, LOG2_E, libm::log2(sums.scale), *range)
            }
            _ => (self.value, sums.scale, 0.0, [0.0; 2]),
        };
        let slab = self.slab.as_ref().map(|s| SlabStroke {
            ends: s.range.map(|end| ((end - s.mean) / s.deviation).clamp(-INFINITE, INFINITE) as f32),
            tilt: per_deviation(s).map(|t| (-t * pixels) as f32),
            slope: (s.slope * s.deviation * if sums.kind == SumKind::Exponential { 1.0 } else { sums.scale }) as f32,
        });
        let splat = FieldSplat {
            raster: placed.stroke,
            value: (value * unit + offset) as f32,
            tilt: self.tilt.map(|t| (t * unit * pixels) as f32),
            variance: (self.variance * unit * unit) as f32,
            ends: ends.map(|end| (end * unit + offset).max(LEAST_POWER) as f32),
            is_cut: u32::from(slab.is_some()),
            slab: slab.unwrap_or_default(),
        };
        let weighed = self.by.is_some().then(|| (Box::new(self), pixels));
        Some(FieldStroke { level: placed.level, splat, weighed })
    }
}

/// Ends of a slab, in deviations, that GPUs need not know from infinity.
const INFINITE: f64 = 1e30;

/// The least power of two of an exponential.
const LEAST_POWER: f64 = -110.0;

/// Adds strokes to a band of the planes, in their order.
pub(super) fn draw<'a>(
    level: SimdLevel,
    band: &mut Band,
    strokes: impl Iterator<Item = &'a FieldStroke> + Clone,
    sums: &FieldTerms,
) {
    match sums.planes() {
        2 => fearless_simd::dispatch!(level, simd => draw_all::<_, 2>(simd, band, strokes, sums)),
        3 => fearless_simd::dispatch!(level, simd => draw_all::<_, 3>(simd, band, strokes, sums)),
        _ => fearless_simd::dispatch!(level, simd => draw_all::<_, 4>(simd, band, strokes, sums)),
    }
}

#[inline(always)]
fn draw_all<'a, S: Simd, const N: usize>(
    simd: S,
    band: &mut Band,
    strokes: impl Iterator<Item = &'a FieldStroke>,
    sums: &FieldTerms,
) {
    let lanes = lanes(simd);
    let plane = band.stride / N;
    for f in strokes {
        let s = &f.splat.raster;
        for (row, dy) in s.rows(band) {
            let Some(RowSpan { from, count, aside, fall }) = s.span(dy, band.width) else { continue };
            let pixels = &mut band.data[row * band.stride..][..band.stride];
            let mut dx = lanes + aside;
            for first in (from..from + count).step_by(8) {
                let weight = s.eight(simd, dx, fall);
                let from_center = dx + s.slope * dy;
                let terms: [f32x8<S>; N] = match &f.weighed {
                    None => f.splat.terms(simd, weight, [from_center, f32x8::splat(simd, dy)], sums),
                    Some((footprint, pixels)) => {
                        let mut terms = [f32x8::splat(simd, 0.0); N];
                        for lane in 0..8 {
                            let place = [from_center[lane], dy].map(|d| f64::from(d) * pixels);
                            let values = footprint.weighed_terms(f64::from(weight[lane]), place, sums);
                            terms.iter_mut().zip(values).for_each(|(term, value)| term[lane] = value as f32);
                        }
                        terms
                    }
                };
                for (k, term) in terms.into_iter().enumerate() {
                    let eight = &mut pixels[k * plane + first..][..8];
                    (f32x8::from_slice(simd, eight) + term).store_slice(eight);
                }
                dx += 8.0;
            }
        }
    }
}

impl FieldSplat {
    /// What eight pixels get, at `place` from the centre, that have a weight without a slab.
    #[inline(always)]
    fn terms<S: Simd, const N: usize>(
        &self,
        simd: S,
        weight: f32x8<S>,
        [x, y]: [f32x8<S>; 2],
        sums: &FieldTerms,
    ) -> [f32x8<S>; N] {
        let value = x * self.tilt[0] + (y * self.tilt[1] + self.value);
        let mut terms = [weight; N];
        if self.is_cut == 0 {
            match sums.kind {
                SumKind::Exponential => terms[1] = weight * exp2(value.max(self.ends[0]).min(self.ends[1])),
                SumKind::Value => terms[1] = weight * value,
                SumKind::Square => {
                    terms[1] = weight * value;
                    terms[2] = weight * (value * value + self.variance);
                }
            }
            return terms;
        }
        let slab = &self.slab;
        // A slab changes share, mean and variance at each pixel (docs/law/fields.md, "Along a line of sight").
        let moved = x * slab.tilt[0] + y * slab.tilt[1];
        let [share, shift, square] = slab.moments(simd, moved);
        terms[0] = weight * share;
        match sums.kind {
            SumKind::Exponential => {
                let [tilted, ..] = slab.moments(simd, moved - slab.slope);
                let [least, largest] = self.ends.map(|end| share * exp2(f32x8::splat(simd, end)));
                let mean = tilted * exp2(value.max(-120.0).min(120.0));
                terms[1] = weight * mean.max(least).min(largest);
            }
            SumKind::Value => terms[1] = weight * (value * share + shift * slab.slope),
            SumKind::Square => {
                terms[1] = weight * (value * share + shift * slab.slope);
                let moved = (value * shift) * (2.0 * slab.slope) + square * (slab.slope * slab.slope);
                terms[2] = weight * ((value * value + self.variance) * share + moved);
            }
        }
        terms
    }
}

/// Ends that are closer, in deviations, are taken by series about their middle, as differences would cancel.
const THIN: f32 = 0.1;

impl SlabStroke {
    /// A standard normal distribution between the ends, moved by so much: its mass, and the mass times the mean and times
    /// what the mean square is more than 1.
    #[inline(always)]
    fn moments<S: Simd>(&self, simd: S, moved: f32x8<S>) -> [f32x8<S>; 3] {
        let width = self.ends[1] - self.ends[0];
        if width < THIN {
            let z = (moved + (self.ends[0] + 0.5 * width)).max(-FARTHEST).min(FARTHEST);
            let (mass, curve, square) = (density(z) * width, width * width / 24.0, z * z);
            return [
                mass * ((square - 1.0) * curve + 1.0),
                mass * z * ((square - 3.0) * curve + 1.0),
                mass * ((square - 1.0) + ((square - 6.0) * square + 3.0) * curve),
            ];
        }
        let [low, high] = self.ends.map(|end| (moved + end).max(-FARTHEST).min(FARTHEST));
        let [at_low, at_high] = [density(low), density(high)];
        // The share below an end is a step from 0 to 1 and a tail, which keeps its digits.
        let zero = f32x8::splat(simd, 0.0);
        let below = |z: f32x8<S>, tail: f32x8<S>| {
            let above = z.simd_gt(zero);
            (above.select(zero + 1.0, zero), above.select(-tail, tail))
        };
        let (low_step, low_tail) = below(low, at_low * mills(low.abs()));
        let (high_step, high_tail) = below(high, at_high * mills(high.abs()));
        let share = (high_step - low_step) + (high_tail - low_tail);
        [share, at_low - at_high, low * at_low - high * at_high]
    }
}

/// Deviations beyond which nothing is left that float32 would show.
const FARTHEST: f32 = 12.0;

/// The density of a standard normal distribution.
#[inline(always)]
fn density<S: Simd>(z: f32x8<S>) -> f32x8<S> {
    const HALF_LOG2_E: f32 = 0.5 * std::f32::consts::LOG2_E;
    const PEAK: f32 = 0.398_942_3;
    exp2(z * z * -HALF_LOG2_E) * PEAK
}

/// The share of a standard normal distribution beyond z >= 0 over its density there, to 9e-7.
#[inline(always)]
fn mills<S: Simd>(z: f32x8<S>) -> f32x8<S> {
    let one = z * 0.0 + 1.0;
    let t = one / (z * 0.36 + 1.0);
    let p = t * 0.120_172_96 - 0.458_198_6;
    let p = p * t + 0.463_929_37;
    let p = p * t + 0.059_408_02;
    let p = p * t + 0.352_844_53;
    let p = p * t + 0.354_888_9;
    (p * t + 0.360_269_76) * t
}

impl FieldFootprint {
    /// What a pixel gets where another field weighs, at a place from the centre: the weight, what the sums want, the mass.
    fn weighed_terms(&self, weight: f64, place: [f64; 2], sums: &FieldTerms) -> [f64; 4] {
        let share = self.slab.as_ref().map_or(1.0, |s| s.moments(place, 0.0)[0]);
        let mass = weight * share;
        let Some(by) = self.by.as_ref().filter(|_| mass > 0.0) else { return [0.0; 4] };
        let excess = self.excess.map(|e| (sums.reference + e.added, e));
        let mean = self.value + self.tilt[0] * place[0] + self.tilt[1] * place[1];
        let q = by.at(place, PixelValue { mean, variance: self.variance, excess }, self.slab.as_ref());
        let (weight, mean) = (mass * q.weight, q.mean * sums.scale);
        match sums.kind {
            SumKind::Value => [weight, weight * mean, mass, 0.0],
            SumKind::Exponential => [weight, weight * q.value * sums.scale, mass, 0.0],
            SumKind::Square => {
                let square = mean * mean + q.variance * sums.scale * sums.scale;
                [weight, weight * mean, weight * square, mass]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the plain f64 moments, in units of the largest; also where the ends are close, far or infinite.
    #[test]
    fn moments_between_two_ends_are_the_plain_ones() {
        let infinite = f64::INFINITY;
        for ends in
            [[-1.0, 2.0], [0.5, 3.0], [-4.0, -1.5], [-infinite, 0.3], [0.2, infinite], [0.7, 0.75], [-2.0, -1.91]]
        {
            let cut = DepthCut { mean: 0.0, tilt: [0.0; 2], deviation: 1.0, range: ends, slope: 0.0 };
            let slab = SlabStroke { ends: ends.map(|e| e as f32), tilt: [0.0; 2], slope: 0.0 };
            for step in -12..=12 {
                let moved = f64::from(step) * 0.25;
                let [share, shift, change, _] = cut.moments([0.0; 2], -moved);
                let wanted = [share, share * shift, share * (change + shift * shift)];
                let moments = fearless_simd::dispatch!(SimdLevel::new(), simd => {
                    slab.moments(simd, f32x8::splat(simd, moved as f32)).map(|m| f64::from(m[0]))
                });
                let largest = wanted.iter().fold(1e-7, |l: f64, w| l.max(w.abs()));
                let worst = wanted.iter().zip(moments).map(|(w, f)| (w - f).abs() / largest).fold(0.0, f64::max);
                assert!(worst < 2e-4, "{ends:?} moved by {moved}: {wanted:?} {moments:?}");
            }
        }
    }
}
