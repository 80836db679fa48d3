//! LCP-S, the single-frame coder of LCP (arXiv 2411.00761, SIGMOD 2025): bins, blocks, four streams of integers,
//! entropy coding and zstd. The order of the particles is not kept.
//!
//! Block size: the authors' program tries several on a sample; here each is tried on all particles and the best is
//! used.

mod blocks;
mod huffman;
mod stream;

use crate::bins::{BinGrid, ParticleBins};
use crate::{Baseline, CompressedParticles, PositionColumns, check_bound};
use blocks::LcpStreams;
use particlegs_core::{Error, Result, parallel};
use zstd_rs::{CompressionConfig, Compressor, Decompressor};

/// Largest range of an axis that can be cut into bins, data units.
const LARGEST_RANGE: f64 = 1e6;
/// Limit of bins along an axis for the search of a block size.
const FEW_BINS: f64 = 16.0;
/// Largest number of blocks along an axis, and log2 of the largest block.
const MOST_BLOCKS: f64 = 200_000.0;
const LARGEST_EDGE: u32 = 16;

pub struct Lcp;

impl Baseline for Lcp {
    fn name(&self) -> &'static str {
        "LCP"
    }

    fn source(&self) -> String {
        "LCP-S, implemented from arXiv 2411.00761; zstd level 3".into()
    }

    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles> {
        check_bound(bound)?;
        let small = |b: &ParticleBins| b.grid.count().iter().all(|c| c * bound <= LARGEST_RANGE);
        let Some(bins) = ParticleBins::new(particles, bound).filter(small) else { return Ok(raw(particles)) };
        let coded = parallel::map(edges(&bins), |edge| of_edge(&bins, edge));
        let best = coded.into_iter().min_by_key(|c| c.bytes.len()).expect("at least one edge");
        Ok(best)
    }

    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns> {
        let wrong = || Error::input("LCP", "the data are corrupt");
        let plain = unpacked(bytes).ok_or_else(wrong)?;
        match plain.split_first() {
            Some((&RAW, rest)) => columns(rest).ok_or_else(wrong),
            Some((&BINNED, rest)) => binned(rest).ok_or_else(wrong),
            _ => Err(wrong()),
        }
    }
}

const RAW: u8 = 0;
const BINNED: u8 = 1;

/// Block edges to try, in bins.
fn edges(bins: &ParticleBins) -> Vec<u32> {
    let count = bins.grid.count();
    let (smallest, largest) =
        (count.into_iter().fold(f64::INFINITY, f64::min).max(1.0), count.into_iter().fold(0.0, f64::max));
    if largest <= FEW_BINS {
        return vec![1];
    }
    let top = (smallest.log2().ceil() as u32).min(LARGEST_EDGE);
    let low = (0..top).find(|i| largest / f64::from(1 << i) / 2.0 <= MOST_BLOCKS).unwrap_or(top);
    (low..=top).map(|i| 1 << i).collect()
}

fn of_edge(bins: &ParticleBins, edge: u32) -> CompressedParticles {
    let (blocks, order) = LcpStreams::new(bins, edge);
    let mut plain = vec![BINNED];
    bins.write(&mut plain);
    plain.extend(edge.to_le_bytes());
    for stream in [&blocks.starts, &blocks.counts, &blocks.octants, &blocks.places] {
        stream::write(stream, &mut plain);
    }
    (0..3).for_each(|k| stream::write(&bins.moved(k, Some(&order)), &mut plain));
    CompressedParticles { bytes: packed(&plain), order: Some(order) }
}

fn binned(bytes: &[u8]) -> Option<PositionColumns> {
    let (grid, rest) = BinGrid::read(bytes)?;
    let (edge, mut rest) = rest.split_first_chunk::<4>()?;
    let edge = u32::from_le_bytes(*edge);
    let mut next = || {
        let (values, after) = stream::read(rest, grid.particles)?;
        rest = after;
        Some(values)
    };
    let blocks = LcpStreams { starts: next()?, counts: next()?, octants: next()?, places: next()? };
    let bins = blocks.bins(&grid, edge)?;
    grid.coordinates(&bins, &[next()?, next()?, next()?])
}

