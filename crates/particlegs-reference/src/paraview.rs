//! ParaView's picture before FXAA, exactly: project, sort into bands of rows, gather every pixel's
//! fragments in particle order, blend (docs/law/splat.md).

use super::bands::{BandSorter, BandedSplats, visit_sample};
use super::blend::blend;
use super::project::{BLOCK, DIAGONAL_LIMIT, NdcSplat, ProjectedBlock, Projector};
use super::quad::{Quad, WIDE, first_pixel, snap};
use fearless_simd::{Simd, dispatch};
use particlegs_core::context::Context;
use particlegs_core::memory::reserved;
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::splat::{CUT_SIGMA, PEELS};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::memory::require;
use particlegs_particles::{CHUNK, Chunk, Particles};
use std::ops::Range;

/// Rows of a band.
const BAND_ROWS: usize = 16;

/// Fragments that one task gathers at a time (8 bytes each), unless a single row has more.
const FRAGMENTS_AT_ONCE: usize = 4 << 20;

/// Splats gathered between two looks at whether to stop.
const CHECK: usize = 512;

/// Bytes of splats that may be held at a time for any snapshot.
pub(super) const LEAST_BUDGET: u64 = 512 << 20;

/// ParaView's picture of all particles without FXAA.
pub(super) fn draw(
    particles: &Particles,
    projector: &Projector,
    size: Size,
    opacity: f32,
    budget: u64,
    context: &Context<'_>,
) -> Result<Gray8> {
    let scene = ParaviewScene { particles, projector, size, opacity, budget, context };
    let (picture, wrote) = scene.render(PEELS, true)?;
    // VTK stops once a whole peel writes no back layer anywhere, and blends no rest then: only in
    // nearly empty or nearly transparent pictures, which are drawn again with fewer peels.
    match (0..PEELS).find(|&k| wrote >> k & 1 == 0) {
        Some(empty) => Ok(scene.render(empty + 1, false)?.0),
        None => Ok(picture),
    }
}

struct ParaviewScene<'a> {
    particles: &'a Particles,
    projector: &'a Projector,
    size: Size,
    opacity: f32,
    /// Bytes of splats held at a time.
    budget: u64,
    context: &'a Context<'a>,
}

#[derive(Default)]
struct FragmentScratch {
    first: Vec<u64>,
    next: Vec<usize>,
    depth: Vec<f32>,
    alpha: Vec<f32>,
    /// Alphas of one splat in one row.
    shapes: Vec<f32>,
}

/// A band of rows of the picture, and the splats that reach it.
struct PictureBand<'a> {
    /// The splats of the band's group, by chunk of particles.
    chunks: &'a [BandedSplats<NdcSplat>],
    /// The band's number in the group.
    number: usize,
    /// The band's lowest row.
    first_row: usize,
}

impl PictureBand<'_> {
    /// In particle order.
    fn splats(&self) -> impl Iterator<Item = &NdcSplat> {
        self.chunks.iter().flat_map(|c| c.band(self.number))
    }
}

