//! Cuts a snapshot into cells, the cut that helps the picture most first.
//!
//! Every cell is cut on its creation and knows what the cut gains ([`Blur::difference`]). Branches
//! are cut on, in parallel and while they are in cache, as long as gains reach a threshold; the
//! threshold falls from round to round until there are somewhat more cells than wanted. Then the
//! best cuts are chosen: one that is not chosen has only reordered its cell.

use super::best_cuts::{CutRecord, best_cuts};
use super::cut::Cut;
use super::gain::{Blur, PictureGaussian, picture_sigma};
use super::{Moments, ParticleStore};
use particlegs_core::context::Context;
use particlegs_core::{Error, Result, parallel};
use std::ops::Range;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PartitionOptions {
    /// Blur under which pictures are compared, in particle radii. Small values favour fine detail
    /// and small drawing radii, large ones large radii. On nbody128 at 19 000 cells 4, 5 and 6 give
    /// 29.08, 29.03 and 28.93 dB at the default radius, 20.7, 21.0 and 21.3 dB at six times that.
    pub blur_radii: f64,
    /// A pixel of the pictures that the cells are made for, world units (0: finer than a radius).
    /// Pixels blur too: on nbody128 tiled to 268 M particles the near orbit's pixel, 11 radii, gains
    /// 0.19 dB far, 0.13 dB mid and 0.10 dB near at 240 000 cells.
    pub pixel: f64,
}

impl Default for PartitionOptions {
    fn default() -> Self {
        PartitionOptions { blur_radii: 5.0, pixel: 0.0 }
    }
}

/// Cells of particles that lie side by side in the store.
#[derive(Clone, Debug)]
pub(crate) struct Partition {
    /// The particles, reordered.
    pub store: ParticleStore,
    /// Each cell's particles, in the store's order: together they are the whole store.
    pub cells: Vec<Range<usize>>,
    /// Each cell's moments, store units.
    pub moments: Vec<Moments>,
}

/// Cells up to this many particles are cut by one thread.
const PARALLEL: usize = 1 << 14;
/// Cells to make for each one wanted, so that the best cuts can be chosen: 1.3 is as good as 4.
const SPARE: f64 = 1.3;

/// A cell that is cut already, but whose halves are not examined yet.
#[derive(Clone, Copy)]
struct PendingCell {
    start: usize,
    mid: usize,
    end: usize,
    gain: f64,
}

/// Cuts the particles of `store` into at most `gaussians` cells for pictures drawn with `radius` (world units).
/// Fewer come back where fewer places are occupied. The result does not depend on threads.
pub(super) fn partition(
    mut store: ParticleStore,
    gaussians: usize,
    radius: f64,
    options: PartitionOptions,
    context: &Context<'_>,
) -> Result<Partition> {
    if store.is_empty() || gaussians == 0 {
        return Err(Error::argument("a partition needs at least one particle and one Gaussian"));
    }
    if !(radius > 0.0
        && radius.is_finite()
        && options.blur_radii > 0.0
        && options.blur_radii.is_finite()
        && options.pixel >= 0.0)
    {
        return Err(Error::argument(format!("radius {radius} and blur {} must be positive", options.blur_radii)));
    }
    context.check()?;
    let s = (picture_sigma(options.blur_radii * radius, options.pixel) * store.scale).clamp(1e-9, 1e9);
    let builder = PartitionBuilder { blur: Blur::from_sigma(s), context };
    let bounds = builder.grow(&mut store, gaussians)?;
    let cells: Vec<Range<usize>> = bounds.windows(2).map(|w| w[0]..w[1]).collect();
    let moments_of =
        |c: &Range<usize>| Moments::from_points(&store.xyz[c.clone()], store.weight.as_ref().map(|w| &w[c.clone()]));
    let moments = parallel::map(&cells, moments_of);
    Ok(Partition { store, cells, moments })
}

struct PartitionBuilder<'a> {
    blur: Blur,
    context: &'a Context<'a>,
}

/// Cuts of a branch, and cells that it leaves for later rounds.
#[derive(Default)]
struct Branch {
    made: Vec<CutRecord>,
    pending: Vec<PendingCell>,
}

impl Branch {
    fn append(&mut self, mut other: Branch) {
        self.made.append(&mut other.made);
        self.pending.append(&mut other.pending);
    }
}

struct ParticleCell<'a> {
    start: usize,
    xyz: &'a mut [[f32; 3]],
    weight: Option<&'a mut [f32]>,
}

impl<'a> ParticleCell<'a> {
    fn halves(self, mid: usize) -> [ParticleCell<'a>; 2] {
        let at = mid - self.start;
        let (a, b) = self.xyz.split_at_mut(at);
        let (wa, wb) = match self.weight {
            Some(w) => {
                let (a, b) = w.split_at_mut(at);
                (Some(a), Some(b))
            }
            None => (None, None),
        };
        [ParticleCell { start: self.start, xyz: a, weight: wa }, ParticleCell { start: mid, xyz: b, weight: wb }]
    }
}

