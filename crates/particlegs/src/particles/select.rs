//! Which particles a conversion keeps: a crop, every K-th, an exact random sample; in this order.
//!
//! Work goes by fixed chunks of the tiled snapshot ("runs"); what a run keeps depends on the run's
//! number and on whole-number sums over the runs before it, never on threads.

use super::storage::CHUNK;
use super::{Bounds, ChunkBuffer, Particles, Tiling};
use crate::math::Random;
use crate::progress::Progress;
use crate::{Error, Result};
use rayon::prelude::*;

/// What to keep of a tiled snapshot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Keep positions with min <= p < max along each axis, as written (f32).
    pub crop: Option<Bounds>,
    /// Then keep the first of every so many, in order.
    pub every: u64,
    /// Then keep exactly so many, drawn at random; order is kept.
    pub sample: Option<u64>,
    /// Seed of the draw.
    pub seed: u64,
}

impl Selection {
    /// Keeps all.
    pub fn all() -> Self {
        Selection { crop: None, every: 1, sample: None, seed: 0 }
    }
}

/// A run's particles, as they are to be written; reused from run to run.
#[derive(Default)]
pub(super) struct Run {
    /// x, y, z, then weights (empty where there are none).
    pub columns: [Vec<f32>; 4],
    kept: Vec<u32>,
    buffer: ChunkBuffer,
}

/// The draw's place in the order of keys: a particle is drawn where its own is not above.
type Key = (u64, u64, u32);

/// Runs of a tiled snapshot and what each keeps.
pub(super) struct Plan<'a> {
    particles: &'a Particles,
    tiling: Tiling,
    selection: Selection,
    /// Particles inside the crop in the runs before each run; empty without a crop.
    cropped_before: Vec<u64>,
    /// The last key drawn.
    last_key: Option<Key>,
    /// Particles kept in the runs before each run, and in all.
    first: Vec<u64>,
}

impl<'a> Plan<'a> {
    /// Counts what every run keeps.
    ///
    /// # Errors
    /// [`Error::Argument`] where a sample is larger than what there is, or nothing is left;
    /// [`Error::Cancelled`].
    pub fn new(
        particles: &'a Particles,
        tiling: Tiling,
        selection: Selection,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if selection.every == 0 {
            return Err(Error::argument("keeping every 0th particle keeps none; 1 keeps all"));
        }
        let mut plan =
            Plan { particles, tiling, selection, cropped_before: Vec::new(), last_key: None, first: Vec::new() };
        if selection.crop.is_some() {
            plan.cropped_before = running_sums(plan.count_runs(progress, |plan, run, id| {
                plan.fill(id, run)?;
                Ok(plan.inside(run).count() as u64)
            })?);
        }
        if let Some(wanted) = selection.sample {
            plan.last_key = plan.draw(wanted, progress)?;
        }
        plan.first = if selection == (Selection { seed: selection.seed, ..Selection::all() }) {
            running_sums((0..plan.runs()).map(|id| plan.range(id).len() as u64).collect())
        } else {
            running_sums(plan.count_runs(progress, |plan, run, id| {
                plan.keep(id, run)?;
                Ok(run.kept.len() as u64)
            })?)
        };
        if plan.total() == 0 {
            return Err(Error::argument("no particle is left: nothing was written"));
        }
        Ok(plan)
    }

    /// Number of runs.
    pub fn runs(&self) -> u64 {
        self.runs_a_tile() * self.tiling.tiles()
    }

    /// Number of particles kept.
    pub fn total(&self) -> u64 {
        self.first.last().copied().unwrap_or(0)
    }

    /// Where in the output run `id` begins.
    pub fn first(&self, id: u64) -> u64 {
        self.first[id as usize]
    }

    /// Fills `run` with what run `id` keeps.
    ///
    /// # Errors
    /// [`Error::Input`] where a position does not fit into f32.
    pub fn load(&self, id: u64, run: &mut Run) -> Result<()> {
        self.keep(id, run)?;
        if run.kept.len() < run.columns[0].len() {
            for column in run.columns.iter_mut().filter(|c| !c.is_empty()) {
                for (to, &from) in run.kept.iter().enumerate() {
                    column[to] = column[from as usize];
                }
                column.truncate(run.kept.len());
            }
        }
        Ok(())
    }

    fn runs_a_tile(&self) -> u64 {
        self.particles.len().div_ceil(CHUNK) as u64
    }

    /// The particles of run `id`.
    fn range(&self, id: u64) -> std::ops::Range<usize> {
        let start = (id % self.runs_a_tile()) as usize * CHUNK;
        start..self.particles.len().min(start + CHUNK)
    }

    /// All particles of run `id`, shifted to their tile and rounded to f32.
    fn fill(&self, id: u64, run: &mut Run) -> Result<()> {
        let shift = self.tiling.shift(id / self.runs_a_tile());
        let chunk = self.particles.chunk(self.range(id), &mut run.buffer);
        for k in 0..3 {
            let offset = self.particles.origin[k] + shift[k];
            run.columns[k].clear();
            run.columns[k].extend(chunk.position[k].iter().map(|&v| (f64::from(v) + offset) as f32));
            if run.columns[k].iter().any(|v| !v.is_finite()) {
                return Err(Error::input(&self.particles.meta.name, "positions that do not fit into float32"));
            }
        }
        run.columns[3].clear();
        run.columns[3].extend_from_slice(chunk.weight.unwrap_or(&[]));
        Ok(())
    }

