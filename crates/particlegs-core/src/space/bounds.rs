//! Axis-aligned bounds.

use crate::math::each_axis;

/// The smallest axis-aligned box around the particles, world units.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bounds {
    /// Lowest coordinates.
    pub min: [f64; 3],
    /// Highest coordinates.
    pub max: [f64; 3],
}

impl Bounds {
    /// Bounds of nothing; [`Bounds::include`] grows them.
    pub fn empty() -> Self {
        Bounds { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] }
    }

    /// Grows to hold a point.
    pub fn include(&mut self, p: [f64; 3]) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(p[k]);
            self.max[k] = self.max[k].max(p[k]);
        }
    }

    /// The smallest bounds around both.
    pub fn union(&self, o: &Bounds) -> Bounds {
        Bounds { min: each_axis(|k| self.min[k].min(o.min[k])), max: each_axis(|k| self.max[k].max(o.max[k])) }
    }

    /// With lengths multiplied by `by`, which is positive.
    pub fn scaled(&self, by: f64) -> Bounds {
        Bounds { min: self.min.map(|v| v * by), max: self.max.map(|v| v * by) }
    }

    /// Midpoint.
    pub fn center(&self) -> [f64; 3] {
        each_axis(|k| 0.5 * self.min[k] + 0.5 * self.max[k])
    }

    /// Its corners; bit k of a corner's number says at which end of axis k it lies.
    pub fn corners(&self) -> [[f64; 3]; 8] {
        std::array::from_fn(|c| each_axis(|k| if c >> k & 1 == 0 { self.min[k] } else { self.max[k] }))
    }

    /// Edge lengths.
    pub fn extent(&self) -> [f64; 3] {
        each_axis(|k| self.max[k] - self.min[k])
    }

    /// The axis whose edge is above 0 and less than a 32nd of either other one: that across a flat box.
    pub fn thin_axis(&self) -> Option<usize> {
        let e = self.extent();
        (0..3).find(|&k| e[k] > 0.0 && 32.0 * e[k] < e[(k + 1) % 3].min(e[(k + 2) % 3]))
    }

    /// Edge lengths with an extent of zero counted as the largest, and all zero as 1.
    pub fn extent_nonzero(&self) -> [f64; 3] {
        let e = self.extent();
        let largest = e[0].max(e[1]).max(e[2]);
        let stand_in = if largest > 0.0 { largest } else { 1.0 };
        e.map(|v| if v > 0.0 { v } else { stand_in })
    }

    /// The origin of float32 positions on each axis: 0 where that keeps a thousandth of the particle radius,
    /// else the middle.
    pub fn float32_origin(&self, radius: f64) -> [f64; 3] {
        const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;
        each_axis(|k| {
            let (low, high) = (self.min[k], self.max[k]);
            if low.abs().max(high.abs()) * ROUNDING > 1e-3 * radius { 0.5 * low + 0.5 * high } else { 0.0 }
        })
    }

    /// The default particle radius, 0.0406 of the mean spacing (0.01 on HACC; docs/law/cameras.md).
    pub fn default_radius(&self, particles: u64) -> f64 {
        let e = self.extent_nonzero();
        // Cube roots first: 1e30 cubed overflows nothing in f64, 1e-30 cubed underflows nothing,
        // but products of mixed magnitudes stay safest apart.
        0.0406 * libm::cbrt(e[0]) * libm::cbrt(e[1]) * libm::cbrt(e[2]) / libm::cbrt(particles.max(1) as f64)
    }
}
