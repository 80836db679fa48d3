//! Cuts a snapshot into cells, the cut that helps the picture most first.
//!
//! Every cell knows its best cut and what that gains ([`Blur::split_gain`]) from its creation.
//! Cutting the cell of the largest gain until there are M cells chooses the M - 1 cuts of the
//! largest key, a cut's key being the smallest gain on the way from the whole snapshot to it. So
//! cells may be cut in any order and in parallel down to a threshold, and the best cuts chosen
//! afterwards: a cut that is not chosen has only reordered its cell.

use super::cut::Cut;
use super::{Blur, Moments, Store};
use crate::model::Mixture;
use crate::particles::Particles;
use crate::progress::Progress;
use crate::{Error, Result};
use rayon::prelude::*;
use std::ops::Range;

/// How to cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartitionOptions {
    /// Blur under which pictures are compared, in particle radii. Small values favour fine detail
    /// and small drawing radii, large ones large radii.
    pub blur_radii: f64,
}

impl Default for PartitionOptions {
    fn default() -> Self {
        PartitionOptions { blur_radii: 6.0 }
    }
}

/// Cells of particles that lie side by side in the store.
#[derive(Clone, Debug)]
pub struct Partition {
    /// The particles, reordered.
    pub store: Store,
    /// Each cell's particles, in the store's order: together they are the whole store.
    pub cells: Vec<Range<usize>>,
    /// Each cell's moments, store units.
    pub moments: Vec<Moments>,
}

/// Cells below which a branch is cut by one thread.
const PARALLEL: usize = 1 << 14;

/// A cut that was made.
struct Made {
    mid: usize,
    key: f64,
    depth: u32,
}

/// A cell that is cut already, but whose halves are not examined yet.
#[derive(Clone)]
struct Pending {
    start: usize,
    mid: usize,
    end: usize,
    gain: f64,
    key: f64,
    depth: u32,
}

/// Cuts `particles` into at most `gaussians` cells for pictures drawn with `radius` (world units).
/// Fewer come back where fewer places are occupied. The result does not depend on threads.
///
/// # Errors
/// [`Error::Argument`] for no particles, no Gaussians, or a radius that is not positive;
/// [`Error::Cancelled`].
pub fn partition(
    particles: &Particles,
    gaussians: usize,
    radius: f64,
    options: PartitionOptions,
    progress: &dyn Progress,
) -> Result<Partition> {
    if particles.is_empty() || gaussians == 0 {
        return Err(Error::argument("a partition needs at least one particle and one Gaussian"));
    }
    if !(radius > 0.0 && radius.is_finite() && options.blur_radii > 0.0 && options.blur_radii.is_finite()) {
        return Err(Error::argument(format!("radius {radius} and blur {} must be positive", options.blur_radii)));
    }
    progress.check()?;
    let mut store = Store::new(particles);
    let s = (options.blur_radii * radius * store.scale).clamp(1e-9, 1e9);
    let grower = Grower { blur: Blur(s * s), progress };
    let bounds = grower.grow(&mut store, gaussians)?;
    let cells: Vec<Range<usize>> = bounds.windows(2).map(|w| w[0]..w[1]).collect();
    let moments = cells
        .par_iter()
        .map(|c| Moments::of(&store.xyz[c.clone()], store.weight.as_ref().map(|w| &w[c.clone()])))
        .collect();
    Ok(Partition { store, cells, moments })
}

impl Partition {
    /// The cells as Gaussians, world units.
    pub fn mixture(&self) -> Mixture {
        let n = self.cells.len();
        let unit = 1.0 / self.store.scale;
        let column = |f: &dyn Fn(&Moments) -> f64| self.moments.iter().map(f).collect::<Vec<f64>>();
        let mut mixture = Mixture {
            mean: std::array::from_fn(|k| column(&|m| self.store.origin[k] + m.mean[k] * unit)),
            cov: std::array::from_fn(|k| column(&|m| m.cov.0[k] * unit * unit)),
            count: column(&|m| m.count as f64),
            mass: self.store.weight.as_ref().map(|_| column(&|m| m.mass)),
        };
        mixture.count.truncate(n);
        mixture
    }
}

struct Grower<'a> {
    blur: Blur,
    progress: &'a dyn Progress,
}

/// What a branch has done.
#[derive(Default)]
struct Branch {
    made: Vec<Made>,
    pending: Vec<Pending>,
}

impl Branch {
    fn append(&mut self, mut other: Branch) {
        self.made.append(&mut other.made);
        self.pending.append(&mut other.pending);
    }
}

/// A cell's particles.
struct Cell<'a> {
    start: usize,
    xyz: &'a mut [[f32; 3]],
    weight: Option<&'a mut [f32]>,
    key: f64,
    depth: u32,
}

impl<'a> Cell<'a> {
    fn halves(self, mid: usize, key: f64) -> [Cell<'a>; 2] {
        let at = mid - self.start;
        let (a, b) = self.xyz.split_at_mut(at);
        let (wa, wb) = match self.weight {
            Some(w) => {
                let (a, b) = w.split_at_mut(at);
                (Some(a), Some(b))
            }
            None => (None, None),
        };
        let depth = self.depth + 1;
        [Cell { start: self.start, xyz: a, weight: wa, key, depth }, Cell { start: mid, xyz: b, weight: wb, key, depth }]
    }
}

