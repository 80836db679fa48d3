//! A block's header: what its stream is decoded with (docs/format.md, section 4), and the precision of its numbers.

use super::exact::exp_twice;
use super::predictor::{Predictor, SIZE_SLOPES};
use super::tree::TreeCell;
use super::wire::WireReader;
use crate::math::{Sym3, each_axis, exp};
use crate::space::Bounds;

/// Stages of a block's streams at most.
pub(crate) const MOST_STAGES: usize = 8;

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct BlockHeader {
    pub bounds: Bounds,
    pub count: u64,
    pub mass: f64,
    pub gaussians: u32,
    pub weighted: bool,
    /// Whether it is of the alpha-blend law: opacities for counts, grey levels for masses.
    pub shaded: bool,
    /// Plain low bits of the residuals of size, count, mass and shape.
    pub low: [u8; 4],
    /// Steps of position, size, count, shape and mass.
    pub steps: [f32; 5],
    /// Power by which the step falls with count / size, and ln (count / size) where its factor is 1.
    pub importance: f32,
    pub centre: f32,
    pub size: Predictor,
    /// Surplus of several Gaussians over one beside them, as log counts in whole steps.
    pub surplus: i16,
    /// Mean spreads of what is left of sizes and of differences of log counts in steps, and of shape numbers in half
    /// steps of a middling Gaussian.
    pub spreads: [f32; 3],
    /// Levels after which a stage of the streams ends; the last stage goes to the end.
    pub cuts: Vec<u8>,
}

/// Bytes of a header without cuts.
const LEAST_BYTES: usize = 48 + 8 + 8 + 4 + 1 + 4 + 20 + 8 + (4 + 2 * SIZE_SLOPES) + 2 + 12 + 1;
/// Gaussians that a byte of a block may stand for.
pub(crate) const GAUSSIANS_A_BYTE: u64 = 4;
/// Bit of the flags: masses are coded.
const WEIGHTED: u8 = 1;
/// Bit of the flags: opacities and grey levels are coded.
const SHADED: u8 = 2;
/// Counts stay whole in f64.
pub(crate) const MOST_PARTICLES: u64 = 1 << 53;
/// Shape numbers at most.
const LARGEST_SHAPE: f64 = 32.0;
/// The step factor lies in 1/8 to 8.
const WIDEST: f64 = 8.0;

