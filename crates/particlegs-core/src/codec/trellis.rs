//! Trellis-coded quantisation: two interleaved lattices, and eight states that say which one the
//! next number lies on (docs/format.md, section 7). At the same rate the mean squared error is 1.06 dB
//! below that of rounding.

pub(super) const STATES: usize = 8;
/// Next state by (state, parity of the index): Ungerboeck's 8-state code, h0 = 13, h1 = 04 (octal).
pub(super) const NEXT: [[u8; 2]; STATES] = [[0, 2], [5, 7], [1, 3], [4, 6], [2, 0], [7, 5], [3, 1], [6, 4]];
/// Numbers that are decided together; bounds the memory of the search.
const WINDOW: usize = 1 << 14;

/// The state that encoder and decoder share.
#[derive(Clone, Copy, Default)]
pub(crate) struct TrellisState(u8);

impl TrellisState {
    /// 0: whole steps; 1: half a step further.
    #[inline(always)]
    pub(crate) fn lattice(self) -> i32 {
        i32::from(self.0 & 1)
    }

    pub(super) fn from_number(number: usize) -> TrellisState {
        TrellisState(number as u8)
    }

    pub(super) fn number(self) -> usize {
        usize::from(self.0)
    }

    /// The half steps of index `k` here; goes on.
    #[inline(always)]
    pub(crate) fn half_steps(&mut self, k: i32) -> i32 {
        let half = 2 * k + self.lattice();
        self.step(i64::from(k));
        half
    }

    #[inline(always)]
    pub(crate) fn step(&mut self, k: i64) {
        self.0 = NEXT[self.0 as usize % 8][(k & 1) as usize];
    }
}

/// A number to quantise: `value` in steps; allowed indices. A squared error of one step costs 1.
#[derive(Clone, Copy)]
pub(crate) struct TrellisSample {
    pub value: f64,
    /// Lowest and highest index.
    pub range: [i64; 2],
    /// Cost of a step away from 0: what its bits are worth.
    pub pull: f64,
    /// Factor on the squared error.
    pub weight: f64,
}

impl TrellisSample {
    pub(crate) fn free(value: f64) -> Self {
        TrellisSample { value, range: [-(1 << 20), 1 << 20], pull: 0.0, weight: 1.0 }
    }
}

/// The index nearest to `x` of the asked parity within the range; the other end's neighbour where
/// rounding leaves it; `None` where the range has none.
#[inline]
pub(super) fn nearest(x: f64, parity: i64, range: [i64; 2]) -> Option<i64> {
    let lowest = range[0] + ((range[0] ^ parity) & 1);
    let highest = range[1] - ((range[1] ^ parity) & 1);
    if lowest > highest {
        return None;
    }
    let k = 2.0 * ((x - parity as f64) * 0.5).round() + parity as f64;
    Some(k.clamp(lowest as f64, highest as f64) as i64)
}

/// The indices of least total cost (Viterbi), from `state` on.
pub(crate) fn quantise(count: usize, sample: impl Fn(usize) -> TrellisSample) -> Vec<i64> {
    let mut out = Vec::with_capacity(count);
    let mut state = TrellisState::default();
    let mut predecessors: Vec<[u8; 8]> = Vec::with_capacity(WINDOW.min(count));
    while out.len() < count {
        let start = out.len();
        let end = count.min(start + WINDOW);
        let mut cost = [f64::INFINITY; 8];
        cost[state.0 as usize] = 0.0;
        predecessors.clear();
        for i in start..end {
            predecessors.push(advance(&mut cost, sample(i)));
        }
        // A window's best end is final: what follows goes on from there.
        let mut s = (0..8).min_by(|&a, &b| cost[a].total_cmp(&cost[b])).unwrap_or(0);
        state = TrellisState(s as u8);
        out.resize(end, 0);
        for i in (start..end).rev() {
            let (from, parity) = (predecessors[i - start][s] >> 1, i64::from(predecessors[i - start][s] & 1));
            let target = sample(i);
            let x = target.value - 0.5 * f64::from(from & 1);
            out[i] = nearest(x, parity, target.range).unwrap_or(target.range[0]);
            s = from as usize;
        }
    }
    out
}

/// One step of the search: the cheapest way into each state, as 2 (state before) + parity.
#[inline]
fn advance(cost: &mut [f64; 8], sample: TrellisSample) -> [u8; 8] {
    // Both lattices, both parities.
    let step_cost: [[f64; 2]; 2] = std::array::from_fn(|lattice| {
        let x = sample.value - 0.5 * lattice as f64;
        std::array::from_fn(|parity| match nearest(x, parity as i64, sample.range) {
            Some(k) => {
                let error = x - k as f64;
                sample.weight * error * error + sample.pull * (k as f64 + 0.5 * lattice as f64).abs()
            }
            None => f64::INFINITY,
        })
    });
    let mut next = [f64::INFINITY; 8];
    let mut from = [0u8; 8];
    for s in 0..8 {
        for parity in 0..2 {
            let total = cost[s] + step_cost[s & 1][parity];
            let to = NEXT[s][parity] as usize;
            if total < next[to] {
                next[to] = total;
                from[to] = (2 * s + parity) as u8;
            }
        }
    }
    *cost = next;
    from
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    #[test]
    fn error_is_a_decibel_below_rounding() {
        let values: Vec<f64> = (0..40_000).map(|i| Random::new(5, 0, i).uniform() * 1000.0).collect();
        let indices = quantise(values.len(), |i| TrellisSample::free(values[i]));
        let mut state = TrellisState::default();
        let mut mse = 0.0;
        for (v, &k) in values.iter().zip(&indices) {
            let e = v - k as f64 - 0.5 * f64::from(state.lattice());
            assert!(e.abs() <= 1.0);
            mse += e * e;
            state.step(k);
        }
        let gain = 10.0 * (values.len() as f64 / 12.0 / mse).log10();
        assert!(gain > 1.0, "{gain} dB");
    }

    #[test]
    fn ranges_are_kept() {
        let values: Vec<f64> = (0..1000).map(|i| Random::new(6, 0, i).uniform() * 3.0).collect();
        for top in 0..3 {
            let indices =
                quantise(values.len(), |i| TrellisSample { range: [0, top], ..TrellisSample::free(values[i]) });
            assert!(indices.iter().all(|k| (0..=top).contains(k)));
        }
    }

    #[test]
    fn zeros_of_great_weight_stay_zeros() {
        let is_zero = |i: usize| i % 5 > 1;
        let value = |i: usize| if is_zero(i) { 0.0 } else { Random::new(7, 0, i as u64).uniform() * 9.0 - 4.5 };
        let weight = |i: usize| if is_zero(i) { 1e6 } else { 1.0 };
        let indices = quantise(5000, |i| TrellisSample { weight: weight(i), ..TrellisSample::free(value(i)) });
        let mut state = TrellisState::default();
        for (i, &k) in indices.iter().enumerate() {
            let half = state.half_steps(k as i32);
            assert!(
                if is_zero(i) { half == 0 } else { (0.5 * f64::from(half) - value(i)).abs() <= 1.0 },
                "{i}: {half}"
            );
        }
    }
}
