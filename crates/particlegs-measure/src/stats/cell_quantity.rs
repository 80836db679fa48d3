//! Quantities that Gaussians carry into the cells of a grid.

use particlegs_core::math::Sym3;

/// A quantity that goes with the mass of a Gaussian into cells: nothing, or a field.
pub(crate) trait CellQuantity {
    /// The sum in a cell.
    type Sum: Copy + Default + Send;
    /// Boxes that half a resolved Gaussian may fill along an axis.
    const WIDEST: f64;
    /// As it is where the Gaussian's covariance is widened to one of this inverse, which counts lengths in `side`.
    fn widened(&self, inverse: &Sym3, side: [f64; 3]) -> Self;
    /// As a round part of the Gaussian has it, `from_mean` from the mean and of this deviation.
    fn part(&self, from_mean: [f64; 3], deviation: f64) -> Self;
    fn add(&self, sum: &mut Self::Sum, mass: f64, from_mean: [f64; 3]);
}

impl CellQuantity for () {
    type Sum = f64;
    const WIDEST: f64 = 1.0;

    fn widened(&self, _: &Sym3, _: [f64; 3]) {}

    fn part(&self, _: [f64; 3], _: f64) {}

    #[inline(always)]
    fn add(&self, sum: &mut f64, mass: f64, _: [f64; 3]) {
        *sum += mass;
    }
}