impl BlockHeader {
    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        for v in self.bounds.min.iter().chain(&self.bounds.max) {
            out.extend(v.to_le_bytes());
        }
        out.extend(self.count.to_le_bytes());
        out.extend(self.mass.to_le_bytes());
        out.extend(self.gaussians.to_le_bytes());
        out.push((u8::from(self.weighted) * WEIGHTED) | (u8::from(self.shaded) * SHADED));
        out.extend(self.low);
        for v in self.steps.iter().chain([&self.importance, &self.centre]) {
            out.extend(v.to_le_bytes());
        }
        out.extend(self.size.constant.to_le_bytes());
        self.size.slopes.iter().chain([&self.surplus]).for_each(|s| out.extend(s.to_le_bytes()));
        self.spreads.iter().for_each(|s| out.extend(s.to_le_bytes()));
        out.push(self.cuts.len() as u8);
        out.extend(&self.cuts);
    }

    pub(crate) fn bytes(&self) -> usize {
        LEAST_BYTES + self.cuts.len()
    }

    /// Reads and checks a header; the text says what is wrong.
    pub(crate) fn read(block: &[u8]) -> Result<BlockHeader, String> {
        let mut r = WireReader::new(block);
        let min = [r.f64()?, r.f64()?, r.f64()?];
        let max = [r.f64()?, r.f64()?, r.f64()?];
        let (count, mass, gaussians) = (r.u64()?, r.f64()?, r.u32()?);
        let flags = r.u8()?;
        let low = [r.u8()?, r.u8()?, r.u8()?, r.u8()?];
        let steps = [r.f32()?, r.f32()?, r.f32()?, r.f32()?, r.f32()?];
        let (importance, centre) = (r.f32()?, r.f32()?);
        let constant = r.u32()? as i32;
        let [a, b, d, surplus] = [r.u16()?, r.u16()?, r.u16()?, r.u16()?].map(|s| s as i16);
        let spreads = [r.f32()?, r.f32()?, r.f32()?];
        let cuts = r.u8()?;
        let cuts = r.take(usize::from(cuts))?.to_vec();
        let header = BlockHeader {
            bounds: Bounds { min, max },
            count,
            mass,
            gaussians,
            weighted: flags & WEIGHTED != 0,
            shaded: flags & SHADED != 0,
            low,
            steps,
            importance,
            centre,
            size: Predictor { constant, slopes: [a, b, d] },
            surplus,
            spreads,
            cuts,
        };
        // A block cannot have both masses and grey levels.
        if flags > SHADED {
            return Err(format!("block flags {flags:#04x} are reserved"));
        }
        header.check()?;
        Ok(header)
    }

    /// Checks that a whole block of `bytes` bytes is large enough to justify memory for its Gaussians.
    pub(crate) fn check_length(&self, bytes: u64) -> Result<(), String> {
        match u64::from(self.gaussians) <= bytes * GAUSSIANS_A_BYTE {
            true => Ok(()),
            false => Err(format!("{} Gaussians in a block of {bytes} bytes", self.gaussians)),
        }
    }

    fn check(&self) -> Result<(), String> {
        let b = &self.bounds;
        let ordered = (0..3).all(|k| b.min[k].is_finite() && b.max[k].is_finite() && b.min[k] <= b.max[k]);
        let faults = [
            (!ordered || !b.extent().iter().all(|e| e.is_finite()), "block bounds are not ordered and finite".into()),
            (self.count == 0 || self.count > MOST_PARTICLES, format!("a block has {} particles", self.count)),
            (!(self.mass > 0.0 && self.mass.is_finite()), format!("a block has mass {}", self.mass)),
            (self.gaussians == 0, "a block has no Gaussians".into()),
            (self.low.iter().any(|&l| l > 15), "more than 15 low bits are stored plain".into()),
            (
                !self.steps.iter().all(|&s| (1e-6..=16.0).contains(&s)),
                format!("quantisation steps {:?} are outside 1e-6 to 16", self.steps),
            ),
            (
                !((0.0..=4.0).contains(&self.importance) && self.centre.abs() <= 1e6),
                "the step factor is out of range".into(),
            ),
            (!self.spreads.iter().all(|v| (0.0..=1e6).contains(v)), "spreads are out of range".into()),
            (
                self.cuts.len() >= MOST_STAGES || self.cuts.windows(2).any(|w| w[0] >= w[1]),
                "stages are out of order or too many".into(),
            ),
        ];
        faults.into_iter().find(|fault| fault.0).map_or(Ok(()), |fault| Err(fault.1))
    }

    #[inline]
    pub(crate) fn log_size(&self, t: i32) -> f64 {
        0.5 * f64::from(self.steps[1]) * f64::from(t)
    }

    #[inline]
    pub(crate) fn radius(&self, t: i32) -> f64 {
        exp(self.log_size(t))
    }

    /// ln of the count; of a shaded block ln of the depth at the peak, `-ln(1 - opacity)`.
    #[inline]
    pub(crate) fn log_count(&self, m: i32) -> f64 {
        0.5 * f64::from(self.steps[2]) * f64::from(m)
    }

    /// Whether a number is coded for each Gaussian beside its count: its mass, or its grey level.
    #[inline(always)]
    pub(crate) fn has_w(&self) -> bool {
        self.weighted || self.shaded
    }

    /// ln of the mass a particle, relative to the block's mean; of a shaded block ln of the grey
    /// level.
    #[inline]
    pub(crate) fn log_weight(&self, w: i32) -> f64 {
        0.5 * f64::from(self.steps[4]) * f64::from(w)
    }

    /// The factor on the steps of shape and position: finer where much mass is in little room, in
    /// shaded blocks where much opacity is on much room.
    #[inline]
    pub(crate) fn step_factor(&self, t: i32, m: i32) -> f64 {
        limited(self.size_power(t) * self.count_power(m))
    }

    #[inline]
    pub(crate) fn size_power(&self, t: i32) -> f64 {
        let b = f64::from(self.importance);
        exp(if self.shaded { -b } else { b } * self.log_size(t))
    }

    /// The centre at which [`Self::step_factor`] of one Gaussian is 1; the block's centre is the mean.
    pub(crate) fn log_importance(&self, t: i32, m: i32) -> f64 {
        let size = self.log_size(t);
        self.log_count(m) - if self.shaded { -size } else { size }
    }

    #[inline]
    pub(crate) fn count_power(&self, m: i32) -> f64 {
        exp(f64::from(self.importance) * (f64::from(self.centre) - self.log_count(m)))
    }

    /// Half a step of shape numbers: at most 1, so that the coarsest steps leave Gaussians.
    #[inline(always)]
    pub(crate) fn shape_half_step(&self, factor: f64) -> f64 {
        (0.5 * f64::from(self.steps[3]) * factor).min(1.0)
    }

    /// exp(2 S) of shape numbers whose steps have a factor: the covariance of radius 1; `None` where it is out of range.
    #[inline(always)]
    pub(crate) fn unit_covariance(&self, shape: [i32; 5], factor: f64) -> Option<Sym3> {
        let step = self.shape_half_step(factor);
        let five = shape.map(|s| f64::from(s) * step);
        if five.iter().any(|s| s.abs() > LARGEST_SHAPE) {
            return None;
        }
        // Far from round, rounding alone decides the least variance: what comes out negative is no Gaussian.
        let unit = exp_twice(five);
        (unit.0.iter().all(|v| v.is_finite()) && [0, 3, 5].iter().all(|&k| unit.0[k] >= 0.0)).then_some(unit)
    }

    /// Levels of a cell's axes: its width in steps, rounded, at least 1. `widths` of a Gaussian of radius 1: what its
    /// covariance leaves to each axis where the earlier ones are known.
    #[inline(always)]
    pub(crate) fn levels(&self, cell: &TreeCell, extent: [f64; 3], step: f64, widths: [f64; 3]) -> [u64; 3] {
        let cell = cell.widths(extent);
        // The cast rounds down and takes what is too large to 2^64 - 1, the limit to 2^40.
        each_axis(|k| ((cell[k] / (step * widths[k]) + 0.5) as u64).clamp(1, 1 << 40))
    }

    #[inline(always)]
    pub(crate) fn place_step(&self, radius: f64, factor: f64) -> f64 {
        f64::from(self.steps[0]) * factor * radius
    }

    /// Predicted log size in whole steps of a Gaussian at `level`, from its log count and that of the node above it.
    #[inline(always)]
    pub(crate) fn predict_size(&self, level: i32, count: i32, above: i32) -> i32 {
        self.size.apply([level, count, above])
    }
}