impl ParaviewScene<'_> {
    /// The picture, and which peels wrote a back layer anywhere.
    fn render(&self, peels: usize, rest: bool) -> Result<(Gray8, u8)> {
        let (width, height) = (self.size.width, self.size.height);
        let mut upward = vec![0u8; self.size.pixels()];
        let mut wrote = 0;
        let groups = self.groups();
        let chunks = self.particles.len().div_ceil(CHUNK);
        self.context.begin("ParaView's picture", (groups.len() * chunks + self.bands()) as u64);
        let spaces = parallel::Scratch::<FragmentScratch>::default();
        for group in groups {
            let chunks = self.sorted(group.clone())?;
            let rows = group.start * BAND_ROWS..height.min(group.end * BAND_ROWS);
            let bands = upward[rows.start * width..rows.end * width].chunks_mut(BAND_ROWS * width).enumerate();
            let parts = parallel::try_map(bands, |(number, out)| {
                let band = PictureBand { chunks: &chunks, number, first_row: (group.start + number) * BAND_ROWS };
                let wrote = spaces.with(|scratch| self.draw_band(&band, out, scratch, peels, rest))?;
                self.context.advance(1);
                Ok::<u8, Error>(wrote)
            })?;
            wrote = parts.into_iter().fold(wrote, |all, part| all | part);
        }
        self.context.end();
        let mut data = Vec::with_capacity(upward.len());
        // Window coordinates go up, rows of pictures go down.
        upward.chunks_exact(width).rev().for_each(|row| data.extend_from_slice(row));
        Ok((Gray8 { size: self.size, data }, wrote))
    }

    fn bands(&self) -> usize {
        self.size.height.div_ceil(BAND_ROWS)
    }

    /// Runs of bands whose splats fit the budget together, judged by a sample of the particles.
    fn groups(&self) -> Vec<Range<usize>> {
        let n = self.particles.len();
        let budget = (self.budget / size_of::<NdcSplat>() as u64) as usize;
        let bands = self.bands();
        // Even every particle in two bands fits: no need to look.
        if n * 2 <= budget && self.projector.radius_pixels_at_most(self.size) < BAND_ROWS as f32 / 6.0 {
            return std::iter::once(0..bands).collect();
        }
        let mut count = vec![0u64; bands];
        let sampled = visit_sample(self.particles, |chunk| {
            let mut sorter = BandSorter::default();
            self.cull(chunk, 0..bands, &mut sorter);
            let sorted = sorter.sort(bands);
            for (band, total) in count.iter_mut().enumerate() {
                *total += sorted.band(band).len() as u64;
            }
        });
        let scale = n as f64 / sampled.max(1) as f64;
        let (mut groups, mut start, mut held) = (Vec::new(), 0, 0.0);
        for (band, &c) in count.iter().enumerate() {
            let more = c as f64 * scale;
            if held + more > budget as f64 && band > start {
                groups.push(start..band);
                (start, held) = (band, 0.0);
            }
            held += more;
        }
        groups.push(start..bands);
        groups
    }

    /// The splats that reach a group's bands, by chunk of particles and band.
    fn sorted(&self, group: Range<usize>) -> Result<Vec<BandedSplats<NdcSplat>>> {
        let parts = self.particles.par_chunks(|_, chunk| {
            self.context.check()?;
            let mut sorter = BandSorter::default();
            self.cull(chunk, group.clone(), &mut sorter);
            self.context.advance(1);
            Ok::<_, Error>(sorter.sort(group.len()))
        });
        parts.into_iter().collect()
    }

    /// Projects a chunk and keeps what covers a pixel centre in the group's bands.
    fn cull(&self, chunk: Chunk<'_>, group: Range<usize>, sorter: &mut BandSorter<NdcSplat>) {
        let mut block = Box::new(ProjectedBlock::default());
        let mut keep = [0u8; BLOCK];
        let simd = self.context.simd();
        for start in (0..chunk.len()).step_by(BLOCK) {
            let end = chunk.len().min(start + BLOCK);
            let n = end - start;
            self.projector.project(simd, chunk.position.map(|c| &c[start..end]), &mut block);
            dispatch!(simd, simd => touch_kernel(simd, &block, self.size, &mut keep));
            for i in 0..n {
                if keep[i] == 0 {
                    continue;
                }
                let Some(splat) = block.splat(i) else { continue };
                let Some(quad) = Quad::new(&splat, self.size) else { continue };
                let first = (quad.rows[0] as usize / BAND_ROWS).max(group.start);
                let last = ((quad.rows[1] - 1) as usize / BAND_ROWS + 1).min(group.end);
                if first < last {
                    sorter.push(splat, first - group.start, last - group.start);
                }
            }
        }
    }

    /// The pixels of a band, and which peels wrote a back layer.
    fn draw_band(
        &self,
        band: &PictureBand<'_>,
        out: &mut [u8],
        scratch: &mut FragmentScratch,
        peels: usize,
        rest: bool,
    ) -> Result<u8> {
        let (width, first_row) = (self.size.width, band.first_row);
        let rows = out.len() / width;
        // The number of fragments before each pixel.
        scratch.first.clear();
        scratch.first.resize(out.len() + 1, 0);
        for (i, splat) in band.splats().enumerate() {
            if i.is_multiple_of(CHECK) {
                self.context.check()?;
            }
            let Some(quad) = Quad::new(splat, self.size) else { continue };
            for_rows(&quad, first_row, rows, |row, [from, to]| {
                // Counts stand one pixel late, so that their running sum is the number before each pixel.
                let at = (row - first_row) * width;
                for count in &mut scratch.first[at + from + 1..=at + to] {
                    *count += 1;
                }
            });
        }
        for i in 1..scratch.first.len() {
            scratch.first[i] += scratch.first[i - 1];
        }
        let mut wrote = 0;
        let mut row = 0;
        while row < rows {
            let base = scratch.first[row * width];
            let mut end = row + 1;
            while end < rows && (scratch.first[(end + 1) * width] - base) as usize <= FRAGMENTS_AT_ONCE {
                end += 1;
            }
            // A row on which all splats of a large snapshot lie is gathered whole.
            let held = size_of::<[f32; 2]>() as u64 * (scratch.first[end * width] - base);
            require("splats that cover most of the picture", held)?;
            let into = FragmentGather {
                next: &mut scratch.next,
                depth: &mut scratch.depth,
                alpha: &mut scratch.alpha,
                shapes: &mut scratch.shapes,
            };
            let rows_first = (first_row + row, &scratch.first[row * width..=end * width]);
            dispatch!(self.context.simd(), simd => self.gather(simd, band, rows_first, into))?;
            for row in row..end {
                self.context.check()?;
                let pixels = row * width..(row + 1) * width;
                let fragments = Fragments {
                    first: &scratch.first[pixels.start..=pixels.end],
                    base,
                    depth: &scratch.depth,
                    alpha: &scratch.alpha,
                };
                // VTK stops by what a peel wrote in any pixel of the picture (docs/law/splat.md, "Blending").
                let out = &mut out[pixels];
                wrote |= dispatch!(self.context.simd(), simd => blend_row(simd, &fragments, (peels, rest), out));
            }
            row = end;
        }
        Ok(wrote)
    }

    /// Depths and alphas of some rows' fragments, pixel by pixel in particle order. `first` is how
    /// many fragments stand before each pixel of the rows, which begin with `first_row`.
    #[inline(always)]
    fn gather<S: Simd>(
        &self,
        simd: S,
        band: &PictureBand<'_>,
        (first_row, first): (usize, &[u64]),
        into: FragmentGather<'_>,
    ) -> Result<()> {
        let width = self.size.width;
        let rows = first.len() / width;
        let FragmentGather { next, depth, alpha, shapes } = into;
        let total = (first[first.len() - 1] - first[0]) as usize;
        next.clear();
        // Fragments of a pixel stay in particle order, in which the rest is blended (docs/law/splat.md, "Blending").
        next.extend(first.iter().map(|f| (f - first[0]) as usize));
        for column in [&mut *depth, &mut *alpha] {
            // Taken anew and not grown: the old values need not be copied, and a refusal is an error.
            if column.capacity() < total {
                *column = reserved("splats that cover most of the picture", total, self.context)?;
            }
            column.resize(total, 0.0);
        }
        for (i, splat) in band.splats().enumerate() {
            if i.is_multiple_of(CHECK) {
                self.context.check()?;
            }
            let Some(quad) = Quad::new(splat, self.size) else { continue };
            if quad.rows[1] <= first_row as i32 || quad.rows[0] >= (first_row + rows) as i32 {
                continue;
            }
            // All fragments of a splat have its centre's depth (docs/law/splat.md, "Shape").
            let mut put = |row: usize, column: usize, shape: f32| {
                let at = &mut next[(row - first_row) * width + column];
                depth[*at] = splat.depth;
                alpha[*at] = self.opacity * shape;
                *at += 1;
            };
            // A single pixel needs the planes of one triangle alone.
            if quad.is_one_pixel() {
                let [column, row] = [quad.columns[0], quad.rows[0]];
                let triangle = quad.triangle(column, row);
                put(row as usize, column as usize, quad.planes(triangle).gaussian(column, row));
                continue;
            }
            let planes = [quad.planes(0), quad.planes(1)];
            for_rows(&quad, first_row, rows, |row, [from, to]| {
                shapes.resize(shapes.len().max(to - from + WIDE), 0.0);
                quad.alphas(simd, &planes, row as i32, [from as i32, to as i32], shapes);
                (from..to).zip(&*shapes).for_each(|(column, shape)| put(row, column, *shape));
            });
        }
        Ok(())
    }
}

