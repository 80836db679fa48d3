//! The region that particles lie in: a box, and the axes along which it repeats.

use crate::Particles;
use particlegs_core::math::{Sym3, each_axis, floor};
use particlegs_core::model::Model;
use particlegs_core::space::{Bounds, Cell};

/// Particles lie in a cell where its bounds and theirs differ by no more than this share.
const DRAWN_WITHIN: f64 = 0.05;

/// A box, world units, and the edges along which it repeats.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Domain {
    /// Lowest corner, world units.
    pub min: [f64; 3],
    /// Edge lengths, above zero.
    pub length: [f64; 3],
    /// Whether each edge repeats.
    pub periodic: [bool; 3],
    /// Directions of the edges, if not along x, y and z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tilt: Option<Tilt>,
}

/// Edges that are not those of an upright box. Coordinates *along* them take a point apart into lengths along the edges:
/// a tilted box is upright there.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Tilt {
    /// Unit vector along each edge.
    axes: [[f64; 3]; 3],
    /// Turns a world vector d into coordinates along the edges: a is the sum of `d[k] * inverse[k][a]`.
    #[serde(skip)]
    inverse: [[f64; 3]; 3],
}

impl Tilt {
    /// `None` of directions in one plane.
    fn new(axes: [[f64; 3]; 3]) -> Option<Self> {
        let inverse = Cell { vectors: axes, ..Cell::orthogonal([0.0; 3]) }.inverse()?;
        Some(Tilt { axes, inverse })
    }

    /// Coordinate `a` of a world vector along the edges.
    #[inline]
    pub fn along(&self, d: &[f64; 3], a: usize) -> f64 {
        d[0] * self.inverse[0][a] + d[1] * self.inverse[1][a] + d[2] * self.inverse[2][a]
    }

    /// A world vector along the edges.
    #[inline]
    pub fn upright(&self, d: [f64; 3]) -> [f64; 3] {
        each_axis(|a| self.along(&d, a))
    }

    /// A covariance along the edges.
    pub fn upright_covariance(&self, cov: &Sym3) -> Sym3 {
        let (rows, t) = (cov.rows(), &self.inverse);
        let at = |a: usize, b: usize| -> f64 {
            (0..3).map(|i| t[i][a] * (0..3).map(|j| rows[i][j] * t[j][b]).sum::<f64>()).sum()
        };
        Sym3([at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)])
    }

    /// The bounds of particles along the edges, from a corner.
    pub(super) fn bounds(&self, p: &Particles, corner: [f64; 3]) -> Bounds {
        let from: [f64; 3] = each_axis(|k| p.origin[k] - corner[k]);
        let parts = p.par_chunks(|_, chunk| {
            let mut bounds = Bounds::empty();
            let place = |i: usize| each_axis(|k| f64::from(chunk.position[k][i]) + from[k]);
            (0..chunk.len()).for_each(|i| bounds.include(self.upright(place(i))));
            bounds
        });
        parts.iter().fold(Bounds::empty(), |a, b| a.union(b))
    }

    /// The world wave vector of phases per length along the edges.
    pub fn wave(&self, k: [f64; 3]) -> [f64; 3] {
        each_axis(|j| (0..3).map(|a| self.inverse[j][a] * k[a]).sum())
    }

    /// The world vector of lengths along the edges.
    pub(crate) fn world(&self, s: [f64; 3]) -> [f64; 3] {
        each_axis(|k| (0..3).map(|a| s[a] * self.axes[a][k]).sum())
    }

    /// Volume of a box with edges of 1.
    pub fn volume(&self) -> f64 {
        let [a, b, c] = self.axes;
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        (cross[0] * c[0] + cross[1] * c[1] + cross[2] * c[2]).abs()
    }
}

impl Domain {
    /// An upright box.
    pub const fn upright(min: [f64; 3], length: [f64; 3], periodic: [bool; 3]) -> Self {
        Domain { min, length, periodic, tilt: None }
    }