/// Particles that cannot be cut into bins.
fn raw(particles: &PositionColumns) -> CompressedParticles {
    let values = particles.iter().flatten().flat_map(|v| v.to_le_bytes());
    let plain: Vec<u8> = std::iter::once(RAW).chain(values).collect();
    CompressedParticles { bytes: packed(&plain), order: None }
}

fn columns(bytes: &[u8]) -> Option<PositionColumns> {
    let (values, rest) = bytes.as_chunks::<4>();
    let n = values.len() / 3;
    let column = |k: usize| values[k * n..(k + 1) * n].iter().map(|v| f32::from_le_bytes(*v)).collect();
    (rest.is_empty() && values.len() == 3 * n).then(|| [0, 1, 2].map(column))
}

/// The raw length, then zstd.
fn packed(plain: &[u8]) -> Vec<u8> {
    let mut bytes = (plain.len() as u64).to_le_bytes().to_vec();
    bytes.extend(zstd(plain));
    bytes
}

/// A zstd frame, level 3.
fn zstd(plain: &[u8]) -> Vec<u8> {
    let mut frame = Vec::new();
    let frame_size = Compressor::new(CompressionConfig::DEFAULT).and_then(|mut c| c.compress(plain, None, &mut frame));
    frame_size.expect("a preset, and memory to write to");
    frame
}

fn unpacked(bytes: &[u8]) -> Option<Vec<u8>> {
    let (length, frame) = bytes.split_first_chunk::<8>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let mut plain = Vec::new();
    Decompressor::new().decompress(frame, None, length, &mut plain).ok()?;
    (plain.len() == length).then_some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{self, clustered};
    use proptest::prelude::*;

    fn held(particles: &PositionColumns, bound: f64) -> usize {
        testing::held(&Lcp, particles, bound)
    }

    #[test]
    fn the_bound_is_kept_and_larger_bounds_give_smaller_files() {
        let particles = clustered(5000);
        let sizes = [0.001, 0.03, 0.5, 4.0, 100.0].map(|bound| held(&particles, bound));
        assert!(sizes.windows(2).all(|w| w[0] > w[1]), "{sizes:?}");
        assert!(sizes[2] * 4 < 12 * 5000);
    }

    #[test]
    fn unusual_particles_survive_a_round_trip() {
        let one = |x: f32| [vec![x], vec![-x], vec![0.0]];
        held(&one(3.0), 0.1);
        held(&[vec![5.0; 100], vec![5.0; 100], vec![5.0; 100]], 0.1);
        held(&[vec![0.0, 1e7], vec![0.0, 1.0], vec![0.0, 1.0]], 0.1);
        held(&[vec![0.0, 1e-6, 9e5], vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 2.0]], 1e-7);
        assert!(Lcp.compress(&one(1.0), 0.0).is_err() && Lcp.compress(&one(1.0), f64::NAN).is_err());
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let good = Lcp.compress(&clustered(300), 0.3).unwrap().bytes;
        let plain = unpacked(&good).unwrap();
        for i in 0..plain.len() {
            for flip in [1, 0x80, 0xff] {
                let mut bad = plain.clone();
                bad[i] ^= flip;
                // Nothing may panic.
                let _ = Lcp.decompress(&packed(&bad));
            }
            let _ = Lcp.decompress(&packed(&plain[..i]));
        }
        assert!(Lcp.decompress(&[]).is_err() && Lcp.decompress(&good[..20]).is_err());
    }

    proptest! {
        #[test]
        fn any_particles_are_within_the_bound(
            rows in prop::collection::vec([-1e3f32..1e3, -1.0f32..1.0, 0.0f32..1e-3], 1..200),
            bound in 1e-4f64..10.0,
        ) {
            let column = |k: usize| rows.iter().map(|r| r[k]).collect();
            held(&[0, 1, 2].map(column), bound);
        }
    }
}