    /// The particles of a filled run that are inside the crop.
    fn inside<'r>(&self, run: &'r Run) -> impl Iterator<Item = u32> + use<'r> {
        let crop = self.selection.crop;
        let [x, y, z, _] = &run.columns;
        (0..x.len() as u32).filter(move |&i| {
            let p = [x, y, z].map(|c| f64::from(c[i as usize]));
            crop.is_none_or(|b| (0..3).all(|k| b.min[k] <= p[k] && p[k] < b.max[k]))
        })
    }

    /// Fills run `id` and lists what survives crop and thinning, before any draw.
    fn thin(&self, id: u64, run: &mut Run) -> Result<()> {
        self.fill(id, run)?;
        let before = self.cropped_before.get(id as usize).copied();
        // Without a crop the particle's own number counts.
        let before = before.unwrap_or_else(|| {
            let tile = id / self.runs_a_tile();
            tile * self.particles.len() as u64 + self.range(id).start as u64
        });
        let mut kept = std::mem::take(&mut run.kept);
        kept.clear();
        let every = self.selection.every;
        kept.extend((before..).zip(self.inside(run)).filter(|(rank, _)| rank % every == 0).map(|(_, i)| i));
        run.kept = kept;
        Ok(())
    }

    /// Fills run `id` and lists what it keeps.
    fn keep(&self, id: u64, run: &mut Run) -> Result<()> {
        self.thin(id, run)?;
        if let Some(last) = self.last_key {
            let keys = self.keys(id);
            run.kept.retain(|&i| (keys[i as usize], id, i) <= last);
        }
        Ok(())
    }

    /// The random keys of run `id`'s particles.
    fn keys(&self, id: u64) -> Vec<u64> {
        const PURPOSE: u32 = 0x7361_6d70;
        let mut random = Random::new(self.selection.seed, PURPOSE, id);
        self.range(id).map(|_| random.bits()).collect()
    }

    /// The largest of the `wanted` smallest keys: a histogram of their leading bits, then an exact
    /// look at the one bin in which it lies. `None` where all are wanted.
    fn draw(&self, wanted: u64, progress: &dyn Progress) -> Result<Option<Key>> {
        const SHIFT: u32 = 64 - 16;
        let histogram = (0..self.runs())
            .into_par_iter()
            .try_fold(
                || (Run::default(), vec![0u64; 1 << 16]),
                |(mut run, mut bins), id| {
                    progress.check()?;
                    self.thin(id, &mut run)?;
                    let keys = self.keys(id);
                    run.kept.iter().for_each(|&i| bins[(keys[i as usize] >> SHIFT) as usize] += 1);
                    Ok((run, bins))
                },
            )
            .map(|r| r.map(|(_, bins)| bins))
            .try_reduce(
                || vec![0u64; 1 << 16],
                |a, b| Ok::<_, Error>(a.iter().zip(&b).map(|(x, y)| x + y).collect()),
            )?;
        let available: u64 = histogram.iter().sum();
        if wanted == 0 || wanted > available {
            return Err(Error::argument(format!(
                "a sample of {wanted} is outside 1 to {available}, the particles there are"
            )));
        }
        let mut left = wanted;
        let bin = histogram.iter().position(|&n| {
            let here = left <= n;
            left -= if here { 0 } else { n };
            here
        });
        let bin = bin.unwrap_or(histogram.len() - 1) as u64;
        let parts: Vec<Vec<Key>> = (0..self.runs())
            .into_par_iter()
            .map_init(Run::default, |run, id| {
                progress.check()?;
                self.thin(id, run)?;
                let keys = self.keys(id);
                let own = run.kept.iter().map(|&i| (keys[i as usize], id, i));
                Ok(own.filter(|k| k.0 >> SHIFT == bin).collect())
            })
            .collect::<Result<_>>()?;
        let mut keys: Vec<Key> = parts.into_iter().flatten().collect();
        keys.sort_unstable();
        Ok(keys.get(left as usize - 1).copied())
    }

    fn count_runs(
        &self,
        progress: &dyn Progress,
        count: impl Fn(&Self, &mut Run, u64) -> Result<u64> + Sync,
    ) -> Result<Vec<u64>> {
        (0..self.runs())
            .into_par_iter()
            .map_init(Run::default, |run, id| {
                progress.check()?;
                count(self, run, id)
            })
            .collect()
    }
}

/// 0, a, a + b, ...: one longer than the input.
fn running_sums(counts: Vec<u64>) -> Vec<u64> {
    let mut sums = vec![0];
    let mut sum = 0;
    sums.extend(counts.iter().map(|c| {
        sum += c;
        sum
    }));
    sums
}