impl PartitionBuilder<'_> {
    /// Cell boundaries, ascending, first 0 and last N.
    fn grow(&self, store: &mut ParticleStore, gaussians: usize) -> Result<Vec<usize>> {
        let n = store.len();
        let enough = (gaussians as f64 * SPARE).ceil() as usize;
        self.context.begin("partitioning", enough as u64);
        let whole = Moments::quick(self.context.simd(), &store.xyz);
        let root = ParticleCell { start: 0, xyz: &mut store.xyz, weight: store.weight.as_deref_mut() };
        let mut all = Branch::default();
        // No gain reaches an infinite threshold: the root is cut, and its halves wait for the first round.
        self.examine(root, whole, f64::INFINITY, &mut all)?;
        let mut threshold = Threshold::new();
        while all.made.len() + 1 < enough && !all.pending.is_empty() {
            let least = threshold.next(&all, enough);
            let (ready_cells, waiting_cells): (Vec<_>, Vec<_>) = all.pending.into_iter().partition(|p| p.gain >= least);
            all.pending = waiting_cells;
            let cuts_before = all.made.len();
            for branch in self.round(store, ready_cells, least) {
                all.append(branch?);
            }
            self.context.advance((all.made.len() - cuts_before) as u64);
        }
        self.context.end();
        drop(all.pending);
        // Each cut makes one cell more.
        let mut bounds = best_cuts(all.made, gaussians - 1);
        bounds.extend([0, n]);
        bounds.sort_unstable();
        Ok(bounds)
    }

    /// Cuts the pending cells down to `threshold`, in the order of the store.
    fn round(
        &self,
        store: &mut ParticleStore,
        mut pending_cells: Vec<PendingCell>,
        threshold: f64,
    ) -> Vec<Result<Branch>> {
        // In the store's order: each cell's slices are split off what is left of the store.
        pending_cells.sort_unstable_by_key(|p| p.start);
        let mut cells = Vec::with_capacity(pending_cells.len());
        let (mut xyz, mut weight) = (&mut store.xyz[..], store.weight.as_deref_mut());
        let mut at = 0;
        for p in pending_cells {
            let (skip, len) = (p.start - at, p.end - p.start);
            let xyz_split = xyz.split_at_mut(skip).1.split_at_mut(len);
            xyz = xyz_split.1;
            let w = weight.map(|w| w.split_at_mut(skip).1.split_at_mut(len));
            let (w_here, w_rest) = w.unzip();
            weight = w_rest;
            at = p.end;
            let cell = ParticleCell { start: p.start, xyz: xyz_split.0, weight: w_here };
            cells.push((cell, p));
        }
        parallel::map(cells, |(cell, p)| {
            let mut out = Branch::default();
            self.context.check()?;
            out.made.push(CutRecord { start: p.start, mid: p.mid, end: p.end, gain: p.gain });
            for half in cell.halves(p.mid) {
                let moments = Moments::quick(self.context.simd(), half.xyz);
                self.examine(half, moments, threshold, &mut out)?;
            }
            Ok(out)
        })
    }

    /// Cuts a cell, and its halves in turn while cuts gain at least `threshold`.
    fn examine(&self, cell: ParticleCell<'_>, moments: Moments, threshold: f64, out: &mut Branch) -> Result<()> {
        let mut cell = cell;
        let simd = self.context.simd();
        let Some(cut) = Cut::best(simd, cell.xyz, &moments, self.blur) else { return Ok(()) };
        let len = cut.apply(simd, cell.xyz, cell.weight.as_deref_mut());
        let a = Moments::quick(simd, &cell.xyz[..len]);
        let b = Moments::quick(simd, &cell.xyz[len..]);
        let [whole, first, second] = [&moments, &a, &b].map(PictureGaussian::from);
        // Never 0: thresholds follow each other by their ratio.
        let gain = self.blur.difference(&whole, &first, &second).max(f64::MIN_POSITIVE);
        let (start, mid, end) = (cell.start, cell.start + len, cell.start + cell.xyz.len());
        // The cell is cut in any case, which only reorders it; its halves wait until the threshold has come down.
        if gain < threshold {
            out.pending.push(PendingCell { start, mid, end, gain });
            return Ok(());
        }
        out.made.push(CutRecord { start, mid, end, gain });
        let large = cell.xyz.len() > PARALLEL;
        let [first, second] = cell.halves(mid);
        if !large {
            self.examine(first, a, threshold, out)?;
            return self.examine(second, b, threshold, out);
        }
        self.context.check()?;
        let mut other = Branch::default();
        let (x, y) = parallel::join(
            || self.examine(first, a, threshold, out),
            || self.examine(second, b, threshold, &mut other),
        );
        // In the order of the halves, whichever thread ends first.
        out.append(other);
        x.and(y)
    }
}

/// The gain down to which a round cuts.
struct Threshold {
    /// The last round's threshold.
    last: Option<f64>,
    /// The threshold of the round before and the cuts that were made after it.
    before: Option<(f64, usize)>,
}

impl Threshold {
    fn new() -> Self {
        Threshold { last: None, before: None }
    }

    /// The number of cuts grows like a power of 1 / threshold, which the last two rounds tell:
    /// eight times more cuts a round at most, and the last round just past `enough` cells.
    fn next(&mut self, all: &Branch, enough: usize) -> f64 {
        let largest = all.pending.iter().map(|p| p.gain).fold(0.0, f64::max);
        let cut_count = all.made.len();
        let next = match (self.last, self.before) {
            (Some(t1), Some((t0, m0))) if cut_count > m0 && m0 > 0 && t0 > t1 => {
                let power = (libm::log(cut_count as f64 / m0 as f64) / libm::log(t0 / t1)).clamp(0.1, 4.0);
                // 2 % beyond what is wanted, so that no further round is needed for the last few cells.
                let growth = (1.02 * enough as f64 / (cut_count + 1) as f64).clamp(1.05, 8.0);
                t1 / libm::pow(growth, 1.0 / power)
            }
            (Some(t1), _) => t1 / 4.0,
            _ => largest,
        };
        let next = next.min(largest);
        self.before = self.last.map(|t| (t, cut_count));
        self.last = Some(next);
        next
    }
}
