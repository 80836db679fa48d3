//! A simulation cell, and places of points in one that repeats.

use crate::math::{cross, dot, each_axis, norm};
use std::fmt;

/// Directions that differ by no more than this share of a length are one: f32 tells no more apart.
const ALONG: f64 = 1e-7;
/// A vector of a lattice is shorter than another where this share of its square is left.
const SHORTER: f64 = 1.0 - 1e-12;
/// Steps that take a lattice to its shortest vectors, at most: each halves one of them or is among the last.
const MOST_STEPS: usize = 4096;

/// A simulation cell: three row vectors and whether each repeats.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cell {
    /// Its lowest corner, world units.
    #[serde(default)]
    pub origin: [f64; 3],
    /// Row k is the k-th cell vector, world units; zeros where the file states none, which then does not repeat.
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

    /// Its corners; bit a of a corner's number says at which end of vector a it lies.
    pub fn corners(&self) -> [[f64; 3]; 8] {
        let bit = |c: usize, a: usize| (c >> a & 1) as f64;
        std::array::from_fn(|c| {
            each_axis(|k| self.origin[k] + (0..3).map(|a| bit(c, a) * self.vectors[a][k]).sum::<f64>())
        })
    }

    /// Sums of whole multiples of its vectors, from the first to the last of each.
    pub fn shifts(&self, [i, j, k]: [[i64; 2]; 3]) -> Vec<[f64; 3]> {
        let along = |[first, last]: [i64; 2]| (first..=last).map(|n| n as f64);
        let all = along(i).flat_map(|i| along(j).flat_map(move |j| along(k).map(move |k| [i, j, k])));
        all.map(|n| each_axis(|c| (0..3).map(|r| n[r] * self.vectors[r][c]).sum())).collect()
    }

    /// With lengths multiplied by `by`.
    pub fn scaled(&self, by: f64) -> Self {
        let scaled = |v: [f64; 3]| v.map(|v| v * by);
        Cell { origin: scaled(self.origin), vectors: self.vectors.map(scaled), periodic: self.periodic }
    }

    /// The cell that a file states: along vectors of zero nothing repeats (a slab). `None` where all are zero or they
    /// span no volume.
    pub fn stated(origin: [f64; 3], vectors: [[f64; 3]; 3], periodic: [bool; 3]) -> Option<Self> {
        let nonzero = vectors.map(|v| v != [0.0; 3]);
        let cell = Cell { origin, vectors, periodic: each_axis(|k| periodic[k] && nonzero[k]) };
        (nonzero.contains(&true) && cell.inverse().is_some()).then_some(cell)
    }

    /// The matrix that turns a world vector d into fractions of the cell vectors: fraction a is the
    /// sum of `d[k] * inverse[k][a]`. A vector of zero counts as one of length 1 across the others. `None` for a cell
    /// without volume.
    pub fn inverse(&self) -> Option<[[f64; 3]; 3]> {
        let directions = if self.vectors.contains(&[0.0; 3]) { self.directions() } else { self.vectors };
        let v = each_axis(|k| if self.vectors[k] == [0.0; 3] { directions[k] } else { self.vectors[k] });
        let rows = [cross(v[1], v[2]), cross(v[2], v[0]), cross(v[0], v[1])];
        let volume: f64 = dot(v[0], rows[0]);
        let inverse: [[f64; 3]; 3] = each_axis(|k| each_axis(|a| rows[a][k] / volume));
        inverse.iter().flatten().all(|x| x.is_finite()).then_some(inverse)
    }

    /// The same lattice by its shortest vectors, and what does not repeat at right angles to the others; where all
    /// then lie along the axes of the world, each in its place and upwards. A cell without volume stays as it is.
    #[must_use]
    pub fn reduced(&self) -> Cell {
        let upright = |c: &Cell| c.lengths().is_some_and(|l| l.iter().all(|l| *l >= 0.0));
        if upright(self) || self.inverse().is_none() {
            return *self;
        }
        let mut cell = *self;
        cell.shorten();
        let directions = cell.directions();
        for k in (0..3).filter(|k| !cell.periodic[*k]) {
            let length = dot(cell.vectors[k], directions[k]);
            cell.vectors[k] = directions[k].map(|x| x * length);
        }
        cell.in_place(directions).unwrap_or(cell)
    }

    /// Unit vectors along the cell vectors: of those that do not repeat what is at right angles to the others, of zeros
    /// whatever is.
    pub fn directions(&self) -> [[f64; 3]; 3] {
        let unit = |v: [f64; 3]| v.map(|x| x / norm(v));
        let across =
            |v: [f64; 3], taken: &[[f64; 3]]| taken.iter().fold(v, |v, t| each_axis(|k| v[k] - dot(v, *t) * t[k]));
        let mut order = [0, 1, 2];
        // Vectors that repeat come first, as the others are made perpendicular to them; zeros come last.
        order.sort_by_key(|k| (!self.periodic[*k], self.vectors[*k] == [0.0; 3]));
        // At right angles to each other, as far as there are any.
        let mut taken: Vec<[f64; 3]> = Vec::with_capacity(3);
        let mut directions = [[0.0; 3]; 3];
        for k in order {
            let vector = self.vectors[k];
            let mut perpendicular = across(vector, &taken);
            if norm(perpendicular) <= ALONG * norm(vector) {
                let axes = Cell::orthogonal([1.0; 3]).vectors.map(|v| across(v, &taken));
                perpendicular = axes.into_iter().fold([0.0; 3], |a, b| if norm(b) > norm(a) + ALONG { b } else { a });
            }
            taken.push(unit(perpendicular));
            directions[k] = if self.periodic[k] { unit(vector) } else { unit(perpendicular) };
        }
        directions
    }

    /// Takes the vectors that repeat to the shortest of their lattice.
    fn shorten(&mut self) {
        let repeats: Vec<usize> = (0..3).filter(|k| self.periodic[*k]).collect();
        for _ in 0..MOST_STEPS {
            let mut shortest = true;
            for &i in &repeats {
                let (vector, others) = (self.vectors[i], repeats.iter().filter(|j| **j != i).map(|j| self.vectors[*j]));
                let others: Vec<[f64; 3]> = others.collect();
                let minus = |steps: f64, v: [f64; 3]| move |from: [f64; 3]| each_axis(|k| from[k] - steps * v[k]);
                let mut candidates: Vec<[f64; 3]> =
                    others.iter().map(|v| minus((dot(vector, *v) / dot(*v, *v)).round(), *v)(vector)).collect();
                // Two vectors together may shorten a third that neither of them shortens alone.
                if let [a, b] = others[..] {
                    let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
                    candidates.extend(signs.map(|(s, t)| minus(t, b)(minus(s, a)(vector))));
                }
                let square = |v: &[f64; 3]| dot(*v, *v);
                if let Some(best) = candidates.into_iter().min_by(|a, b| square(a).total_cmp(&square(b)))
                    && square(&best) < SHORTER * square(&vector)
                {
                    (self.vectors[i], shortest) = (best, false);
                }
            }
            if shortest {
                return;
            }
        }
    }

    /// Each vector in the place of its axis of the world and upwards, about the same region; `None` where they lie otherwise.
    fn in_place(&self, directions: [[f64; 3]; 3]) -> Option<Cell> {
        let axis = |k: usize| (0..3).find(|j| directions[k][*j].abs() > 1.0 - ALONG);
        let axes = [axis(0)?, axis(1)?, axis(2)?];
        let mut cell = Cell { origin: self.origin, ..Cell::orthogonal([0.0; 3]) };
        for (k, &j) in axes.iter().enumerate() {
            let (length, along) = (norm(self.vectors[k]), dot(self.vectors[k], directions[k]) * directions[k][j]);
            cell.vectors[j][j] = length;
            cell.periodic[j] = self.periodic[k];
            // A vector that points down ends at the lowest corner.
            cell.origin[j] += along.min(0.0);
        }
        ((0..3).all(|j| axes.contains(&j))).then_some(cell)
    }

    /// Whether the vectors that repeat are those of one lattice, but for a share of `slack`.
    pub fn same_lattice(&self, other: &Cell, slack: f64) -> bool {
        let whole = |a: &Cell, b: &Cell| {
            b.inverse().is_some_and(|inverse| {
                (0..3).filter(|k| a.periodic[*k]).all(|k| {
                    let fraction = |j: usize| (0..3).map(|i| a.vectors[k][i] * inverse[i][j]).sum::<f64>();
                    (0..3).filter(|j| b.periodic[*j]).all(|j| (fraction(j) - fraction(j).round()).abs() <= slack)
                })
            })
        };
        let (a, b) = (self.reduced(), other.reduced());
        // One way alone would also hold of a lattice and a finer one that contains it.
        whole(&a, &b) && whole(&b, &a)
    }

    /// Edge lengths where the cell is orthogonal and axis-aligned.
    pub fn lengths(&self) -> Option<[f64; 3]> {
        let v = &self.vectors;
        let off = (0..3).any(|i| (0..3).any(|j| i != j && v[i][j] != 0.0));
        (!off).then(|| each_axis(|k| v[k][k]))
    }
}