    /// The cell along the axes where it repeats and the content fills more than half of it, else
    /// the bounds (a cut-out or a zoom lies open in its box). A tilted cell is reduced to its shortest vectors first, and
    /// filled along all of them or open.
    pub fn new(bounds: &Bounds, cell: Option<&Cell>) -> Self {
        let extent = bounds.extent_nonzero();
        // An extent of zero is stood in for by another: keep its content in the middle.
        let mut domain = Self::upright(each_axis(|k| bounds.center()[k] - 0.5 * extent[k]), extent, [false; 3]);
        let Some((stated, cell)) = cell.map(|c| (c, c.reduced())) else { return domain };
        let Some(lengths) = cell.lengths() else {
            let filled = [*stated, cell].iter().any(|c| is_filled(&extent, c));
            return Self::tilted(bounds, &cell).filter(|_| filled).unwrap_or(domain);
        };
        for k in 0..3 {
            if cell.periodic[k] && lengths[k].is_finite() && lengths[k] > 0.0 && extent[k] > 0.5 * lengths[k] {
                (domain.min[k], domain.length[k], domain.periodic[k]) = (cell.origin[k], lengths[k], true);
            }
        }
        domain
    }

    /// The domain in which even particles are drawn: as [`Domain::new`], of a tilted cell by the vectors, the file's
    /// or the shortest, that reach as far as the bounds; else the bounds.
    pub fn drawn(bounds: &Bounds, cell: Option<&Cell>) -> Self {
        let domain = Self::new(bounds, cell);
        let Some((cell, _)) = cell.zip(domain.tilt) else { return domain };
        let extent = bounds.extent();
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() <= DRAWN_WITHIN * extent[k]);
        let filled = |d: &Domain| near(d.bounds().min, bounds.min) && near(d.bounds().max, bounds.max);
        let tilted = [*cell, cell.reduced()].into_iter().filter_map(|c| Self::tilted(bounds, &c)).find(filled);
        tilted.unwrap_or_else(|| Self::new(bounds, None))
    }

    /// The upright box around it.
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::empty();
        for corner in 0..8 {
            let turned = self.turned(each_axis(|k| f64::from(corner >> k & 1)));
            bounds.include(each_axis(|k| self.min[k] + turned[k]));
        }
        bounds
    }

    /// `None` where nothing repeats. Along edges that do not repeat it reaches as far as the bounds.
    fn tilted(bounds: &Bounds, cell: &Cell) -> Option<Self> {
        let (extent, periodic) = (bounds.extent_nonzero(), cell.periodic);
        let tilt = Tilt::new(cell.directions()).filter(|_| periodic.contains(&true))?;
        let norm = |v: [f64; 3]| tilt.upright(v).map(|s| s * s).iter().sum::<f64>().sqrt();
        let mut domain =
            Domain { min: cell.origin, length: each_axis(|a| norm(cell.vectors[a])), periodic, tilt: Some(tilt) };
        let center = bounds.center();
        for a in (0..3).filter(|a| !periodic[*a]) {
            let axis = tilt.axes[a];
            let reach: f64 = (0..3).map(|k| 0.5 * extent[k] * axis[k].abs()).sum();
            let middle: f64 = (0..3).map(|k| (center[k] - cell.origin[k]) * axis[k]).sum();
            domain.length[a] = 2.0 * reach;
            (0..3).for_each(|k| domain.min[k] += (middle - reach) * axis[k]);
        }
        domain.length.iter().all(|l| l.is_finite() && *l > 0.0).then_some(domain)
    }

    /// The box of a snapshot.
    pub fn from_particles(particles: &Particles) -> Self {
        Self::new(&particles.bounds(), particles.meta.cell.as_ref())
    }

    /// The box of the snapshot that a model was made of.
    pub fn from_model(model: &Model) -> Self {
        Self::new(&model.metadata.bounds, model.metadata.cell.as_ref())
    }

    /// Whether its edges point elsewhere than along x, y and z.
    pub fn is_tilted(&self) -> bool {
        self.tilt.is_some()
    }

    /// Volume, world units cubed.
    pub fn volume(&self) -> f64 {
        self.length[0] * self.length[1] * self.length[2] * self.tilt.map_or(1.0, |t| t.volume())
    }

    /// Mean spacing of `n` particles, (V / n)^(1/3).
    pub fn spacing(&self, n: usize) -> f64 {
        let tilt = self.tilt.map_or(1.0, |t| libm::cbrt(t.volume()));
        self.length.map(libm::cbrt).iter().product::<f64>() * tilt / libm::cbrt(n.max(1) as f64)
    }

    /// Length of the longest edge, world units.
    pub fn longest(&self) -> f64 {
        self.length.iter().copied().fold(0.0, f64::max)
    }

    /// Length of the shortest edge, world units.
    pub fn shortest(&self) -> f64 {
        self.length.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Distance from face to face across each edge: the edge's length in an upright box.
    pub fn heights(&self) -> [f64; 3] {
        each_axis(|a| self.length[a] / self.stretch(a))
    }

    /// Length along an edge over distance from its face, 1 in an upright box.
    pub fn stretch(&self, a: usize) -> f64 {
        self.tilt.map_or(1.0, |t| each_axis(|k| t.inverse[k][a] * t.inverse[k][a]).iter().sum::<f64>().sqrt())
    }

    /// The longest diagonal of a cell whose edges are 1 long.
    pub fn diagonal(&self) -> f64 {
        let Some(tilt) = self.tilt else { return 3f64.sqrt() };
        let square = |v: [f64; 3]| v.map(|x| x * x).iter().sum::<f64>();
        let signs = [[1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0], [1.0, -1.0, -1.0]];
        signs.map(|s| square(tilt.world(s))).into_iter().fold(0.0, f64::max).sqrt()
    }

    /// Coordinate `a` along the edges of a position relative to the lowest corner.
    #[inline]
    pub fn along(&self, x: &[f64; 3], a: usize) -> f64 {
        self.tilt.as_ref().map_or(x[a], |t| t.along(x, a))
    }

    /// The world vector of whole turns around the edges.
    #[inline]
    pub fn turned(&self, turns: [f64; 3]) -> [f64; 3] {
        let lengths = each_axis(|a| turns[a] * self.length[a]);
        self.tilt.as_ref().map_or(lengths, |t| t.world(lengths))
    }

    /// A position relative to the lowest corner, in the box along edges that repeat: in [0, length) of an upright one,
    /// but for rounding of a tilted one.
    pub fn local(&self, p: [f64; 3]) -> [f64; 3] {
        let x: [f64; 3] = each_axis(|k| p[k] - self.min[k]);
        if let Some(tilt) = &self.tilt {
            let turns = each_axis(|a| if self.periodic[a] { floor(tilt.along(&x, a) / self.length[a]) } else { 0.0 });
            let back = self.turned(turns);
            return each_axis(|k| x[k] - back[k]);
        }
        each_axis(|k| {
            if !self.periodic[k] {
                return x[k];
            }
            let wrapped = x[k].rem_euclid(self.length[k]);
            // The remainder of a tiny negative number rounds up to the length itself.
            if wrapped < self.length[k] { wrapped } else { 0.0 }
        })
    }

    /// The place that lies so far from the lowest corner.
    pub fn world(&self, x: [f64; 3]) -> [f64; 3] {
        each_axis(|k| self.min[k] + x[k])
    }

    /// The image of a place in the box, along edges that repeat.
    pub fn in_box(&self, place: [f64; 3]) -> [f64; 3] {
        self.world(self.local(place))
    }

    /// A difference of positions by the shortest way round.
    pub fn shortest_way(&self, d: [f64; 3]) -> [f64; 3] {
        let Some(tilt) = &self.tilt else {
            return each_axis(|k| {
                if self.periodic[k] { d[k] - self.length[k] * floor(d[k] / self.length[k] + 0.5) } else { d[k] }
            });
        };
        let whole: [f64; 3] =
            each_axis(|a| if self.periodic[a] { floor(tilt.along(&d, a) / self.length[a] + 0.5) } else { 0.0 });
        // In a tilted cell the image of the nearest fractions may have a nearer one beside it.
        let beside = |a: usize| if self.periodic[a] { -1..=1 } else { 0..=0 };
        let square = |v: &[f64; 3]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        let mut nearest = [f64::INFINITY; 3];
        for (i, j, k) in beside(0).flat_map(|i| beside(1).flat_map(move |j| beside(2).map(move |k| (i, j, k)))) {
            let steps = [i, j, k].map(f64::from);
            let back = self.turned(each_axis(|a| whole[a] + steps[a]));
            let moved = each_axis(|k| d[k] - back[k]);
            if square(&moved) < square(&nearest) {
                nearest = moved;
            }
        }
        nearest
    }
}