impl Grower<'_> {
    /// Cell boundaries, ascending, first 0 and last N.
    fn grow(&self, store: &mut Store, gaussians: usize) -> Result<Vec<usize>> {
        let n = store.len();
        self.progress.begin("partition", gaussians as u64);
        let whole = Moments::of(&store.xyz, None);
        let root =
            Cell { start: 0, xyz: &mut store.xyz, weight: store.weight.as_deref_mut(), key: f64::INFINITY, depth: 0 };
        let mut all = Branch::default();
        self.examine(root, whole, f64::INFINITY, &mut all)?;
        let mut threshold = all.pending.first().map_or(0.0, |p| p.gain);
        while all.made.len() + 1 < gaussians && !all.pending.is_empty() {
            threshold = next_threshold(threshold, gaussians, &all);
            let (go, wait): (Vec<_>, Vec<_>) = all.pending.into_iter().partition(|p| p.gain >= threshold);
            all.pending = wait;
            let made = all.made.len();
            for branch in self.round(store, go, threshold) {
                all.append(branch?);
            }
            self.progress.advance((all.made.len() - made) as u64);
        }
        self.progress.end();
        all.made.sort_unstable_by(|a, b| b.key.total_cmp(&a.key).then(a.depth.cmp(&b.depth)).then(a.mid.cmp(&b.mid)));
        all.made.truncate(gaussians - 1);
        let mut bounds: Vec<usize> = all.made.iter().map(|m| m.mid).chain([0, n]).collect();
        bounds.sort_unstable();
        Ok(bounds)
    }

    /// Cuts the pending cells down to `threshold`, in the order of the store.
    fn round(&self, store: &mut Store, mut go: Vec<Pending>, threshold: f64) -> Vec<Result<Branch>> {
        go.sort_unstable_by_key(|p| p.start);
        let mut cells = Vec::with_capacity(go.len());
        let (mut xyz, mut weight) = (&mut store.xyz[..], store.weight.as_deref_mut());
        let mut at = 0;
        for p in go {
            let (skip, len) = (p.start - at, p.end - p.start);
            let here = xyz.split_at_mut(skip).1.split_at_mut(len);
            xyz = here.1;
            let w = weight.map(|w| w.split_at_mut(skip).1.split_at_mut(len));
            let (w_here, w_rest) = w.unzip();
            weight = w_rest;
            at = p.end;
            let cell = Cell { start: p.start, xyz: here.0, weight: w_here, key: p.key, depth: p.depth };
            cells.push((cell, p));
        }
        cells
            .into_par_iter()
            .map(|(cell, p)| {
                let mut out = Branch::default();
                out.made.push(Made { mid: p.mid, key: p.key, depth: p.depth });
                for half in cell.halves(p.mid, p.key) {
                    let moments = Moments::of(half.xyz, None);
                    self.examine(half, moments, threshold, &mut out)?;
                }
                Ok(out)
            })
            .collect()
    }

    /// Cuts a cell, and its halves in turn while cuts gain at least `threshold`.
    fn examine(&self, cell: Cell<'_>, moments: Moments, threshold: f64, out: &mut Branch) -> Result<()> {
        let mut cell = cell;
        let Some(cut) = Cut::best(cell.xyz, &moments) else { return Ok(()) };
        let len = cut.apply(cell.xyz, cell.weight.as_deref_mut());
        let a = Moments::of(&cell.xyz[..len], None);
        let b = Moments::of(&cell.xyz[len..], None);
        let gain = self.blur.split_gain(&moments, &a, &b).max(f64::MIN_POSITIVE);
        let (start, mid, end) = (cell.start, cell.start + len, cell.start + cell.xyz.len());
        let (key, depth) = (cell.key.min(gain), cell.depth);
        if gain < threshold {
            out.pending.push(Pending { start, mid, end, gain, key, depth });
            return Ok(());
        }
        out.made.push(Made { mid, key, depth });
        let large = cell.xyz.len() > PARALLEL;
        let [first, second] = cell.halves(mid, key);
        if !large {
            self.examine(first, a, threshold, out)?;
            return self.examine(second, b, threshold, out);
        }
        self.progress.check()?;
        let mut other = Branch::default();
        let (x, y) = rayon::join(
            || self.examine(first, a, threshold, out),
            || self.examine(second, b, threshold, &mut other),
        );
        out.append(other);
        x.and(y)
    }
}

/// The next round's threshold: far down while cells are few, so that branches are cut while they
/// are in cache; then just as far as the cells that wait can fill what is missing.
fn next_threshold(last: f64, gaussians: usize, all: &Branch) -> f64 {
    let mut gains: Vec<f64> = all.pending.iter().map(|p| p.gain).collect();
    let missing = gaussians - 1 - all.made.len();
    let k = missing.min(gains.len()) - 1;
    let (_, kth, _) = gains.select_nth_unstable_by(k, |a, b| b.total_cmp(a));
    if all.made.len() * 16 < gaussians { kth.min(last / 8.0) } else { *kth }
}