/// The step factor within its bounds.
#[inline(always)]
pub(crate) fn limited(factor: f64) -> f64 {
    factor.clamp(1.0 / WIDEST, WIDEST)
}

/// Square roots of what a covariance leaves to each axis where the earlier ones are known, the diagonal of its Cholesky
/// factor, and the rest of the factor: (1, 0), (2, 0), (2, 1).
#[inline(always)]
pub(crate) fn cholesky(unit: &Sym3) -> ([f64; 3], [f64; 3]) {
    const NARROWEST: f64 = 1.0 / 1024.0;
    let root = |v: f64| v.max(NARROWEST * NARROWEST).sqrt();
    let [xx, xy, xz, yy, yz, zz] = unit.0;
    let a = root(xx);
    let (ba, ca) = (xy / a, xz / a);
    let b = root(yy - ba * ba);
    let cb = (yz - ca * ba) / b;
    ([a, b, root(zz - ca * ca - cb * cb)], [ba, ca, cb])
}

/// Quantisation steps; rate control scales them together ([`Precision::scaled`]).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Precision {
    /// Edge of a position's cell, in geometric mean radii of the Gaussian.
    pub position: f64,
    /// Step of ln of the geometric mean radius.
    pub size: f64,
    /// Step of the five shape numbers (coordinates of half the trace-free matrix logarithm).
    pub shape: f64,
    /// Step of ln count; in models of the alpha-blend law of ln(-ln(1 - opacity)).
    pub count: f64,
    /// Step of ln (mass / count), where particles have weights; of ln grey in the alpha-blend law.
    pub mass: f64,
    /// Power by which the steps of position and shape fall with count / radius: a Gaussian's step is
    /// the above times (count / radius)^-importance, 1 for a middling Gaussian; in the alpha-blend
    /// law times (depth radius)^-importance.
    pub importance: f64,
}

impl Precision {
    /// The balance of the steps that loses least at a given size (docs/format.md, section 11).
    pub const BALANCED: Precision =
        Precision { position: 0.5, size: 0.22, shape: 0.5, count: 0.22, mass: 0.22, importance: 0.45 };

    /// Multiples of these steps that are of use: from the finest to the coarsest. Steps of a quarter of the
    /// finest gain less than 0.01 dB and 0.001 bits a held-out particle.
    pub const FACTORS: [f64; 2] = [1.0 / 8.0, 32.0];

    /// Doublings of all steps that save about so many bytes: each takes a bit off each of a Gaussian's
    /// ten numbers.
    pub fn doublings(bytes: f64, gaussians: usize) -> f64 {
        8.0 * bytes / (10.0 * gaussians as f64)
    }

    /// All steps times `q`.
    pub fn scaled(self, q: f64) -> Precision {
        Precision {
            position: self.position * q,
            size: self.size * q,
            shape: self.shape * q,
            count: self.count * q,
            mass: self.mass * q,
            importance: self.importance,
        }
    }

    /// The steps as a block holds them: f32 within 1e-6 to 16.
    pub(crate) fn steps(&self) -> [f32; 5] {
        [self.position, self.size, self.count, self.shape, self.mass].map(|s| (s as f32).clamp(1e-6, 16.0))
    }

    /// From a block's steps (position, size, count, shape, mass).
    pub(crate) fn from_header(s: [f32; 5], importance: f32) -> Precision {
        let [position, size, count, shape, mass] = s.map(f64::from);
        Precision { position, size, shape, count, mass, importance: f64::from(importance) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::exact::exp_twice;
    use super::*;
    use crate::math::Random;

    /// Shape numbers within their range, of Gaussians so far from round that rounding decides.
    #[test]
    fn variances_below_zero_are_refused() {
        let header = BlockHeader { steps: [0.5, 0.22, 0.22, 2.0, 0.22], ..BlockHeader::default() };
        let mut negative = 0;
        for i in 0..2000 {
            let mut r = Random::new(1, 1, i);
            let shape = [0; 5].map(|_| (r.uniform() * 41.0).floor() as i32 - 20);
            let raw = exp_twice(shape.map(f64::from));
            let below = [raw.0[0], raw.0[3], raw.0[5]].iter().any(|v| *v < 0.0);
            assert!(!(below && header.unit_covariance(shape, 1.0).is_some()), "{shape:?}");
            negative += usize::from(below && raw.0.iter().all(|v| v.is_finite()));
        }
        assert!(negative > 0);
    }
}