struct FragmentGather<'a> {
    next: &'a mut Vec<usize>,
    depth: &'a mut Vec<f32>,
    alpha: &'a mut Vec<f32>,
    shapes: &'a mut Vec<f32>,
}

/// The fragments of a row's pixels.
struct Fragments<'a> {
    /// The number of fragments before each pixel.
    first: &'a [u64],
    /// The number before the first that is gathered.
    base: u64,
    depth: &'a [f32],
    alpha: &'a [f32],
}

/// Levels of a row, and which peels wrote a back layer there; `peels` is how many are made, and `rest` whether what they
/// leave is blended.
#[inline(always)]
fn blend_row<S: Simd>(_simd: S, f: &Fragments<'_>, (peels, rest): (usize, bool), out: &mut [u8]) -> u8 {
    let mut wrote = 0;
    for (pixel, out) in out.iter_mut().enumerate() {
        let [a, b] = [pixel, pixel + 1].map(|p| (f.first[p] - f.base) as usize);
        if a < b {
            let blended = blend(&f.depth[a..b], &f.alpha[a..b], peels, rest);
            *out = blended.level;
            wrote |= blended.wrote;
        }
    }
    wrote
}

/// Calls `work` with every covered row of `first..first + rows` and its covered columns.
#[inline(always)]
fn for_rows(quad: &Quad, first: usize, rows: usize, mut work: impl FnMut(usize, [usize; 2])) {
    for row in (quad.rows[0] as usize).max(first)..(quad.rows[1] as usize).min(first + rows) {
        let [from, to] = quad.columns_of(row as i32);
        if from < to {
            work(row, [from as usize, to as usize]);
        }
    }
}

