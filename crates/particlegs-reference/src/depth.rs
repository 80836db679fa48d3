//! The noise-free optical depth of all particles, tau* (docs/law/depth.md).
//!
//! Splats are sorted into bands of rows and added in particle order, so that the sum does not
//! depend on threads. Where many splats are large they go to coarser planes, which are then
//! interpolated up and added: the cost stays O(particles + pixels x levels).

use super::bands::{BandSorter, BandedSplats, visit_sample};
use super::deposit::{Depositor, PixelSplat, Profiles, SMALL_SIGMA};
use super::project::{BLOCK, DIAGONAL_LIMIT, ProjectedBlock, Projector};
use super::pyramid::{Pyramid, PyramidLevel};
use fearless_simd::{Simd, dispatch};
use particlegs_core::context::Context;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{CHUNK, Chunk, Particles};

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

/// The most deposits that an octave may make at full resolution.
pub(super) fn direct_deposits(size: Size, opacity: f64) -> f64 {
    // The steps weigh with the opacity.
    DIRECT_DEPOSITS.max(DIRECT_COVER * size.pixels() as f64) * (opacity / 0.05).clamp(1.0, 4.0)
}

const OCTAVES: usize = 24;

/// tau* of all particles for a projected view. Octaves of large splats that would make more than
/// `direct` deposits go to coarser planes.
pub(super) fn optical_depth(
    particles: &Particles,
    projector: &Projector,
    size: Size,
    opacity: f64,
    direct: f64,
    context: &Context<'_>,
) -> Result<Plane> {
    let job = DepthJob::new(particles, projector, size, direct, context);
    let mut pyramid = Pyramid::new(size, job.deepest());
    let (depositor, simd) = (Depositor::new(opacity), context.simd());
    let chunks = particles.len().div_ceil(CHUNK);
    let steps = chunks + chunks.div_ceil(CHUNKS_AT_ONCE) * pyramid.bands();
    context.begin("noise-free picture", steps as u64);
    let profiles = parallel::Scratch::<Profiles>::default();
    for first in (0..chunks).step_by(CHUNKS_AT_ONCE) {
        let sorted = job.sorted(first..chunks.min(first + CHUNKS_AT_ONCE), &pyramid)?;
        parallel::try_for_each(pyramid.bands_mut(), |(band, level, mut rows)| {
            for (small, chunk) in &sorted {
                context.check()?;
                depositor.add_small(small.band(band), &mut rows);
                let splats = chunk.band(band).iter().map(|s| level.place(s));
                profiles.with(|profiles| depositor.add(simd, splats, &mut rows, profiles));
            }
            context.advance(1);
            Ok(())
        })?;
    }
    context.end();
    Ok(pyramid.collapse())
}

struct DepthJob<'a> {
    particles: &'a Particles,
    projector: &'a Projector,
    size: Size,
    context: &'a Context<'a>,
    /// Plane that splats with a deviation of `2^octave` pixels go to.
    level: [u8; OCTAVES],
}

