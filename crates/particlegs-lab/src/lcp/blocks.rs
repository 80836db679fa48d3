//! Particles sorted by block, as four streams of differences. Eight blocks make a superblock.

use super::LARGEST_EDGE;
use crate::bins::{BinGrid, ParticleBins};

#[derive(Debug, PartialEq)]
pub struct LcpStreams {
    /// Numbers of the occupied superblocks: the first, then differences.
    pub starts: Vec<i64>,
    pub counts: Vec<i64>,
    /// Octant of each particle minus that of the previous one in its superblock.
    pub octants: Vec<i64>,
    /// Position of each particle in its block minus that of the previous one in its block.
    pub places: Vec<i64>,
}

fn superblocks(grid: &BinGrid, edge: u32) -> [u64; 3] {
    grid.count().map(|c| ((c / (2.0 * f64::from(edge))).ceil() as u64 + 2) / 2)
}

impl LcpStreams {
    /// The streams of particles in blocks of `edge` bins, and the order of the particles.
    pub fn new(bins: &ParticleBins, edge: u32) -> (LcpStreams, Vec<u32>) {
        let m = superblocks(&bins.grid, edge);
        let b = u64::from(edge);
        let mut keys: Vec<(u64, u64, u32)> = (0u32..)
            .zip(&bins.of)
            .map(|(i, q)| {
                let [c, d] = [q.map(|q| u64::from(q) / b), q.map(|q| u64::from(q) % b)];
                let s = c.map(|c| c / 2);
                let octant = (c[0] & 1) | (c[1] & 1) << 1 | (c[2] & 1) << 2;
                // A place in a block takes at most 48 bits: three times `LARGEST_EDGE`.
                (s[0] + m[0] * (s[1] + m[1] * s[2]), octant << 48 | (d[0] + b * (d[1] + b * d[2])), i)
            })
            .collect();
        keys.sort_unstable();
        let mut blocks = LcpStreams { starts: vec![], counts: vec![], octants: vec![], places: vec![] };
        // Nothing precedes the first particle.
        let (mut id, mut octant, mut place) = (None, 0, 0);
        for (superblock, within, _) in &keys {
            let (o, r) = ((within >> 48) as i64, (within & 0xffff_ffff_ffff) as i64);
            if id != Some(*superblock) {
                blocks.starts.push(*superblock as i64 - id.unwrap_or(0) as i64);
                blocks.counts.push(0);
                (id, octant, place) = (Some(*superblock), 0, 0);
            } else if o != octant {
                place = 0;
            }
            if let Some(count) = blocks.counts.last_mut() {
                *count += 1;
            }
            blocks.octants.push(o - octant);
            blocks.places.push(r - place);
            (octant, place) = (o, r);
        }
        (blocks, keys.into_iter().map(|(.., i)| i).collect())
    }

    /// Decodes the bins, in the order of the blocks; `None` if the streams contradict each other.
    pub fn bins(&self, grid: &BinGrid, edge: u32) -> Option<Vec<[u32; 3]>> {
        let (m, b) = (superblocks(grid, edge), i64::from(edge));
        let all: i64 = self.counts.iter().try_fold(0i64, |n, c| n.checked_add(*c).filter(|_| *c > 0))?;
        let whole = self.starts.len() == self.counts.len() && self.octants.len() == self.places.len();
        let edges = 1..=1 << LARGEST_EDGE;
        if !whole || !edges.contains(&edge) || all != self.octants.len() as i64 || all != grid.particles as i64 {
            return None;
        }
        let mut bins = Vec::with_capacity(self.octants.len());
        let mut steps = self.octants.iter().zip(&self.places);
        let mut id = 0i64;
        for (start, count) in self.starts.iter().zip(&self.counts) {
            id = id.checked_add(*start)?;
            let s = u64::try_from(id).ok()?;
            let s = [s % m[0], s / m[0] % m[1], s / m[0] / m[1]];
            let (mut octant, mut place) = (0i64, 0i64);
            for _ in 0..*count {
                let (o, r) = steps.next()?;
                // Another octant is another block, where places start again.
                if *o != 0 {
                    place = 0;
                }
                octant = octant.checked_add(*o)?;
                place = place.checked_add(*r)?;
                if !(0..8).contains(&octant) || !(0..b.pow(3)).contains(&place) {
                    return None;
                }
                let d = [place % b, place / b % b, place / b / b];
                let block = |k: usize| i64::try_from(s[k]).ok()?.checked_mul(2)?.checked_add(octant >> k & 1);
                let bin = |k: usize| u32::try_from(block(k)?.checked_mul(b)?.checked_add(d[k])?).ok();
                bins.push([bin(0)?, bin(1)?, bin(2)?]);
            }
        }
        Some(bins)
    }
}
