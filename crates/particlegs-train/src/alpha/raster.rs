//! Walks the tiles front to back once more, and sums the gradients of the pixels for every footprint.
//!
//! Light from behind a footprint is the picture less what came before it, so nothing has to be kept
//! from drawing but the picture.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use particlegs_core::math::across;
use particlegs_core::parallel;
use particlegs_core::picture::Plane;
use particlegs_core::render::alpha::raster::{ASK, PIXELS, Tile, TilePixels, alphas, lanes, rows};
use particlegs_core::render::alpha::{Plan, TILE};

/// With h the change of the loss with the logarithm of alpha at a pixel, and d its distance from the
/// centre: sums of h, h dx, h dy, h dx^2, h dx dy, h dy^2; and the change with the grey level.
pub(super) type PixelSums = [f32; 7];

struct BlendedTile<'a> {
    number: usize,
    lit: TilePixels,
    total: &'a [f32; PIXELS],
    /// The loss's change with it.
    slope: &'a [f32; PIXELS],
}

/// Sums of every footprint of a plan, in its order, for the change `slope` of the loss with each
/// pixel's brightness. `drawn` is the picture as it was blended.
pub(super) fn sums(level: Level, plan: &Plan, drawn: &Plane, slope: &Plane) -> Vec<PixelSums> {
    let width = drawn.size.width;
    let band = width * TILE;
    let bands = drawn.data.chunks(band).zip(slope.data.chunks(band)).enumerate();
    let bands = parallel::map(bands, |(row, (drawn, slope))| {
        let mut tile = Tile::default();
        let mut out = Vec::new();
        for column in 0..plan.tiles.across {
            let number = row * plan.tiles.across + column;
            let lit = TilePixels::in_band(width, drawn.len() / width, column, row);
            let (total, slope) = (lit.load(drawn, width), lit.load(slope, width));
            // A pixel that wants nothing is done before it begins.
            tile.start(&lit, |i| slope[i] != 0.0);
            let start = out.len();
            out.resize(start + plan.bins.iter().map(|b| b.in_tile(number).len()).sum::<usize>(), PixelSums::default());
            let out = &mut out[start..];
            if !tile.done() {
                let drawn = BlendedTile { number, lit, total: &total, slope: &slope };
                dispatch!(level, simd => tile_sums(simd, plan, &drawn, &mut tile, out));
            }
        }
        out
    });
    gather(plan, &bands)
}

/// Adds up each footprint's sums over its tiles, in their order.
fn gather(plan: &Plan, bands: &[Vec<PixelSums>]) -> Vec<PixelSums> {
    let (across, number) = (plan.tiles.across, plan.bins.len());
    // Where the entries of each tile and bin begin in the tile's band.
    let mut starts = vec![0u32; plan.tiles.number() * number];
    for row in 0..plan.tiles.down {
        let mut at = 0;
        for tile in row * across..(row + 1) * across {
            for (b, bin) in plan.bins.iter().enumerate() {
                starts[tile * number + b] = at;
                at += bin.in_tile(tile).len() as u32;
            }
        }
    }
    let mut out = vec![PixelSums::default(); plan.splats.len()];
    // A bin holds one run of footprints: one task writes each sum, so its order does not depend on threads.
    parallel::for_each(out.chunks_mut(plan.run).zip(&plan.bins).enumerate(), |(b, (out, bin))| {
        for tile in 0..plan.tiles.number() {
            let entries = bin.in_tile(tile);
            let from = starts[tile * number + b] as usize;
            for (entry, add) in entries.iter().zip(&bands[tile / across][from..from + entries.len()]) {
                let to = &mut out[*entry as usize - b * plan.run];
                (0..7).for_each(|k| to[k] += add[k]);
            }
        }
    });
    out
}

#[inline(always)]
fn tile_sums<S: Simd>(simd: S, plan: &Plan, drawn: &BlendedTile<'_>, tile: &mut Tile, out: &mut [PixelSums]) {
    let &BlendedTile { number, ref lit, total, slope } = drawn;
    let (lanes, zero) = (lanes(simd), f32x16::splat(simd, 0.0));
    for (count, (entry, out)) in plan.in_tile(number).zip(out).enumerate() {
        if count % ASK == ASK - 1 && tile.done() {
            break;
        }
        let s = &plan.splats[entry as usize];
        let dx = lanes + (lit.origin[0] as f32 - s.x);
        let mut sums = [zero; 7];
        rows(s, lit, |row, at| {
            let range = row * TILE..(row + 1) * TILE;
            let (raw, alpha) = alphas(simd, s, &at, lanes, &plan.cut);
            let left = f32x16::from_slice(simd, &tile.left[range.clone()]);
            let through = -alpha + 1.0;
            let next = left * through;
            // As in blending: the footprint that would pass the limit is not drawn, and ends the pixel.
            let live = next.simd_ge(plan.cut.least_transmittance);
            let weight = live.select(left * alpha, zero);
            let sum = f32x16::from_slice(simd, &tile.sum[range.clone()]) + weight * s.grey;
            sum.store_slice(&mut tile.sum[range.clone()]);
            live.select(next, zero).store_slice(&mut tile.left[range.clone()]);
            let want = f32x16::from_slice(simd, &slope[range.clone()]);
            // Light from behind, as it arrives: dimmed by this alpha too, which the division below takes back.
            let behind = f32x16::from_slice(simd, &total[range]) - sum;
            // An alpha that was cut moves no more.
            let moving = raw.simd_le(plan.cut.most_alpha).select(alpha, zero);
            // The light that a larger alpha adds, less that from behind which it takes away.
            let h = live.select(moving * want * (left * s.grey - behind / through), zero);
            let hx = h * dx;
            let hy = h * at.dy;
            sums[0] += h;
            sums[1] += hx;
            sums[2] += hy;
            sums[3] += hx * dx;
            sums[4] += hx * at.dy;
            sums[5] += hy * at.dy;
            sums[6] += want * weight;
        });
        *out = sums.map(|v| across(&v.into()));
    }
}
