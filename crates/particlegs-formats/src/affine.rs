//! Positions moved to world units: scaled, turned, shifted.

use crate::pieces::{ParticlePiece, RowBuffer};
use particlegs_core::Result;
use std::ops::Range;

/// `matrix * p + shift`, rows of the matrix first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Row i gives component i.
    pub matrix: [[f64; 3]; 3],
    pub shift: [f64; 3],
}

impl Affine {
    /// Changes nothing.
    pub const IDENTITY: Affine =
        Affine { matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: [0.0; 3] };

    pub fn scale(by: f64) -> Affine {
        let mut out = Affine::IDENTITY;
        (0..3).for_each(|k| out.matrix[k][k] = by);
        out
    }

    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| {
            let row = self.matrix[i];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + self.shift[i]
        })
    }

    /// A piece moved by it; `wide`: moved positions have more digits than f32.
    pub fn moved(self, wide: bool, inner: Box<dyn ParticlePiece>) -> Box<dyn ParticlePiece> {
        match self == Affine::IDENTITY {
            true => inner,
            false => Box::new(AffinePiece { inner, by: self, wide }),
        }
    }

    /// First `inner`, then this.
    pub fn after(&self, inner: &Affine) -> Affine {
        let column = |j: usize| [0, 1, 2].map(|k| inner.matrix[k][j]);
        let turn = Affine { shift: [0.0; 3], ..*self };
        let columns = [0, 1, 2].map(|j| turn.apply(column(j)));
        Affine { matrix: [0, 1, 2].map(|i| [0, 1, 2].map(|j| columns[j][i])), shift: self.apply(inner.shift) }
    }

    pub fn apply_rows(&self, rows: &mut RowBuffer, start: usize) {
        if *self == Affine::IDENTITY {
            return;
        }
        let [x, y, z] = &mut rows.position;
        for ((x, y), z) in x.iter_mut().zip(y).zip(z).skip(start) {
            [*x, *y, *z] = self.apply([*x, *y, *z]);
        }
    }
}

struct AffinePiece {
    inner: Box<dyn ParticlePiece>,
    by: Affine,
    wide: bool,
}

impl ParticlePiece for AffinePiece {
    fn rows(&self) -> u64 {
        self.inner.rows()
    }

    fn is_wide(&self) -> bool {
        self.wide
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        let start = out.position[0].len();
        self.inner.read(rows, out)?;
        self.by.apply_rows(out, start);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_after_the_other_is_their_product() {
        let a = Affine { matrix: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]], shift: [1.0, 2.0, 3.0] };
        let b = Affine { matrix: [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]], shift: [-1.0, 0.5, 0.0] };
        let p = [0.25, -3.0, 7.0];
        assert_eq!(a.after(&b).apply(p), a.apply(b.apply(p)));
    }
}
