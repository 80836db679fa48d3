//! Footprints by the tiles that they touch.

use super::project::ProjectedSplat;
use crate::picture::Size;

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
