//! A k-d tree of points: the nearest neighbour in a periodic or an open domain.
//!
//! Points are the particles' own float32 numbers, ordered in place: 13 bytes a particle. No index is
//! kept: of the points at a particle's own place, one is itself.

use super::Domain;
use crate::particles::{ChunkBuffer, Particles, RUN};
use rayon::prelude::*;

/// Points in a leaf, at most.
const LEAF: usize = 16;
/// Points below which a part is built by one thread.
const ALONE: usize = 1 << 14;

/// A position relative to the particles' origin.
pub(super) type Place = [f32; 3];

/// Positions as they are, those outside a domain that repeats moved into it.
pub(super) fn places(p: &Particles, domain: &Domain) -> Vec<Place> {
    let corner: [f64; 3] = std::array::from_fn(|k| domain.min[k] - p.origin[k]);
    let mut all = vec![[0.0; 3]; p.len()];
    all.par_chunks_mut(RUN).enumerate().for_each_init(ChunkBuffer::default, |buffer, (run, out)| {
        let chunk = p.chunk(run * RUN..run * RUN + out.len(), buffer);
        for (i, x) in out.iter_mut().enumerate() {
            *x = std::array::from_fn(|k| {
                let (raw, length) = (chunk.position[k][i], domain.length[k]);
                let turns = ((f64::from(raw) - corner[k]) / length).floor();
                if domain.periodic[k] && turns != 0.0 { (f64::from(raw) - turns * length) as f32 } else { raw }
            });
        }
    });
    all
}

/// Points ordered so that every subtree is a run: the median of a run divides it.
pub(super) struct Neighbours {
    points: Vec<Place>,
    /// The axis of each median.
    axes: Vec<u8>,
    /// The domain's lowest corner, as points are.
    corner: [f64; 3],
    length: [f64; 3],
    periodic: [bool; 3],
}

/// The nearest so far.
struct Best {
    /// Points at the place itself.
    here: u32,
    /// Smallest square of a distance above zero.
    square: f64,
}

/// The axis along which a run is longest.
fn widest(points: &[Place]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for x in points {
        for k in 0..3 {
            (low[k], high[k]) = (low[k].min(x[k]), high[k].max(x[k]));
        }
    }
    let extent: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
    (1..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a })
}

fn build(points: &mut [Place], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let (axis, middle) = (widest(points), points.len() / 2);
    points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    axes[middle] = axis as u8;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    let mut work = || build(left, left_axes);
    if right.len() > ALONE {
        rayon::join(work, || build(&mut right[1..], &mut right_axes[1..]));
    } else {
        work();
        build(&mut right[1..], &mut right_axes[1..]);
    }
}

impl Neighbours {
    /// Builds the tree of [`places`]; `origin` is what they are relative to.
    pub fn new(mut points: Vec<Place>, origin: [f64; 3], domain: &Domain) -> Self {
        let mut axes = vec![0; points.len()];
        build(&mut points, &mut axes);
        let corner = std::array::from_fn(|k| domain.min[k] - origin[k]);
        Neighbours { points, axes, corner, length: domain.length, periodic: domain.periodic }
    }

    /// Distance from the point at `x`, one of the tree's, to its nearest other; infinite where there
    /// is none.
    pub fn nearest(&self, x: Place) -> f64 {
        let mut best = Best { here: 0, square: f64::INFINITY };
        let x = x.map(f64::from);
        self.search(0, self.points.len(), &x, [0.0; 3], &mut best);
        if best.here > 1 {
            return 0.0;
        }
        // Images that could be nearer than what was found at home.
        let shifts: [&[f64]; 3] = self.periodic.map(|p| if p { &[0.0, -1.0, 1.0][..] } else { &[0.0] });
        for a in shifts[0] {
            for b in shifts[1] {
                for c in shifts[2] {
                    let turn = [*a, *b, *c];
                    let at: [f64; 3] = std::array::from_fn(|k| x[k] + turn[k] * self.length[k]);
                    let away = |k: usize| {
                        let local = at[k] - self.corner[k];
                        if self.periodic[k] { (-local).max(local - self.length[k]).max(0.0) } else { 0.0 }
                    };
                    let away: f64 = (0..3).map(|k| away(k) * away(k)).sum();
                    if turn != [0.0; 3] && away < best.square {
                        self.search(0, self.points.len(), &at, [0.0; 3], &mut best);
                    }
                }
            }
        }
        best.square.sqrt()
    }

    /// `off` holds the distance to the run's region along each axis.
    fn search(&self, from: usize, to: usize, x: &[f64; 3], off: [f64; 3], best: &mut Best) {
        let points = &self.points[from..to];
        let take = |p: &Place, best: &mut Best| {
            let d: [f64; 3] = std::array::from_fn(|k| f64::from(p[k]) - x[k]);
            let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            if square == 0.0 {
                best.here += 1;
            } else if square < best.square {
                best.square = square;
            }
        };
        if best.here > 1 {
            return;
        }
        if points.len() <= LEAF {
            return points.iter().for_each(|p| take(p, best));
        }
        let middle = from + points.len() / 2;
        let (axis, median) = (self.axes[middle] as usize, &self.points[middle]);
        take(median, best);
        let d = x[axis] - f64::from(median[axis]);
        let (near, far) = if d < 0.0 { ((from, middle), (middle + 1, to)) } else { ((middle + 1, to), (from, middle)) };
        self.search(near.0, near.1, x, off, best);
        let mut beyond = off;
        beyond[axis] = d;
        if beyond[0] * beyond[0] + beyond[1] * beyond[1] + beyond[2] * beyond[2] < best.square {
            self.search(far.0, far.1, x, beyond, best);
        }
    }
}
