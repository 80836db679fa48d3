//! Sums that a certificate's figures of fields are made of: over two halves of the particles in cells. They add up over
//! parts.

use crate::stats::Grid;
use particlegs_core::math::{Purpose, Random, each_axis};
use particlegs_core::model::{FieldAgreement, Metadata};
use particlegs_particles::Domain;
use std::collections::BTreeMap;

/// Edge of a cell in mean spacings: 8 particles in a cell on average, as for a density's finest cells.
const CELL: f64 = 2.0;
/// Cells along the longest edge at most.
const MOST_CELLS: f64 = 256.0;
/// Cells of both halves that say something, at least.
const LEAST_CELLS: usize = 8;
/// Standard errors of noise alone that the variance of means is above.
const STANDS_OUT: f64 = 4.0;
/// Cells along the edge of a region, and particles that are looked at, about: of more, those of some regions, this many
/// at least.
const REGION: usize = 8;
const LOOKED_AT: f64 = (1 << 19) as f64;
const LEAST_REGIONS: f64 = 16.0;

/// Of a cell: weights of the first half and the second; then, of each component, sums of weight times value of the
/// first half and the second, and of weight times the model's mean at the places of the second.
pub type FieldCellSums = [f64; 11];

/// Of a field, by the cells' numbers.
pub type FieldCellTable = BTreeMap<u64, FieldCellSums>;

/// Cells over the box of all particles, the regions that are looked at, and the seed that halves their particles.
pub struct FieldCells {
    domain: Domain,
    grid: Grid,
    /// Regions along each axis, and whether each is looked at.
    regions: [usize; 3],
    looked_at: Vec<bool>,
    seed: u64,
}

/// A particle that is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldPlace {
    /// The number of its cell.
    pub cell: u64,
    /// 0 or 1.
    pub half: usize,
}

impl FieldCells {
    /// Of a snapshot of this metadata.
    pub fn new(metadata: &Metadata, seed: u64) -> FieldCells {
        let domain = Domain::new(&metadata.bounds, metadata.cell.as_ref());
        let edge = (CELL * domain.spacing(metadata.count as usize)).max(domain.longest() / MOST_CELLS);
        let grid = Grid::new(&domain, (domain.longest() / edge).round().max(1.0) as usize);
        let regions = grid.cells.map(|n| n.div_ceil(REGION));
        let number: usize = regions.iter().product();
        let share = (LOOKED_AT / metadata.count as f64).max(LEAST_REGIONS / number as f64);
        let is_in = |i: usize| Random::from_purpose(Purpose::FieldRegions, seed, i as u64).uniform() < share;
        FieldCells { looked_at: (0..number).map(is_in).collect(), domain, grid, regions, seed }
    }

    /// The cell and half of a particle; `None` of one that is not looked at. Places tell, so that parts of a snapshot
    /// agree with all of it.
    pub fn place(&self, x: [f64; 3]) -> Option<FieldPlace> {
        let (local, g) = (self.domain.local(x), &self.grid);
        let along = |k: usize| (self.domain.along(&local, k) / g.side[k]).max(0.0) as usize;
        let at = each_axis(|k| along(k).min(g.cells[k] - 1));
        let [i, j, k] = at.map(|n| n / REGION);
        if !self.looked_at[(i * self.regions[1] + j) * self.regions[2] + k] {
            return None;
        }
        let [a, b, c] = x.map(f64::to_bits);
        // The bits are moved apart, or equal coordinates would cancel.
        let mut of_place =
            Random::from_purpose(Purpose::FieldHalves, self.seed ^ a.rotate_left(21) ^ b.rotate_left(42), c);
        Some(FieldPlace { cell: g.index(at) as u64, half: (of_place.bits() & 1) as usize })
    }

    /// Signal and error of the means in cells, both without sampling noise: the variance of the model's means, their
    /// covariance with those of the second half, and that of the means of both halves.
    pub fn agreement(&self, sums: &FieldCellTable) -> FieldAgreement {
        let edge = self.grid.side.iter().copied().fold(0.0, f64::max);
        FieldAgreement { edge, ..compared(sums.values()) }
    }
}