impl<'a> DepthJob<'a> {
    fn new(
        particles: &'a Particles,
        projector: &'a Projector,
        size: Size,
        direct: f64,
        context: &'a Context<'a>,
    ) -> Self {
        let mut job = DepthJob { particles, projector, size, context, level: [0; OCTAVES] };
        for (octave, cover) in job.cover_by_octave().into_iter().enumerate() {
            if cover > direct {
                // So many halvings bring the deviation below `LARGE_SIGMA`.
                let excess = octave as i32 + 1 - libm::log2f(LARGE_SIGMA) as i32;
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
        let mut cover = [0.0; OCTAVES];
        let sampled = visit_sample(self.particles, |chunk| {
            self.for_splats(chunk, |splat, _| {
                let [sx, sy] = splat.sigma();
                // A splat's square is six deviations wide, and the picture holds no more of it than its pixels.
                cover[octave(sx.min(sy))] += (36.0 * f64::from(sx) * f64::from(sy)).min(self.size.pixels() as f64);
            });
        });
        cover.map(|c| c * self.particles.len() as f64 / sampled.max(1) as f64)
    }

    /// The splats of some chunks by chunk and band, small ones apart.
    fn sorted(&self, chunks: std::ops::Range<usize>, pyramid: &Pyramid) -> Result<Vec<SplatsByBand>> {
        let n = self.particles.len();
        let buffers = parallel::Scratch::default();
        parallel::try_map(chunks, |c| {
            self.context.check()?;
            buffers.with(|buffer| {
                let chunk = self.particles.chunk(c * CHUNK..n.min((c + 1) * CHUNK), buffer);
                let (mut small, mut others) = (BandSorter::with_capacity(chunk.len()), BandSorter::default());
                self.for_splats(chunk, |splat, is_small| {
                    let [sx, sy] = splat.sigma();
                    if is_small {
                        let [first, end] = pyramid.bands_of(0, splat.y, 3.0 * sy);
                        small.push([splat.x, splat.y, sx, sy], first, end);
                    } else {
                        let level = usize::from(self.level[octave(sx.min(sy))]);
                        let [first, end] = pyramid.bands_of(level, splat.y, splat.reach()[1]);
                        others.push(*splat, first, end);
                    }
                });
                self.context.advance(1);
                Ok::<_, Error>((small.sort(pyramid.bands()), others.sort(pyramid.bands())))
            })
        })
    }

    /// Projects a chunk and calls `work` with every splat that reaches into the picture, and
    /// whether it is a small aligned one.
    fn for_splats(&self, chunk: Chunk<'_>, mut work: impl FnMut(&PixelSplat, bool)) {
        let (w, h) = (self.size.width as f32, self.size.height as f32);
        let simd = self.context.simd();
        let (mut block, mut screen) = (Box::new(ProjectedBlock::default()), Box::new(Screen::default()));
        for start in (0..chunk.len()).step_by(BLOCK) {
            let end = chunk.len().min(start + BLOCK);
            self.projector.project(simd, chunk.position.map(|c| &c[start..end]), &mut block);
            dispatch!(simd, simd => screen_kernel(simd, &block, [w, h], &mut screen));
            for i in 0..end - start {
                match screen.kind[i] {
                    OUTSIDE => {}
                    SMALL => {
                        let axes = [screen.sigma_x[i], 0.0, 0.0, screen.sigma_y[i]];
                        work(&PixelSplat { x: screen.x[i], y: screen.y[i], axes }, true);
                    }
                    _ => {
                        let Some(s) = block.splat(i) else { continue };
                        let [a, b, c, d] = s.axes;
                        let axes = [a * 0.5 * w, b * 0.5 * w, c * 0.5 * h, d * 0.5 * h];
                        let splat = PixelSplat { x: screen.x[i], y: screen.y[i], axes };
                        let [rx, ry] = splat.reach();
                        let inside = splat.x + rx > 0.0 && splat.x - rx < w && splat.y + ry > 0.0 && splat.y - ry < h;
                        // A splat next to the eye may be wider than float32 holds.
                        if inside && rx > 0.0 && ry > 0.0 && rx.is_finite() && ry.is_finite() {
                            work(&splat, false);
                        }
                    }
                }
            }
        }
    }
}

/// A chunk's splats by band: small ones `[x, y, sigma_x, sigma_y]`, and all others.
type SplatsByBand = (BandedSplats<[f32; 4]>, BandedSplats<PixelSplat>);

const OUTSIDE: u8 = 0;
const SMALL: u8 = 1;
const OTHER: u8 = 2;

/// A block in pixels, rows upward.
struct Screen {
    x: [f32; BLOCK],
    y: [f32; BLOCK],
    sigma_x: [f32; BLOCK],
    sigma_y: [f32; BLOCK],
    kind: [u8; BLOCK],
}

impl Default for Screen {
    fn default() -> Self {
        let zero = [0.0; BLOCK];
        Screen { x: zero, y: zero, sigma_x: zero, sigma_y: zero, kind: [OUTSIDE; BLOCK] }
    }
}

#[inline(always)]
fn screen_kernel<S: Simd>(_simd: S, block: &ProjectedBlock, [w, h]: [f32; 2], out: &mut Screen) {
    for i in 0..BLOCK {
        let (x, y) = ((block.x[i] + 1.0) * 0.5 * w, (block.y[i] + 1.0) * 0.5 * h);
        let (sx, sy) = (block.c00[i].sqrt() * 0.5 * w, block.c11[i].sqrt() * 0.5 * h);
        (out.x[i], out.y[i], out.sigma_x[i], out.sigma_y[i]) = (x, y, sx, sy);
        let aligned = block.c01[i].abs() <= DIAGONAL_LIMIT;
        // Half a pixel is all that a small splat reaches.
        let near = (x > -0.5) & (x < w + 0.5) & (y > -0.5) & (y < h + 0.5);
        let small = aligned & (sx <= SMALL_SIGMA) & (sy <= SMALL_SIGMA) & (sx > 0.0) & (sy > 0.0);
        let kind = if small { if near { SMALL } else { OUTSIDE } } else { OTHER };
        out.kind[i] = if block.c00[i] >= 0.0 { kind } else { OUTSIDE };
    }
}

/// floor(log2 sigma), 0 for anything below 2.
#[inline]
fn octave(sigma: f32) -> usize {
    // The exponent's bits of a float32 that is not negative.
    (((sigma.to_bits() >> 23) as i32) - 127).clamp(0, OCTAVES as i32 - 1) as usize
}

impl PyramidLevel {
    /// A splat of the picture in this plane's pixels.
    #[inline(always)]
    fn place(&self, splat: &PixelSplat) -> PixelSplat {
        if self.shift == 0 { *splat } else { splat.scaled(self.scale) }
    }
}