/// Whether an extent is above half of what a cell's vectors that repeat reach, along every axis.
fn is_filled(extent: &[f64; 3], cell: &Cell) -> bool {
    let reach = |k: usize| (0..3).filter(|a| cell.periodic[*a]).map(|a| cell.vectors[a][k].abs()).sum::<f64>();
    (0..3).all(|k| extent[k] > 0.5 * reach(k))
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

    /// Against all images a few turns away, of a triclinic cell and a leaning slab.
    #[test]
    fn tilted_boxes_have_their_volume_and_shortest_ways() {
        let vectors = [[10.0, 0.0, 0.0], [4.0, 9.0, 0.0], [2.0, 3.0, 8.0]];
        let bounds = Bounds { min: [0.0; 3], max: [16.0, 12.0, 8.0] };
        for periodic in [[true; 3], [true, true, false]] {
            let cell = Cell { vectors, periodic, ..Cell::orthogonal([1.0; 3]) };
            let d = Domain::new(&bounds, Some(&cell));
            assert_eq!(d.periodic, periodic);
            assert!((d.volume() - 720.0).abs() < 1e-9 && (d.spacing(720) - 1.0).abs() < 1e-12, "{}", d.volume());
            let mut r = particlegs_core::math::Random::new(3, 0, 0);
            for _ in 0..200 {
                let x = [0; 3].map(|_| 60.0 * r.uniform() - 30.0);
                let inside = d.local(x);
                let s = d.tilt.unwrap().upright(inside);
                assert!((0..3).all(|a| !periodic[a] || (-1e-9..d.length[a] + 1e-9).contains(&s[a])), "{s:?}");
                let whole = d.tilt.unwrap().upright(each_axis(|k| x[k] - d.min[k] - inside[k]));
                assert!(
                    (0..3).all(|a| (whole[a] / d.length[a])
                        .fract()
                        .abs()
                        .min(1.0 - (whole[a] / d.length[a]).fract().abs())
                        < 1e-9)
                );
                let square = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
                let mut least = f64::INFINITY;
                for i in 0..16 * 16 * 16 {
                    let n = [i / 256, i / 16 % 16, i % 16].map(|n| f64::from(n) - 8.0);
                    if (0..3).all(|a| periodic[a] || n[a] == 0.0) {
                        let moved = each_axis(|k| x[k] + (0..3).map(|a| n[a] * vectors[a][k]).sum::<f64>());
                        least = least.min(square(moved));
                    }
                }
                assert!((square(d.shortest_way(x)) - least).abs() < 1e-9 * least.max(1.0), "{x:?}");
            }
            // By vectors that are not the shortest, of which z spans twice the box; a cut-out lies open.
            let leaning = [[8.0, 0.0, 0.0], [0.0, 7.0, 0.0], [-5.0, 0.0, 6.0]];
            let leaning = Cell { vectors: leaning, ..cell };
            let filled = Domain::new(&Bounds { min: [-5.0, 0.0, 0.0], max: [8.0, 7.0, 6.0] }, Some(&leaning));
            assert_eq!(filled.periodic, periodic);
            let part = Bounds { min: [0.0; 3], max: [16.0, 3.0, 8.0] };
            assert_eq!(Domain::new(&part, Some(&cell)), Domain::new(&part, None));
        }
    }

    #[test]
    fn one_point_has_a_domain() {
        let d = Domain::new(&Bounds { min: [2.0; 3], max: [2.0; 3] }, None);
        assert_eq!((d.min, d.length), ([1.5; 3], [1.0; 3]));
    }
}
