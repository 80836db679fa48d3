//! A simulation cell.

use crate::math::each_axis;

/// A simulation cell: three row vectors and whether each repeats.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cell {
    /// Its lowest corner, world units.
    #[serde(default)]
    pub origin: [f64; 3],
    /// Row k is the k-th cell vector, world units.
    pub vectors: [[f64; 3]; 3],
    /// Periodicity along each cell vector.
    pub periodic: [bool; 3],
}

impl Cell {
    /// A periodic orthogonal box with its corner at 0.
    pub fn orthogonal(lengths: [f64; 3]) -> Self {
        let mut vectors = [[0.0; 3]; 3];
        for k in 0..3 {
            vectors[k][k] = lengths[k];
        }
        Cell { origin: [0.0; 3], vectors, periodic: [true; 3] }
    }

    /// With lengths multiplied by `by`.
    pub fn scaled(&self, by: f64) -> Self {
        let scaled = |v: [f64; 3]| v.map(|v| v * by);
        Cell { origin: scaled(self.origin), vectors: self.vectors.map(scaled), periodic: self.periodic }
    }

    /// The matrix that turns a world vector d into fractions of the cell vectors: fraction a is the
    /// sum of `d[k] * inverse[k][a]`. `None` for a cell without volume.
    pub fn inverse(&self) -> Option<[[f64; 3]; 3]> {
        let v = &self.vectors;
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let rows = [cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1])];
        let volume: f64 = (0..3).map(|k| v[0][k] * rows[0][k]).sum();
        let inverse: [[f64; 3]; 3] = each_axis(|k| each_axis(|a| rows[a][k] / volume));
        inverse.iter().flatten().all(|x| x.is_finite()).then_some(inverse)
    }

    /// For people: `25 x 25 x 25, periodic in xyz`, with the corner where it is not at 0.
    pub fn in_words(&self) -> String {
        let point = |p: [f64; 3]| format!("({}, {}, {})", p[0], p[1], p[2]);
        let axes: String = ["x", "y", "z"].iter().zip(self.periodic).filter(|a| a.1).map(|a| *a.0).collect();
        let periodic = if axes.is_empty() { "not periodic".into() } else { format!("periodic in {axes}") };
        let shape = match self.lengths() {
            Some([x, y, z]) => format!("{x} x {y} x {z}"),
            None => format!("vectors {}", self.vectors.map(point).join(", ")),
        };
        let corner = if self.origin == [0.0; 3] { String::new() } else { format!(", corner {}", point(self.origin)) };
        format!("{shape}{corner}, {periodic}")
    }

    /// Edge lengths where the cell is orthogonal and axis-aligned.
    pub fn lengths(&self) -> Option<[f64; 3]> {
        let v = &self.vectors;
        let off = (0..3).any(|i| (0..3).any(|j| i != j && v[i][j] != 0.0));
        (!off).then(|| each_axis(|k| v[k][k]))
    }
}
