//! A compressor that users could assemble themselves: bins of twice the bound, sorted in Morton order and coded by pco
//! (Loncaric, Jeppesen and Zinberg, arXiv 2502.06112; the crate `pco`). The order of the particles is kept only if that
//! takes fewer bytes.

use crate::bins::{BinGrid, ParticleBins};
use crate::morton::{self, Bits};
use crate::{Baseline, CompressedParticles, PositionColumns, check_bound, packed};
use particlegs_core::{Error, Result, parallel};

/// The coder: it tries every layout and uses the smallest.
pub struct QuantisedCoder;

/// Layouts of stored particles.
#[derive(Clone, Copy, PartialEq)]
enum CodingLayout {
    /// Plain coordinates, no bins.
    Exact = 0,
    /// Occupied bins in Morton order, and the number of particles in each.
    Cells = 1,
    /// The bin of each particle, in Morton order.
    Codes = 2,
    /// The bin of each particle along each axis, in Morton order.
    Axes = 3,
    /// The bin of each particle along each axis, in the input order.
    File = 4,
}

const BINNED: [CodingLayout; 4] = [CodingLayout::Cells, CodingLayout::Codes, CodingLayout::Axes, CodingLayout::File];

impl Baseline for QuantisedCoder {
    fn name(&self) -> &'static str {
        "Quantise + pco"
    }

    fn source(&self) -> String {
        "bins of twice the bound; crate pco 1.1".into()
    }

    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles> {
        check_bound(bound)?;
        let Some(bins) = ParticleBins::new(particles, bound) else { return Ok(exact(particles)) };
        let sorted = SortedParticles::new(bins);
        let coded = parallel::map(BINNED, |layout| sorted.coded(layout));
        let (layout, bytes) =
            BINNED.into_iter().zip(coded).filter_map(|(l, c)| Some((l, c?))).min_by_key(|c| c.1.len()).expect("axes");
        let bytes = packed::sealed(bytes, particles[0].len());
        Ok(CompressedParticles { bytes, order: (layout != CodingLayout::File).then_some(sorted.order) })
    }

    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns> {
        let read = || {
            let (plain, most) = packed::opened(bytes)?;
            let (kind, rest) = plain.split_first()?;
            match BINNED.into_iter().find(|l| *l as u8 == *kind) {
                Some(layout) => binned(layout, rest, most),
                None => (*kind == CodingLayout::Exact as u8).then(|| exact_columns(rest, most))?,
            }
        };
        read().ok_or_else(|| Error::input(self.name(), "the data are corrupt"))
    }
}

struct SortedParticles {
    bins: ParticleBins,
    /// Bits of an exact code; `None` if there are too many bins.
    bits: Option<Bits>,
    codes: Vec<u64>,
    order: Vec<u32>,
}

impl SortedParticles {
    fn new(bins: ParticleBins) -> Self {
        let last = bins.grid.last();
        let bits = Bits::new(last);
        // If there are too many bins for a code, the order of the highest bits is nearly as good.
        let coarse = if bits.is_some() { 0 } else { 11 };
        let coarse_bits = Bits::new(last.map(|q| q >> coarse)).expect("3 x 21 bits fit");
        let particle_codes = parallel::map_range(bins.of.len(), |i| coarse_bits.code(bins.of[i].map(|q| q >> coarse)));
        let order = morton::order_of(&particle_codes);
        let codes = order.iter().map(|i| particle_codes[*i as usize]).collect();
        SortedParticles { bins, bits, codes, order }
    }

