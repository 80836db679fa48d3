//! All Gaussians that a picture shows, sorted by depth, in bins by the tiles that they touch.

use super::project::{Eye, GreyCameraGaussian, ProjectedSplat, Splat, project};
use crate::context::Context;
use crate::picture::Size;
use crate::{Error, Result, parallel};

/// Gaussians in one step of parallel work, at least.
const RUN: usize = 4096;

/// Runs of bins, at most: each holds a number for every tile.
const MOST_BINS: usize = 64;

/// Thresholds of the parts that are left out of a picture (3DGS, `renderCUDA`).
#[derive(Clone, Copy, Debug)]
pub struct CutOffs {
    /// Smaller alphas are not drawn.
    pub least_alpha: f32,
    /// Larger alphas become this.
    pub most_alpha: f32,
    /// A pixel is done where its transmittance would fall below.
    pub least_transmittance: f32,
}

impl CutOffs {
    /// As published.
    pub const PUBLISHED: CutOffs = CutOffs { least_alpha: 1.0 / 255.0, most_alpha: 0.99, least_transmittance: 1e-4 };
}

/// Gaussians on the picture, nearest first.
pub struct Plan {
    /// Their footprints.
    pub splats: Vec<Splat>,
    /// Their numbers among all.
    pub indices: Vec<u32>,
    /// Runs of footprints, in their order.
    pub bins: Vec<Bin>,
    /// Footprints in a run.
    pub run: usize,
    /// The picture's tiles.
    pub tiles: Tiles,
    /// Thresholds of the parts that are left out.
    pub cut: CutOffs,
}

impl Plan {
    /// Of Gaussians `0..n`. Those of equal depth are drawn in the order of their numbers.
    pub fn new(
        eye: &Eye,
        n: usize,
        gaussian: impl Fn(usize) -> Option<GreyCameraGaussian> + Sync,
        cut: CutOffs,
        context: &Context<'_>,
    ) -> Result<Plan> {
        let tiles = Tiles::new(eye.size);
        let see = |i: usize| {
            let p = project(eye, &gaussian(i)?, cut.least_alpha.into())?;
            let touched = tiles.touched(eye.size, &p)?;
            // Depths are positive: their bits stand in their order.
            let key = u64::from(p.depth.to_bits()) << 32 | i as u64;
            Some((key, p.splat, touched))
        };
        let runs = parallel::try_map_range(n.div_ceil(RUN), |c| {
            context.check()?;
            Ok((c * RUN..n.min((c + 1) * RUN)).filter_map(see).collect::<Vec<_>>())
        })?;
        let seen: Vec<(u64, Splat, TileRange)> = runs.into_iter().flatten().collect();
        let mut order: Vec<(u64, u32)> =
            seen.iter().enumerate().map(|(place, (key, ..))| (*key, place as u32)).collect();
        parallel::sort_keys(&mut order);
        let run = RUN.max(seen.len().div_ceil(MOST_BINS));
        let entries: u64 = seen.iter().map(|(.., touched)| touched.number()).sum();
        let places = (seen.len().div_ceil(run) * (tiles.number() + 1)) as u64;
        // Bins count with 32 bits.
        let most = u64::from(u32::MAX);
        if entries > most {
            return Err(Error::Memory { what: "a picture".into(), need_bytes: 4 * entries, have_bytes: 4 * most });
        }
        context.require_memory("a picture", 4 * (entries + 2 * places))?;
        let touched: Vec<TileRange> = order.iter().map(|(_, place)| seen[*place as usize].2).collect();
        let bins = parallel::map(touched.chunks(run).enumerate(), |(c, t)| Bin::new(&tiles, c * run, t));
        Ok(Plan {
            splats: order.iter().map(|(_, place)| seen[*place as usize].1).collect(),
            indices: order.iter().map(|(key, _)| *key as u32).collect(),
            bins,
            run,
            tiles,
            cut,
        })
    }

    /// Numbers of footprints that touch a tile, nearest first.
    pub fn in_tile(&self, tile: usize) -> impl Iterator<Item = u32> + '_ {
        self.bins.iter().flat_map(move |b| b.in_tile(tile).iter().copied())
    }
}

/// Pixels of a tile's side.
pub const TILE: usize = 16;

/// The picture cut into tiles, numbered row by row.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    /// Tiles in a row.
    pub across: usize,
    /// Rows of tiles.
    pub down: usize,
}

/// Tiles that a footprint touches: columns and rows, both ends included.
#[derive(Clone, Copy, Debug)]
pub struct TileRange {
    /// First and last column of tiles.
    pub columns: [u16; 2],
    /// First and last row of tiles.
    pub rows: [u16; 2],
}

impl Tiles {
    /// Of a picture.
    pub fn new(size: Size) -> Self {
        Tiles { across: size.width.div_ceil(TILE), down: size.height.div_ceil(TILE) }
    }

    /// The number of tiles.
    pub fn number(&self) -> usize {
        self.across * self.down
    }

    /// The tiles that a footprint reaches; `None` outside the picture.
    pub fn touched(&self, size: Size, p: &ProjectedSplat) -> Option<TileRange> {
        let [right, down] = p.reach;
        let [columns, rows] = [(p.splat.x, right, size.width), (p.splat.y, down, size.height)].map(|(at, reach, n)| {
            let from = (at - reach).ceil().max(0.0);
            let to = (at + reach).floor().min(n as f32 - 1.0);
            (from <= to).then(|| [from, to].map(|v| (v as usize / TILE) as u16))
        });
        Some(TileRange { columns: columns?, rows: rows? })
    }
}

impl TileRange {
    /// The number of tiles in it.
    pub fn number(&self) -> u64 {
        let span = |[from, to]: [u16; 2]| u64::from(to - from) + 1;
        span(self.columns) * span(self.rows)
    }

    fn each(&self, tiles: &Tiles, mut to: impl FnMut(usize)) {
        for row in self.rows[0]..=self.rows[1] {
            for column in self.columns[0]..=self.columns[1] {
                to(usize::from(row) * tiles.across + usize::from(column));
            }
        }
    }
}

/// The footprints of one run in the order of depth, tile by tile.
pub struct Bin {
    /// The first entry of each tile, and the end of all.
    starts: Vec<u32>,
    /// Numbers in the plan.
    entries: Vec<u32>,
}

impl Bin {
    /// Of footprints numbered from `first`.
    pub fn new(tiles: &Tiles, first: usize, touched: &[TileRange]) -> Self {
        let mut starts = vec![0u32; tiles.number() + 1];
        for t in touched {
            t.each(tiles, |tile| starts[tile + 1] += 1);
        }
        for tile in 0..tiles.number() {
            starts[tile + 1] += starts[tile];
        }
        // Counted first and filled now, so that the entries of a tile stay in the order of depth.
        let mut next = starts.clone();
        let mut entries = vec![0u32; starts[tiles.number()] as usize];
        for (i, t) in touched.iter().enumerate() {
            t.each(tiles, |tile| {
                entries[next[tile] as usize] = (first + i) as u32;
                next[tile] += 1;
            });
        }
        Bin { starts, entries }
    }

    /// Those that touch a tile, nearest first.
    #[inline]
    pub fn in_tile(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}