fn compared<'a>(sums: impl Iterator<Item = &'a FieldCellSums>) -> FieldAgreement {
    let cells: Vec<&FieldCellSums> = sums.filter(|s| s[0] > 0.0 && s[1] > 0.0).collect();
    let total: f64 = cells.iter().map(|s| s[0] + s[1]).sum();
    let (mut signal, mut error, mut square) = (0.0, 0.0, 0.0);
    for c in 0..3 {
        let means = |s: &FieldCellSums| [s[2 + 3 * c] / s[0], s[3 + 3 * c] / s[1], s[4 + 3 * c] / s[1]];
        let mean: [f64; 3] = each_axis(|k| cells.iter().map(|s| (s[0] + s[1]) * means(s)[k]).sum::<f64>() / total);
        let covariance = |a: usize, b: usize| {
            let product = |s: &&FieldCellSums| {
                let m = means(s);
                (s[0] + s[1]) * (m[a] - mean[a]) * (m[b] - mean[b])
            };
            cells.iter().map(product).sum::<f64>() / total
        };
        // The halves' noise is independent: their covariance is the variance of the means without noise.
        signal += covariance(0, 1);
        square += covariance(0, 0) * covariance(1, 1);
        // The mean square of model - truth, of terms that the noise of the second half does not enter.
        error += covariance(0, 1) + covariance(2, 2) - 2.0 * covariance(1, 2);
    }
    // The covariance of what is noise alone has this standard error.
    let by_chance = (square / cells.len() as f64).sqrt();
    if cells.len() < LEAST_CELLS || signal.is_nan() || signal <= STANDS_OUT * by_chance {
        return FieldAgreement::default();
    }
    let root = |v: f64| v.max(0.0).sqrt().min(f64::from(f32::MAX));
    // The file holds them as f32.
    if !(f64::from(f32::MIN_POSITIVE)..f64::from(f32::MAX)).contains(&signal.sqrt()) {
        return FieldAgreement::default();
    }
    FieldAgreement { edge: 0.0, cells: cells.len() as u32, signal: root(signal), error: root(error) }
}

/// A cell's number and its sums.
const BYTES: usize = 8 + size_of::<FieldCellSums>();

/// The sums as a section of a part, little-endian.
pub fn field_section(sums: &FieldCellTable) -> Vec<u8> {
    let of_cell = |(cell, cell_sums): (&u64, &FieldCellSums)| {
        cell.to_le_bytes().into_iter().chain(cell_sums.iter().flat_map(|v| v.to_le_bytes())).collect::<Vec<u8>>()
    };
    sums.iter().flat_map(of_cell).collect()
}

/// Adds the sums of a section; `None` where they are none of these.
pub(super) fn add_field_section(sums: &mut FieldCellTable, bytes: &[u8]) -> Option<()> {
    let (cells, []) = bytes.as_chunks::<BYTES>() else { return None };
    for cell in cells {
        let (numbers, _) = cell.as_chunks::<8>();
        let cell_sums = sums.entry(u64::from_le_bytes(numbers[0])).or_default();
        cell_sums.iter_mut().zip(&numbers[1..]).for_each(|(a, v)| *a += f64::from_le_bytes(*v));
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_particles::testing::model_of;

    /// Cells whose true means have a deviation of 3, measured with noise by both halves, by a model that has 0.9 of
    /// them.
    #[test]
    fn noise_is_taken_off() {
        let sums: Vec<FieldCellSums> = (0..40_000)
            .map(|i| {
                let mut r = Random::new(2, 0, i);
                let (truth, mut cell) = (3.0 * r.normal(), FieldCellSums::default());
                (cell[0], cell[1]) = (2.0, 5.0);
                cell[2] = 2.0 * (truth + 2.0 * r.normal());
                cell[3] = 5.0 * (truth + 1.5 * r.normal());
                cell[4] = 5.0 * (0.9 * truth + 0.4 * r.normal());
                cell
            })
            .collect();
        let agreement = compared(sums.iter());
        let error = f64::sqrt(0.3 * 0.3 + 0.4 * 0.4);
        assert!((agreement.signal - 3.0).abs() < 0.06 && (agreement.error - error).abs() < 0.12, "{agreement:?}");
        assert_eq!(agreement.cells, 40_000);
        let noise: Vec<FieldCellSums> =
            sums.iter().map(|s| [1.0, 1.0, s[3], -s[3], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        assert_eq!(compared(noise.iter()), FieldAgreement::default());
        assert_eq!(compared(sums[..3].iter()).explained(), None);
    }

    #[test]
    fn about_as_many_particles_are_looked_at_as_is_wanted_in_halves() {
        for (count, share) in [(1 << 18, 1.0), (1 << 22, 0.125), (1 << 40, 16.0 / 32_768.0)] {
            let mut metadata = model_of(&[], [50.0; 3]).metadata;
            metadata.count = count;
            let cells = FieldCells::new(&metadata, 7);
            let place = |i: u64| {
                let mut r = Random::new(3, 0, i);
                cells.place([0, 1, 2].map(|_| 50.0 * r.uniform()))
            };
            let places: Vec<FieldPlace> = (0..40_000).filter_map(place).collect();
            let expected = 40_000.0 * share;
            assert!((places.len() as f64 / expected - 1.0).abs() < 0.7, "{count}: {}", places.len());
            let second = places.iter().filter(|p| p.half == 1).count() as f64;
            assert!((second - 0.5 * places.len() as f64).abs() < 2.0 * (places.len() as f64).sqrt(), "{second}");
        }
    }

    #[test]
    fn sections_add_up_and_contradictions_do_not() {
        let mut sums = FieldCellTable::from([(3, [1.5; 11]), (1 << 40, [-2.0; 11])]);
        let bytes = field_section(&sums);
        assert_eq!(bytes.len(), 2 * BYTES);
        add_field_section(&mut sums, &bytes).unwrap();
        assert_eq!(sums, FieldCellTable::from([(3, [3.0; 11]), (1 << 40, [-4.0; 11])]));
        assert!(add_field_section(&mut sums, &bytes[1..]).is_none());
    }
}
