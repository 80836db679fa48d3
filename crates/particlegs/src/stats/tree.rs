//! A k-d tree of points: the nearest neighbour in a periodic or an open domain.

use super::Domain;

/// Points in a leaf, at most.
const LEAF: usize = 8;
/// Points below which a part is built by one thread.
const ALONE: usize = 1 << 14;

/// Points ordered so that every subtree is a run: the median of a run divides it.
pub(super) struct Tree {
    points: Vec<([f64; 3], u32)>,
    domain: Domain,
}

/// The axis along which a run is longest.
fn widest(points: &[([f64; 3], u32)]) -> usize {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (x, _) in points {
        for k in 0..3 {
            (low[k], high[k]) = (low[k].min(x[k]), high[k].max(x[k]));
        }
    }
    let extent: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
    (1..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a })
}

fn build(points: &mut [([f64; 3], u32)], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let (axis, middle) = (widest(points), points.len() / 2);
    // Ties by index: one order, whatever the algorithm does.
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
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

/// A tree and the axis of each median.
pub(super) struct Neighbours {
    tree: Tree,
    axes: Vec<u8>,
}

impl Neighbours {
    /// Builds the tree of positions relative to the domain's corner (wrapped where it repeats).
    pub fn new(positions: &[[f64; 3]], domain: &Domain) -> Self {
        let mut points: Vec<([f64; 3], u32)> = positions.iter().enumerate().map(|(i, x)| (*x, i as u32)).collect();
        let mut axes = vec![0; points.len()];
        build(&mut points, &mut axes);
        Neighbours { tree: Tree { points, domain: *domain }, axes }
    }

    /// Distance from particle `own` at `x` to its nearest other; infinite where there is none.
    pub fn nearest(&self, x: [f64; 3], own: u32) -> f64 {
        let mut best = f64::INFINITY;
        self.search(0, self.tree.points.len(), &x, own, [0.0; 3], &mut best);
        // Images that could be nearer than what was found at home.
        let d = &self.tree.domain;
        let shifts: [Vec<f64>; 3] = std::array::from_fn(|k| {
            let mut s = vec![0.0];
            if d.periodic[k] {
                s.extend([-d.length[k], d.length[k]]);
            }
            s
        });
        for sx in &shifts[0] {
            for sy in &shifts[1] {
                for sz in &shifts[2] {
                    let shift = [*sx, *sy, *sz];
                    let at: [f64; 3] = std::array::from_fn(|k| x[k] + shift[k]);
                    let away: f64 = (0..3)
                        .map(|k| {
                            let beyond = (-at[k]).max(at[k] - d.length[k]).max(0.0);
                            if d.periodic[k] { beyond * beyond } else { 0.0 }
                        })
                        .sum();
                    if shift != [0.0; 3] && away < best {
                        self.search(0, self.tree.points.len(), &at, own, [0.0; 3], &mut best);
                    }
                }
            }
        }
        best.sqrt()
    }

    /// `off` holds the distance to the run's region along each axis; `best` the smallest square.
    fn search(&self, from: usize, to: usize, x: &[f64; 3], own: u32, off: [f64; 3], best: &mut f64) {
        let points = &self.tree.points[from..to];
        let take = |p: &([f64; 3], u32), best: &mut f64| {
            if p.1 != own {
                let d: [f64; 3] = std::array::from_fn(|k| p.0[k] - x[k]);
                *best = best.min(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            }
        };
        if points.len() <= LEAF {
            return points.iter().for_each(|p| take(p, best));
        }
        let middle = from + points.len() / 2;
        let (axis, median) = (self.axes[middle] as usize, &self.tree.points[middle]);
        take(median, best);
        let d = x[axis] - median.0[axis];
        let (near, far) = if d < 0.0 { ((from, middle), (middle + 1, to)) } else { ((middle + 1, to), (from, middle)) };
        self.search(near.0, near.1, x, own, off, best);
        let mut beyond = off;
        beyond[axis] = d;
        if beyond[0] * beyond[0] + beyond[1] * beyond[1] + beyond[2] * beyond[2] < *best {
            self.search(far.0, far.1, x, own, beyond, best);
        }
    }
}
