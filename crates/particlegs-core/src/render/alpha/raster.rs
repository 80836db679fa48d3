//! Blends footprints front to back.

use super::plan::{CutOffs, Plan, TILE};
use super::project::Splat;
use crate::context::Context;
use crate::math::exp2;
use crate::picture::{Plane, Size};
use crate::{Result, parallel};
use fearless_simd::{Simd, dispatch, f32x16, prelude::*};

/// Pixels of a tile.
pub const PIXELS: usize = TILE * TILE;

/// Footprints after which it is asked whether a tile is done.
pub const ASK: usize = 32;

/// Brightness at every pixel: `sum grey alpha T` over black, not cut to [0, 1].
pub fn blend(plan: &Plan, size: Size, context: &Context<'_>) -> Result<Plane> {
    let mut out = Plane::zeros(size);
    blend_into(plan, size, &mut out.data, context)?;
    Ok(out)
}

/// [`blend`] into a buffer of the picture's pixels.
pub fn blend_into(plan: &Plan, size: Size, out: &mut [f32], context: &Context<'_>) -> Result<()> {
    let simd = context.simd();
    parallel::try_for_each(out.chunks_mut(size.width * TILE).enumerate(), |(row, pixels)| {
        context.check()?;
        let mut tile = Tile::default();
        for column in 0..plan.tiles.across {
            let lit = TilePixels::in_band(size.width, pixels.len() / size.width, column, row);
            tile.start(&lit, |_| true);
            dispatch!(simd, simd => blend_tile(simd, plan, row * plan.tiles.across + column, &lit, &mut tile));
            lit.store(&tile.sum, pixels, size.width);
        }
        Ok(())
    })
}

/// The pixels of a tile that lie in the picture.
#[derive(Clone, Copy)]
pub struct TilePixels {
    /// The first pixel.
    pub origin: [usize; 2],
    /// Pixels across and down.
    pub extent: [usize; 2],
}

impl TilePixels {
    /// Of a column of tiles in a band of `height` rows.
    pub fn in_band(width: usize, height: usize, column: usize, row: usize) -> Self {
        TilePixels { origin: [column * TILE, row * TILE], extent: [TILE.min(width - column * TILE), TILE.min(height)] }
    }

    /// Copies a tile's numbers to its rows of the picture.
    fn store(&self, from: &[f32; PIXELS], rows: &mut [f32], width: usize) {
        for (from, row) in from.chunks_exact(TILE).zip(rows.chunks_exact_mut(width)) {
            row[self.origin[0]..self.origin[0] + self.extent[0]].copy_from_slice(&from[..self.extent[0]]);
        }
    }

    /// Copies them from rows of the picture; zero outside.
    pub fn load(&self, rows: &[f32], width: usize) -> Box<[f32; PIXELS]> {
        let mut to = Box::new([0f32; PIXELS]);
        for (to, row) in to.chunks_exact_mut(TILE).zip(rows.chunks_exact(width)) {
            to[..self.extent[0]].copy_from_slice(&row[self.origin[0]..self.origin[0] + self.extent[0]]);
        }
        to
    }
}

/// The state of a tile's pixels.
pub struct Tile {
    /// Transmittance; 0 once a pixel is done.
    pub left: Box<[f32; PIXELS]>,
    /// Brightness.
    pub sum: Box<[f32; PIXELS]>,
}

/// Nothing drawn.
impl Default for Tile {
    fn default() -> Self {
        Tile { left: Box::new([0.0; PIXELS]), sum: Box::new([0.0; PIXELS]) }
    }
}

impl Tile {
    /// Begins a tile: pixels outside the picture, and those that are not `wanted`, are done.
    pub fn start(&mut self, lit: &TilePixels, wanted: impl Fn(usize) -> bool) {
        self.sum.fill(0.0);
        for (i, left) in self.left.iter_mut().enumerate() {
            let inside = i % TILE < lit.extent[0] && i / TILE < lit.extent[1];
            *left = if inside && wanted(i) { 1.0 } else { 0.0 };
        }
    }

    /// Whether all pixels are done.
    pub fn done(&self) -> bool {
        self.left.iter().fold(0.0f32, |a, b| a.max(*b)) == 0.0
    }
}

/// A row of a footprint in a tile: how much it has fallen by there, and how far the tile's first pixel
/// lies from the crest.
#[derive(Clone, Copy)]
pub struct FootprintRow {
    /// Depth in the exponent at the row's crest.
    pub fall: f32,
    /// Pixels from the crest to the tile's first.
    pub start: f32,
    /// Pixels from the centre's row.
    pub dy: f32,
}

/// Calls `each` with the rows of a tile that a footprint touches.
#[inline(always)]
pub fn rows(s: &Splat, lit: &TilePixels, mut each: impl FnMut(usize, FootprintRow)) {
    let (x0, y0) = (lit.origin[0] as f32 - s.x, lit.origin[1] as f32 - s.y);
    let half = (s.end / s.down).sqrt();
    let from = (-half - y0).ceil().max(0.0) as usize;
    let to = ((half - y0).floor() + 1.0).min(lit.extent[1] as f32).max(0.0) as usize;
    for row in from..to {
        let dy = row as f32 + y0;
        let fall = s.down * (dy * dy);
        let start = x0 - s.lean * dy;
        // The pixel nearest to the crest.
        let nearest = start.max(0.0) + (start + (TILE as f32 - 1.0)).min(0.0);
        if s.along * (nearest * nearest) + fall >= s.end {
            each(row, FootprintRow { fall, start, dy });
        }
    }
}

/// Alphas of a row, before and after they are cut to the largest; 0 where too small.
#[inline(always)]
pub fn alphas<S: Simd>(
    simd: S,
    s: &Splat,
    row: &FootprintRow,
    lanes: f32x16<S>,
    cut: &CutOffs,
) -> (f32x16<S>, f32x16<S>) {
    let d = lanes + row.start;
    let power = d * d * s.along + row.fall;
    let raw = exp2(simd, power) * s.peak;
    let raw = power.simd_ge(s.end).select(raw, f32x16::splat(simd, 0.0));
    (raw, raw.min(f32x16::splat(simd, cut.most_alpha)))
}

/// 0, 1, ... 15.
#[inline(always)]
pub fn lanes<S: Simd>(simd: S) -> f32x16<S> {
    f32x16::from_fn(simd, |i| i as f32)
}

#[inline(always)]
fn blend_tile<S: Simd>(simd: S, plan: &Plan, number: usize, lit: &TilePixels, tile: &mut Tile) {
    let (lanes, zero) = (lanes(simd), f32x16::splat(simd, 0.0));
    for (count, entry) in plan.in_tile(number).enumerate() {
        if count % ASK == ASK - 1 && tile.done() {
            break;
        }
        let s = &plan.splats[entry as usize];
        rows(s, lit, |row, at| {
            let here = row * TILE..(row + 1) * TILE;
            let (_, alpha) = alphas(simd, s, &at, lanes, &plan.cut);
            let left = f32x16::from_slice(simd, &tile.left[here.clone()]);
            let next = left * (-alpha + 1.0);
            // As published: the footprint that would pass the limit is not drawn, and ends the pixel.
            let live = next.simd_ge(plan.cut.least_transmittance);
            let weight = live.select(left * alpha, zero);
            (f32x16::from_slice(simd, &tile.sum[here.clone()]) + weight * s.grey)
                .store_slice(&mut tile.sum[here.clone()]);
            live.select(next, zero).store_slice(&mut tile.left[here]);
        });
    }
}
