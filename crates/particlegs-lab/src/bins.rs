//! Coordinates as bin numbers. Bins are twice the error bound wide and decode to their centres. Centres are rounded to
//! float32; the few particles that rounding would put beyond the bound decode to the edge of their bin instead.

use crate::PositionColumns;

/// Upper limit of half bins along an axis.
const MOST_BINS: f64 = 4_294_967_296.0;

/// The bin of a coordinate that lies this many bounds above the lowest.
fn bin(bounds: f64) -> u32 {
    (bounds.floor() / 2.0).floor() as u32
}

/// The bins as the file stores them.
#[derive(Clone, Debug, PartialEq)]
pub struct BinGrid {
    pub particles: usize,
    pub bound: f64,
    /// The lowest coordinate along each axis.
    pub low: [f32; 3],
    pub high: [f32; 3],
}

pub struct ParticleBins {
    pub grid: BinGrid,
    /// Bin of each particle.
    pub of: Vec<[u32; 3]>,
    /// Per axis, the particles that rounding puts beyond the bound, and whether they lie above the centre.
    exceptions: [Vec<(u32, bool)>; 3],
}

impl BinGrid {
    fn centre(&self, axis: usize, bin: u32) -> f64 {
        f64::from(self.low[axis]) + (2.0 * f64::from(bin) + 1.0) * self.bound
    }

    /// The upper or lower edge of a bin.
    fn moved(&self, axis: usize, bin: u32, up: bool) -> f32 {
        (self.centre(axis, bin) + if up { self.bound } else { -self.bound }) as f32
    }

    /// Coordinates of particles: bin centres, except for those that [`ParticleBins::moved`] lists. `None` if the list
    /// does not fit the bins.
    pub fn coordinates(&self, bins: &[[u32; 3]], moved: &[Vec<i64>; 3]) -> Option<PositionColumns> {
        let mut all: PositionColumns = [0, 1, 2].map(|k| bins.iter().map(|b| self.centre(k, b[k]) as f32).collect());
        for (k, column) in all.iter_mut().enumerate() {
            let mut at = 0i64;
            for step in &moved[k] {
                at = at.checked_add(*step)?;
                let i = usize::try_from(at / 2).ok().filter(|i| at >= 0 && *i < bins.len())?;
                column[i] = self.moved(k, bins[i][k], at % 2 == 1);
            }
        }
        Some(all)
    }

    /// Range divided by the bound, along each axis.
    pub fn count(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| (f64::from(self.high[k]) - f64::from(self.low[k])) / self.bound)
    }

    /// The last bin along each axis that can hold particles.
    pub fn last(&self) -> [u32; 3] {
        self.count().map(bin)
    }

    /// Reads what [`ParticleBins::write`] wrote; also returns the rest of the bytes.
    pub fn read(bytes: &[u8]) -> Option<(BinGrid, &[u8])> {
        let (head, rest) = bytes.split_first_chunk::<40>()?;
        let word = |at: usize| <[u8; 4]>::try_from(&head[at..at + 4]).expect("four bytes");
        let long = |at: usize| <[u8; 8]>::try_from(&head[at..at + 8]).expect("eight bytes");
        let axes = |at: usize| [0, 1, 2].map(|k| f32::from_le_bytes(word(at + 4 * k)));
        let grid = BinGrid {
            particles: usize::try_from(u64::from_le_bytes(long(0))).ok()?,
            bound: f64::from_le_bytes(long(8)),
            low: axes(16),
            high: axes(28),
        };
        let fine = grid.bound > 0.0 && grid.low.iter().chain(&grid.high).all(|v| v.is_finite());
        (fine && grid.count().iter().all(|n| *n < MOST_BINS)).then_some((grid, rest))
    }
}

impl ParticleBins {
    /// Puts particles into bins; `None` for too many bins, coordinates that are not finite, no particles, or 2^32
    /// particles and more.
    pub fn new(particles: &PositionColumns, bound: f64) -> Option<ParticleBins> {
        let n = particles[0].len();
        let ends =
            |c: &Vec<f32>| c.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |e, v| [e[0].min(*v), e[1].max(*v)]);
        let ends = particles.each_ref().map(ends);
        let grid = BinGrid { particles: n, bound, low: ends.map(|e| e[0]), high: ends.map(|e| e[1]) };
        let count = grid.count();
        // Minima ignore NaN.
        let fine = count.iter().all(|c| *c < MOST_BINS) && !particles.iter().flatten().any(|v| v.is_nan());
        if n == 0 || u32::try_from(n).is_err() || !fine {
            return None;
        }
        let mut bins = vec![[0u32; 3]; n];
        let mut exceptions = [Vec::new(), Vec::new(), Vec::new()];
        for k in 0..3 {
            let low = f64::from(grid.low[k]);
            for (i, v) in particles[k].iter().enumerate() {
                let v = f64::from(*v);
                bins[i][k] = bin((v - low) / bound);
                // As the decoder rounds it.
                let centre = f64::from(grid.centre(k, bins[i][k]) as f32);
                if (centre - v).abs() > bound {
                    exceptions[k].push((i as u32, v > centre));
                }
            }
        }
        Some(ParticleBins { grid, of: bins, exceptions })
    }

    /// The particles that rounding puts beyond the bound along an axis: twice their position in `order` (`None` = the
    /// input order), plus one if they lie above the centre; sorted, the first value and then differences.
    pub fn moved(&self, axis: usize, order: Option<&[u32]>) -> Vec<i64> {
        let exceptions = &self.exceptions[axis];
        if exceptions.is_empty() {
            return Vec::new();
        }
        let at = order.map(|order| {
            let mut at = vec![0u32; order.len()];
            (0u32..).zip(order).for_each(|(to, from)| at[*from as usize] = to);
            at
        });
        let place = |i: u32| i64::from(at.as_ref().map_or(i, |at| at[i as usize]));
        let mut moved: Vec<i64> = exceptions.iter().map(|(i, up)| 2 * place(*i) + i64::from(*up)).collect();
        moved.sort_unstable();
        let mut last = 0;
        moved.iter_mut().for_each(|v| (last, *v) = (*v, *v - last));
        moved
    }

    pub fn write(&self, out: &mut Vec<u8>) {
        let BinGrid { particles, bound, low, high } = &self.grid;
        out.extend((*particles as u64).to_le_bytes());
        out.extend(bound.to_le_bytes());
        low.iter().chain(high).for_each(|v| out.extend(v.to_le_bytes()));
    }
}
