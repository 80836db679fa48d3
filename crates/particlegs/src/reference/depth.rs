//! The noise-free optical depth of all particles, tau* (spec: response.md, section 1).
//!
//! Splats are sorted into bands of rows and added in particle order, so that the sum does not
//! depend on threads. Where many splats are large they go to coarser planes, which are then
//! interpolated up and added: the cost stays O(particles + pixels x levels).

use super::bands::{Sorted, Sorter};
use super::deposit::{Depositor, PixelSplat, Profiles};
use super::project::{BLOCK, Block, Projector};
use super::pyramid::{Level, Pyramid};
use crate::particles::{CHUNK, Chunk, Particles};
use crate::picture::{Plane, Size};
use crate::progress::Progress;
use crate::{Error, Result};
use rayon::prelude::*;

/// Chunks of particles whose splats are held at a time.
const CHUNKS_AT_ONCE: usize = 32;

/// Splats whose deviation is below this (pixels) are always drawn at full resolution; coarser
/// planes are chosen so that it lies between half of this and this.
const LARGE_SIGMA: f32 = 16.0;

/// Large splats of one octave are drawn at full resolution while they make at most this many
/// deposits: a second or so, or 256 splats on every pixel in the mean, where the picture is white
/// at common opacities. Coarse planes blur the steps at the edges of their squares.
const DIRECT_DEPOSITS: f64 = 1e9;
const DIRECT_COVER: f64 = 256.0;

/// How many deposits an octave may make at full resolution.
pub(super) fn direct_deposits(size: Size, opacity: f64) -> f64 {
    // The steps weigh with the opacity.
    DIRECT_DEPOSITS.max(DIRECT_COVER * size.pixels() as f64) * (opacity / 0.05).clamp(1.0, 4.0)
}

const OCTAVES: usize = 24;

/// tau* of all particles for a projected view. Octaves of large splats that would make more than
/// `direct` deposits go to coarser planes.
///
/// # Errors
/// [`Error::Cancelled`] where the caller stops.
pub(super) fn optical_depth(
    particles: &Particles,
    projector: &Projector,
    size: Size,
    opacity: f64,
    direct: f64,
    progress: &dyn Progress,
) -> Result<Plane> {
    let job = Job::new(particles, projector, size, direct, progress);
    let mut pyramid = Pyramid::new(size, job.deepest());
    let depositor = Depositor::new(opacity);
    let chunks = particles.len().div_ceil(CHUNK);
    for first in (0..chunks).step_by(CHUNKS_AT_ONCE) {
        let sorted = job.sorted(first..chunks.min(first + CHUNKS_AT_ONCE), &pyramid)?;
        let parts: Vec<Result<()>> = pyramid
            .bands_mut()
            .into_par_iter()
            .map_init(Profiles::default, |profiles, (band, level, mut rows)| {
                progress.check()?;
                for chunk in &sorted {
                    depositor.add(chunk.band(band).iter().map(|s| level.to_level(s)), &mut rows, profiles);
                }
                Ok(())
            })
            .collect();
        parts.into_iter().collect::<Result<()>>()?;
    }
    Ok(pyramid.collapse())
}

struct Job<'a> {
    particles: &'a Particles,
    projector: &'a Projector,
    size: Size,
    progress: &'a dyn Progress,
    /// Plane that splats with a deviation of `2^octave` pixels go to.
    level: [u8; OCTAVES],
}

impl<'a> Job<'a> {
    fn new(
        particles: &'a Particles,
        projector: &'a Projector,
        size: Size,
        direct: f64,
        progress: &'a dyn Progress,
    ) -> Self {
        let mut job = Job { particles, projector, size, progress, level: [0; OCTAVES] };
        for (octave, cover) in job.cover_by_octave().into_iter().enumerate() {
            if cover > direct {
                let excess = octave as i32 + 1 - LARGE_SIGMA.log2() as i32;
                job.level[octave] = excess.clamp(0, 12) as u8;
            }
        }
        job
    }

    fn deepest(&self) -> usize {
        usize::from(self.level.iter().copied().max().unwrap_or(0))
    }

    /// Pixels that the splats of each octave cover together, judged by a sample of the particles.
    fn cover_by_octave(&self) -> [f64; OCTAVES] {
        const RUN: usize = 1024;
        let n = self.particles.len();
        let stride = (n / (RUN * 256)).max(1) * RUN;
        let (mut cover, mut buffer, mut sampled) = ([0.0; OCTAVES], Default::default(), 0);
        for start in (0..n).step_by(stride) {
            let chunk = self.particles.chunk(start..n.min(start + RUN), &mut buffer);
            sampled += chunk.len();
            self.for_splats(chunk, |splat| {
                let [sx, sy] = splat.sigma();
                cover[octave(sx.min(sy))] += (36.0 * f64::from(sx) * f64::from(sy)).min(self.size.pixels() as f64);
            });
        }
        cover.map(|c| c * n as f64 / sampled.max(1) as f64)
    }

    /// The splats of some chunks by chunk and band.
    fn sorted(&self, chunks: std::ops::Range<usize>, pyramid: &Pyramid) -> Result<Vec<Sorted<PixelSplat>>> {
        let n = self.particles.len();
        let parts: Vec<Result<_>> = chunks
            .into_par_iter()
            .map_init(Default::default, |buffer, c| {
                self.progress.check()?;
                let chunk = self.particles.chunk(c * CHUNK..n.min((c + 1) * CHUNK), buffer);
                let mut sorter = Sorter::default();
                self.for_splats(chunk, |splat| {
                    let [sx, sy] = splat.sigma();
                    let level = usize::from(self.level[octave(sx.min(sy))]);
                    let [first, end] = pyramid.bands_of(level, splat);
                    sorter.push(*splat, first, end);
                });
                Ok::<_, Error>(sorter.sort(pyramid.bands()))
            })
            .collect();
        parts.into_iter().collect()
    }

    /// Projects a chunk and calls `work` with every splat that reaches into the picture.
    fn for_splats(&self, chunk: Chunk<'_>, mut work: impl FnMut(&PixelSplat)) {
        let (w, h) = (self.size.width as f32, self.size.height as f32);
        let mut block = Box::new(Block::default());
        for start in (0..chunk.len()).step_by(BLOCK) {
            let end = chunk.len().min(start + BLOCK);
            self.projector.project(chunk.position.map(|c| &c[start..end]), &mut block);
            for i in 0..end - start {
                let Some(s) = block.splat(i) else { continue };
                let [a, b, c, d] = s.axes;
                let splat = PixelSplat {
                    x: (s.x + 1.0) * 0.5 * w,
                    y: (s.y + 1.0) * 0.5 * h,
                    axes: [a * 0.5 * w, b * 0.5 * w, c * 0.5 * h, d * 0.5 * h],
                };
                let [rx, ry] = splat.reach();
                let inside = splat.x + rx > 0.0 && splat.x - rx < w && splat.y + ry > 0.0 && splat.y - ry < h;
                if inside && rx > 0.0 && ry > 0.0 && rx.is_finite() && ry.is_finite() {
                    work(&splat);
                }
            }
        }
    }
}

/// floor(log2 sigma), 0 for anything below 2.
#[inline]
fn octave(sigma: f32) -> usize {
    (((sigma.to_bits() >> 23) as i32) - 127).clamp(0, OCTAVES as i32 - 1) as usize
}

impl Level {
    /// A splat of the picture in this plane's pixels.
    #[inline(always)]
    fn to_level(&self, splat: &PixelSplat) -> PixelSplat {
        if self.shift == 0 { *splat } else { splat.scaled(0.5f32.powi(self.shift as i32)) }
    }
}