/// `25 x 25 x 25, periodic in xyz`, with the corner where it is not at 0.
impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let point = |p: [f64; 3]| format!("({}, {}, {})", p[0], p[1], p[2]);
        match self.lengths() {
            Some([x, y, z]) => write!(f, "{x} x {y} x {z}")?,
            None => write!(f, "vectors {}", self.vectors.map(point).join(", "))?,
        }
        if self.origin != [0.0; 3] {
            write!(f, ", corner {}", point(self.origin))?;
        }
        let axes: String = ["x", "y", "z"].iter().zip(self.periodic).filter(|a| a.1).map(|a| *a.0).collect();
        if axes.is_empty() { write!(f, ", not periodic") } else { write!(f, ", periodic in {axes}") }
    }
}

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
        // The length of a column of the inverse is one over the distance of two faces.
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

    fn cell(vectors: [[f64; 3]; 3], periodic: [bool; 3]) -> Cell {
        Cell { vectors, periodic, ..Cell::orthogonal([0.0; 3]) }
    }

    #[test]
    fn permuted_and_negative_vectors_are_orthogonal() {
        let turned = cell([[0.0, 0.0, 5.0], [-10.0, 0.0, 0.0], [0.0, 7.0, 1e-9]], [true, false, true]);
        let straight = turned.reduced();
        assert_eq!((straight.lengths(), straight.periodic), (Some([10.0, 7.0, 5.0]), [false, true, true]));
        assert_eq!(straight.origin, [-10.0, 0.0, 0.0]);
        let sheared = cell([[10.0, 0.0, 0.0], [40.0, 10.0, 0.0], [-20.0, 10.0, 10.0]], [true; 3]);
        assert_eq!(sheared.reduced().lengths(), Some([10.0; 3]));
        let box_ = Cell::orthogonal([3.0, 4.0, 5.0]);
        assert_eq!(box_.reduced(), box_);
        assert!(sheared.same_lattice(&Cell::orthogonal([10.0; 3]), 1e-5) && !sheared.same_lattice(&box_, 1e-5));
    }

    /// The lattice of a truncated octahedron, as GROMACS has it and skewed beyond recognition.
    #[test]
    fn vectors_are_the_shortest_of_their_lattice() {
        let octahedron =
            [[1.0, 0.0, 0.0], [1.0 / 3.0, 8f64.sqrt() / 3.0, 0.0], [-1.0 / 3.0, 2f64.sqrt() / 3.0, 6f64.sqrt() / 3.0]];
        let [a, b, c] = octahedron;
        let plus = |v: [f64; 3], n: f64, w: [f64; 3]| each_axis(|k| v[k] + n * w[k]);
        let skewed = cell([a, plus(b, 37.0, a), plus(plus(c, -11.0, b), 1234.0, a)], [true; 3]);
        let reduced = skewed.reduced();
        for v in reduced.vectors {
            assert!((norm(v) - 1.0).abs() < 1e-9, "{v:?}");
        }
        assert!(reduced.same_lattice(&cell(octahedron, [true; 3]), 1e-6));
        let volume = dot(reduced.vectors[0], cross(reduced.vectors[1], reduced.vectors[2]));
        assert!((volume.abs() - 0.7698).abs() < 1e-4, "{volume}");
        // Lengths that no square stands, and a lattice that is none.
        for scale in [1e-50, 1e50] {
            let far = cell(octahedron.map(|v| v.map(|x| x * scale)), [true; 3]).reduced();
            assert!((norm(far.vectors[2]) / scale - 1.0).abs() < 1e-9);
        }
        let flat = cell([a, b, plus(a, 2.0, b)], [true; 3]);
        assert_eq!(flat.reduced(), flat);
        assert_eq!(cell([[f64::NAN; 3]; 3], [true; 3]).inverse(), None);
    }

    #[test]
    fn slabs_repeat_in_two_axes() {
        let slab = Cell::stated([0.0; 3], [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0; 3]], [true; 3]).unwrap();
        assert_eq!((slab.periodic, slab.lengths()), ([true, true, false], Some([1.0, 2.0, 0.0])));
        assert_eq!(slab.inverse().unwrap()[1][1], 0.5);
        // Hexagonal, with a third vector that leans; and first vectors of zero.
        let leaning = cell([[2.0, 0.0, 0.0], [1.0, 3f64.sqrt(), 0.0], [0.5, 0.5, 9.0]], [true, true, false]).reduced();
        assert!((leaning.vectors[2][2] - 9.0).abs() < 1e-12 && leaning.vectors[2][0].abs() < 1e-12);
        let only = Cell::stated([0.0; 3], [[0.0; 3], [0.0; 3], [4.0, 0.0, 0.0]], [true; 3]).unwrap().reduced();
        assert_eq!((only.lengths(), only.periodic), (Some([4.0, 0.0, 0.0]), [true, false, false]));
        assert!(Cell::stated([0.0; 3], [[0.0; 3]; 3], [true; 3]).is_none());
        assert!(Cell::stated([0.0; 3], [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [true; 3]).is_none());
    }

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
