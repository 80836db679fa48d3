//! Even draws within a Gaussian: counts in cells near the model's, without shot noise.

use super::quantile::quantile;
use super::spaced::{mixed, unit};

/// Steps of the sequence: powers of 1 / g, g^4 = g + 1 (Roberts 2018, the generalised golden ratio in
/// three dimensions).
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];

/// Replaces `raw` by standard normals: particles `first` and on of the Gaussian that `key` names, at
/// the places of a low-discrepancy sequence with a random start.
pub fn stratify(key: [u64; 2], first: u64, raw: &mut [&mut [f64]; 3]) {
    let mut state = mixed(key[0] ^ mixed(key[1]));
    for (column, step) in raw.iter_mut().zip(STEPS) {
        state = mixed(state);
        let start = unit(state);
        for (i, z) in column.iter_mut().enumerate() {
            *z = quantile((start + (first + i as u64) as f64 * step).fract());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_are_filled_evenly_and_runs_join() {
        let mut columns = [0; 3].map(|_| vec![0.0; 1000]);
        let [x, y, z] = &mut columns;
        stratify([1, 2], 0, &mut [x, y, z]);
        let octant = |i: usize| (0..3).map(|k| usize::from(columns[k][i] > 0.0) << k).sum::<usize>();
        let mut counts = [0; 8];
        (0..1000).for_each(|i| counts[octant(i)] += 1);
        // Random draws would scatter by 10.
        assert!(counts.iter().all(|&c| (115..=135).contains(&c)), "{counts:?}");
        let mut rest = [0; 3].map(|_| vec![0.0; 300]);
        let [x, y, z] = &mut rest;
        stratify([1, 2], 700, &mut [x, y, z]);
        assert!((0..3).all(|k| rest[k][..] == columns[k][700..]));
    }
}
