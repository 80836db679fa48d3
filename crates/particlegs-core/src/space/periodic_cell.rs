//! Where points lie in a cell that repeats.

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

    /// Where the point at `d` from the cell's corner lies, in lengths of the vectors; 0 along those that do not repeat.
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
}
