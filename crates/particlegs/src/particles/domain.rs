//! The region that particles lie in: a box, and the axes along which it repeats.

use crate::model::Model;
use crate::particles::Particles;
use crate::space::{Bounds, Cell};
use particlegs_core::math::each_axis;

/// A box, world units, and the axes along which it repeats.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Domain {
    /// Lowest corner.
    pub min: [f64; 3],
    /// Edge lengths, above zero.
    pub length: [f64; 3],
    /// Does the axis repeat?
    pub periodic: [bool; 3],
}

impl Domain {
    /// The cell along the axes where it repeats and the content fills more than half of it, else
    /// the bounds (a cut-out or a zoom lies open in its box). A tilted cell counts as open.
    pub fn new(bounds: &Bounds, cell: Option<&Cell>) -> Self {
        let extent = bounds.extent_nonzero();
        // An extent of zero is stood in for by another: keep its content in the middle.
        let mut domain =
            Domain { min: each_axis(|k| bounds.center()[k] - 0.5 * extent[k]), length: extent, periodic: [false; 3] };
        if let Some((lengths, cell)) = cell.and_then(|c| Some((c.lengths()?, c))) {
            for k in 0..3 {
                if cell.periodic[k] && lengths[k].is_finite() && lengths[k] > 0.0 && extent[k] > 0.5 * lengths[k] {
                    (domain.min[k], domain.length[k], domain.periodic[k]) = (cell.origin[k], lengths[k], true);
                }
            }
        }
        domain
    }

    /// Of a snapshot.
    pub fn of_particles(particles: &Particles) -> Self {
        Self::new(&particles.bounds(), particles.meta.cell.as_ref())
    }

    /// Of a model's snapshot.
    pub fn of_model(model: &Model) -> Self {
        Self::new(&model.metadata.bounds, model.metadata.cell.as_ref())
    }

    /// Volume.
    pub fn volume(&self) -> f64 {
        self.length[0] * self.length[1] * self.length[2]
    }

    /// Mean spacing of `n` particles, (V / n)^(1/3).
    pub fn spacing(&self, n: usize) -> f64 {
        self.length.map(f64::cbrt).iter().product::<f64>() / (n.max(1) as f64).cbrt()
    }

    /// The longest edge.
    pub fn longest(&self) -> f64 {
        self.length.iter().copied().fold(0.0, f64::max)
    }

    /// The shortest edge.
    pub fn shortest(&self) -> f64 {
        self.length.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// A position relative to the lowest corner, in [0, length) along axes that repeat.
    pub fn local(&self, p: [f64; 3]) -> [f64; 3] {
        each_axis(|k| {
            let x = p[k] - self.min[k];
            if !self.periodic[k] {
                return x;
            }
            let wrapped = x.rem_euclid(self.length[k]);
            // The remainder of a tiny negative number rounds up to the length itself.
            if wrapped < self.length[k] { wrapped } else { 0.0 }
        })
    }

    /// A difference of positions by the shortest way round.
    pub fn shortest_way(&self, d: [f64; 3]) -> [f64; 3] {
        each_axis(|k| if self.periodic[k] { d[k] - self.length[k] * (d[k] / self.length[k]).round() } else { d[k] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_repeat_and_cut_outs_do_not() {
        let full = Bounds { min: [0.01, 0.0, 4.0], max: [9.99, 4.9, 5.0] };
        let d = Domain::new(&full, Some(&Cell::orthogonal([10.0, 5.0, 10.0])));
        assert_eq!((d.periodic, d.min, d.length), ([true, true, false], [0.0, 0.0, 4.0], [10.0, 5.0, 1.0]));
        assert_eq!(d.volume(), 50.0);
        assert!((d.spacing(400) - 0.5).abs() < 1e-12);
        assert_eq!(d.local([-1.0, 5.0, 3.0]), [9.0, 0.0, -1.0]);
        assert_eq!(d.local([-1e-300, 0.0, 4.0])[0], 0.0);
        assert_eq!(d.shortest_way([9.0, -3.0, 9.0]), [-1.0, 2.0, 9.0]);
    }

    #[test]
    fn one_point_has_a_domain() {
        let d = Domain::new(&Bounds { min: [2.0; 3], max: [2.0; 3] }, None);
        assert_eq!((d.min, d.length), ([1.5; 3], [1.0; 3]));
    }
}