    /// The bytes of a layout; `None` if it needs codes and there are none.
    fn coded(&self, layout: CodingLayout) -> Option<Vec<u8>> {
        let mut out = vec![layout as u8];
        self.bins.write(&mut out);
        let order = (layout != CodingLayout::File).then_some(&self.order[..]);
        (0..3).for_each(|k| packed::write(&self.bins.moved(k, order), &mut out));
        match layout {
            CodingLayout::Cells => {
                self.bits?;
                let cells: Vec<&[u64]> = self.codes.chunk_by(|a, b| a == b).collect();
                packed::write_number(cells.len() as u64, &mut out);
                packed::write(&steps(cells.iter().map(|c| c[0])), &mut out);
                packed::write(&cells.iter().map(|c| c.len() as u32).collect::<Vec<_>>(), &mut out);
            }
            CodingLayout::Codes => {
                self.bits?;
                packed::write(&steps(self.codes.iter().copied()), &mut out);
            }
            CodingLayout::Axes => (0..3).for_each(|k| {
                let column: Vec<u32> = self.order.iter().map(|i| self.bins.of[*i as usize][k]).collect();
                packed::write(&column, &mut out);
            }),
            _ => (0..3).for_each(|k| {
                let column: Vec<u32> = self.bins.of.iter().map(|q| q[k]).collect();
                packed::write(&column, &mut out);
            }),
        }
        Some(out)
    }
}

/// The first of sorted numbers, then differences.
fn steps(rising: impl Iterator<Item = u64>) -> Vec<u64> {
    let mut last = 0;
    rising.map(|v| v - std::mem::replace(&mut last, v)).collect()
}

fn binned(layout: CodingLayout, bytes: &[u8], most: usize) -> Option<PositionColumns> {
    let (grid, mut rest) = BinGrid::read(bytes)?;
    let n = Some(grid.particles).filter(|n| *n <= most)?;
    let mut moved: [Vec<i64>; 3] = Default::default();
    for axis in &mut moved {
        (*axis, rest) = packed::read(rest, n)?;
    }
    let bins = match layout {
        CodingLayout::Cells => {
            let (cells, after) = packed::read_number(rest)?;
            let cells = usize::try_from(cells).ok().filter(|c| *c <= n)?;
            let (steps, after) = packed::read::<u64>(after, cells)?;
            let (counts, _) = packed::read::<u32>(after, cells)?;
            let all: u64 = counts.iter().map(|c| u64::from(*c)).sum();
            let whole = steps.len() == cells && counts.len() == cells && all == n as u64;
            let cells = whole.then(|| of_codes(&grid, &steps))??;
            cells.iter().zip(counts).flat_map(|(q, count)| std::iter::repeat_n(*q, count as usize)).collect()
        }
        CodingLayout::Codes => of_codes(&grid, &packed::read::<u64>(rest, n)?.0)?,
        _ => {
            let mut columns: [Vec<u32>; 3] = Default::default();
            for axis in &mut columns {
                (*axis, rest) = packed::read(rest, n)?;
            }
            let whole = columns.iter().all(|c| c.len() == n);
            whole.then(|| (0..n).map(|i| [0, 1, 2].map(|k| columns[k][i])).collect::<Vec<_>>())?
        }
    };
    (bins.len() == n).then(|| grid.coordinates(&bins, &moved))?
}

/// Bins from differences of codes.
fn of_codes(grid: &BinGrid, steps: &[u64]) -> Option<Vec<[u32; 3]>> {
    let bits = Bits::new(grid.last())?;
    let mut code = 0u64;
    let next = |step: &u64| {
        code = code.checked_add(*step)?;
        bits.numbers(code)
    };
    steps.iter().map(next).collect()
}

/// Particles that cannot be cut into bins.
fn exact(particles: &PositionColumns) -> CompressedParticles {
    let mut out = vec![CodingLayout::Exact as u8];
    // As bits, so that every float is kept exactly.
    let bits = |c: &Vec<f32>| c.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    particles.iter().for_each(|c| packed::write(&bits(c), &mut out));
    CompressedParticles { bytes: packed::sealed(out, particles[0].len()), order: None }
}