/// Marks the particles of a block whose quad may cover a pixel centre of the picture.
#[inline(always)]
fn touch_kernel<S: Simd>(_simd: S, block: &ProjectedBlock, size: Size, keep: &mut [u8; BLOCK]) {
    const CUT: f32 = CUT_SIGMA as f32;
    let (sx, sy) = (0.5 * size.width as f32, 0.5 * size.height as f32);
    let (w, h) = (size.width as i32, size.height as i32);
    for i in 0..BLOCK {
        // Rotated quads reach exactly as far as aligned ones along each axis, up to sqrt 2.
        let more = if block.c01[i].abs() > DIAGONAL_LIMIT { 1.5 * CUT } else { CUT };
        let (ex, ey) = (block.c00[i].sqrt() * more, block.c11[i].sqrt() * more);
        let (x, y) = (block.x[i], block.y[i]);
        let left = first_pixel(snap((x - ex) * sx + sx)).max(0);
        let right = first_pixel(snap((x + ex) * sx + sx)).min(w);
        let bottom = first_pixel(snap((y - ey) * sy + sy)).max(0);
        let top = first_pixel(snap((y + ey) * sy + sy)).min(h);
        let rotated = block.c01[i].abs() > DIAGONAL_LIMIT;
        // Whether a rotated quad covers a centre, its edges tell later.
        keep[i] = u8::from(((left < right) & (bottom < top)) | rotated);
    }
}
