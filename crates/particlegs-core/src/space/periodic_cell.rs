//! Places of points in a cell that repeats.

use super::Cell;
use crate::math::each_axis;

/// A cell that repeats along some of its vectors, and what turns points into shares of them.
#[derive(Clone, Copy, Debug)]
pub struct PeriodicCell {
    /// The cell.
    pub cell: Cell,
    inverse: [[f64; 3]; 3],
}

impl PeriodicCell {
    /// `None` for a cell without volume, and for one that does not repeat.
    pub fn new(cell: Cell) -> Option<PeriodicCell> {
        let inverse = cell.inverse().filter(|_| cell.periodic.contains(&true))?;
        Some(PeriodicCell { cell, inverse })
    }

    /// The point at `d` from the cell's corner, in lengths of the vectors; 0 along those that do not repeat.
    pub(crate) fn fractions(&self, d: [f64; 3]) -> [f64; 3] {
        let fraction = |a: usize| (0..3).map(|k| d[k] * self.inverse[k][a]).sum();
        each_axis(|a| if self.cell.periodic[a] { fraction(a) } else { 0.0 })
    }

    /// The vector that so many of each of the cell's vectors make together.
    pub(crate) fn vector(&self, numbers: [f64; 3]) -> [f64; 3] {
        each_axis(|k| (0..3).map(|a| numbers[a] * self.cell.vectors[a][k]).sum())
    }

    /// By how many lengths of the cell the point at `d` from its corner lies outside it; 0 within.
    pub fn beyond(&self, d: [f64; 3]) -> f64 {
        self.fractions(d).iter().fold(0.0, |most, f| (-f).max(f - 1.0).max(most))
    }

    /// The vector from the cell's corner to a point.
    pub fn offset(&self, p: [f64; 3]) -> [f64; 3] {
        each_axis(|k| p[k] - self.cell.origin[k])
    }

    /// The image of the point `p` in the cell; what lies on its faces stays there.
    pub fn image(&self, p: [f64; 3]) -> [f64; 3] {
        let inside = |f: f64| (0.0..=1.0).contains(&f);
        let whole = self.fractions(self.offset(p)).map(|f| if inside(f) { 0.0 } else { f.floor() });
        let shift = self.vector(whole);
        each_axis(|k| p[k] - shift[k])
    }

    /// Centres of the images of a sphere that reach into the cell, at most one cell away; first the sphere itself.
    pub fn images_of_sphere(&self, center: [f64; 3], radius: f64) -> Vec<[f64; 3]> {
        let reach: [f64; 3] =
            each_axis(|a| radius * (0..3).map(|k| self.inverse[k][a] * self.inverse[k][a]).sum::<f64>().sqrt());
        let shifts = self.cell.shifts(self.cell.periodic.map(|p| [-i64::from(p), i64::from(p)]));
        let images = shifts.into_iter().filter(|s| *s != [0.0; 3]).map(|s| each_axis(|k| center[k] + s[k]));
        let reaches = |p: &[f64; 3]| {
            let f = self.fractions(self.offset(*p));
            (0..3).all(|a| !self.cell.periodic[a] || (-reach[a]..=1.0 + reach[a]).contains(&f[a]))
        };
        std::iter::once(center).chain(images.filter(reaches)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_lie_in_the_cell() {
        let vectors = [[2.0, 0.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, 3.0]];
        let cell = Cell { origin: [1.0; 3], vectors, periodic: [true, true, false] };
        let periodic = PeriodicCell::new(cell).unwrap();
        let beyond = |p| periodic.beyond(periodic.offset(p));
        // One and a half of the first, three of the second, and wherever along the third.
        let p = [1.0 + 3.0 + 3.0, 1.0 + 12.0, 90.0];
        assert_eq!((beyond(p), beyond([2.0, 2.0, -5.0])), (2.0, 0.0));
        let image = periodic.image(p);
        assert_eq!((beyond(image), image[2]), (0.0, 90.0));
        assert!(PeriodicCell::new(Cell { periodic: [false; 3], ..cell }).is_none());
    }

    #[test]
    fn spheres_over_a_face_have_an_image_at_the_other() {
        let periodic =
            PeriodicCell::new(Cell { periodic: [true, true, false], ..Cell::orthogonal([10.0; 3]) }).unwrap();
        assert_eq!(periodic.images_of_sphere([5.0; 3], 2.0), [[5.0; 3]]);
        assert_eq!(periodic.images_of_sphere([1.0, 5.0, 0.0], 2.0), [[1.0, 5.0, 0.0], [11.0, 5.0, 0.0]]);
        let corner = periodic.images_of_sphere([9.0, 0.5, 5.0], 1.5);
        assert_eq!(corner[1..], [[-1.0, 0.5, 5.0], [-1.0, 10.5, 5.0], [9.0, 10.5, 5.0]]);
    }
}