fn exact_columns(mut bytes: &[u8], most: usize) -> Option<PositionColumns> {
    let mut columns: PositionColumns = Default::default();
    for column in &mut columns {
        let (bits, rest) = packed::read::<u32>(bytes, most)?;
        (*column, bytes) = (bits.into_iter().map(f32::from_bits).collect(), rest);
    }
    let n = columns[0].len();
    columns.iter().all(|c| c.len() == n).then_some(columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{clustered, held, odd};
    use proptest::prelude::*;

    #[test]
    fn the_bound_is_kept_and_larger_bounds_give_smaller_files() {
        let particles = clustered(5000);
        let sizes = [0.001, 0.03, 0.5, 4.0, 100.0].map(|bound| held(&QuantisedCoder, &particles, bound));
        assert!(sizes.windows(2).all(|w| w[0] > w[1]), "{sizes:?}");
        assert!(sizes[2] * 4 < 12 * 5000);
    }

    #[test]
    fn unusual_particles_survive_a_round_trip() {
        odd().iter().for_each(|(particles, bound)| {
            held(&QuantisedCoder, particles, *bound);
        });
        let strange = [vec![f32::NAN, 1.0, f32::INFINITY], vec![2.0; 3], vec![-0.0, 0.0, 5.0]];
        held(&QuantisedCoder, &strange, 0.1);
        for bound in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(QuantisedCoder.compress(&strange, bound).is_err());
        }
    }

    fn layout(particles: &PositionColumns, bound: f64) -> u8 {
        held(&QuantisedCoder, particles, bound);
        let coded = QuantisedCoder.compress(particles, bound).unwrap();
        packed::opened(&coded.bytes).unwrap().0[0]
    }

    #[test]
    fn layouts_are_chosen_by_their_sizes() {
        assert_eq!(layout(&clustered(20_000), 1.0), CodingLayout::Cells as u8);
        // Each column steps evenly around a circle by its own step: only the input order is simple.
        let even = [0, 1, 2].map(|k| (0..2000).map(|i| (i * (k * 3001 + 17) % 2003) as f32).collect());
        assert_eq!(layout(&even, 0.25), CodingLayout::File as u8);
        // Too many bins for 64-bit codes.
        let fine = clustered(3000);
        assert!([CodingLayout::Axes as u8, CodingLayout::File as u8].contains(&layout(&fine, 1e-7)));
    }

    #[test]
    fn every_layout_decodes_to_the_same_particles() {
        let particles = clustered(2000);
        let sorted = SortedParticles::new(ParticleBins::new(&particles, 0.2).unwrap());
        for layout in BINNED {
            let bytes = packed::sealed(sorted.coded(layout).unwrap(), 2000);
            let decoded = QuantisedCoder.decompress(&bytes).unwrap();
            let order = (layout != CodingLayout::File).then_some(&sorted.order[..]);
            assert!(crate::largest_error(&particles, &decoded, order) <= 0.2);
        }
    }

    /// The checksum catches damaged bytes; with a matching checksum nothing may panic.
    #[test]
    fn damaged_bytes_are_refused() {
        let particles = clustered(300);
        let sorted = SortedParticles::new(ParticleBins::new(&particles, 0.3).unwrap());
        let exact = exact(&clustered(40)).bytes;
        let all = BINNED.map(|l| packed::sealed(sorted.coded(l).unwrap(), 300));
        for good in all.iter().chain([&exact]) {
            for i in 0..good.len() {
                for flip in [1, 0x10, 0x80, 0xff] {
                    let mut bad = good.clone();
                    bad[i] ^= flip;
                    assert!(QuantisedCoder.decompress(&bad).is_err());
                    let _ = QuantisedCoder.decompress(&packed::sealed(bad[4..].to_vec(), 0));
                }
                assert!(QuantisedCoder.decompress(&good[..i]).is_err());
                let _ = QuantisedCoder.decompress(&packed::sealed(good[4.min(i)..i].to_vec(), 0));
            }
        }
    }

    proptest! {
        #[test]
        fn any_particles_are_within_the_bound(
            rows in prop::collection::vec([-1e3f32..1e3, -1.0f32..1.0, 0.0f32..1e-3], 0..200),
            bound in 1e-4f64..10.0,
        ) {
            held(&QuantisedCoder, &[0, 1, 2].map(|k| rows.iter().map(|r| r[k]).collect()), bound);
        }

        #[test]
        fn any_bytes_are_no_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), kind in 0u8..6) {
            let mut all = vec![kind];
            all.extend(bytes);
            let _ = QuantisedCoder.decompress(&packed::sealed(all, 0));
        }
    }
}
