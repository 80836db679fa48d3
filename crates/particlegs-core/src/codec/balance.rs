//! Codes of counts moved so that sums over all Gaussians come out as wanted: the power spectrum hangs on the few
//! Gaussians that hold most particles, and rounding their counts alone shifts it by per cents.
//!
//! A code that is moved changes the trellis's state for those after it. So codes are moved in runs of four that end in
//! the state in which they ended before: there are two sequences of parities for each pair of states.

use super::trellis::TrellisState;
use crate::math::{exp, floor_index};
use crate::{Error, Result, parallel};
use std::ops::Range;

/// Sums over Gaussians that the counts' codes are to change.
pub struct CountBalance<'a> {
    /// The change of each sum for a change of ln count, Gaussian by Gaussian in the order of the file.
    pub responses: &'a [f32],
    /// The change that is wanted of each sum, of [`MOST_SUMS`] at most.
    pub wanted: &'a [f64],
    /// The error that each sum may keep.
    pub within: f64,
}

impl CountBalance<'_> {
    /// The change of each sum for a change of ln count of a Gaussian.
    fn responses_of(&self, at: usize) -> SumChanges {
        let kinds = self.wanted.len();
        let mut responses = SumChanges::default();
        responses.iter_mut().zip(&self.responses[at * kinds..][..kinds]).for_each(|(r, v)| *r = f64::from(*v));
        responses
    }

    /// Refuses more sums than there may be, or responses of another number of Gaussians.
    pub(super) fn check(&self, gaussians: usize) -> Result<()> {
        let sums = self.wanted.len();
        if sums > MOST_SUMS || self.responses.len() != sums * gaussians {
            let message =
                format!("counts can be balanced for {MOST_SUMS} sums at most, with a response of each Gaussian");
            return Err(Error::argument(message));
        }
        Ok(())
    }
}

/// Sums at most.
pub const MOST_SUMS: usize = 32;

/// What is left of the change of each sum.
type SumChanges = [f64; MOST_SUMS];

/// Codes in a run.
const RUN: usize = 4;
/// What a sum's error is worth, in nats, in units of the error that is allowed. That is smaller from one descent to the
/// next by a factor, so that what costs least is moved first; the largest error that is left is as much larger.
const NATS: f64 = 4.0;
const FINER: f64 = 3.0;
/// Errors below this are mended in the last descent alone: those before would move counts back that were moved already.
const SMALL: f64 = 4e-3;
/// Runs that are looked at, at most: of millions of Gaussians these have enough to move.
const MOST_RUNS: usize = 3000;
/// Passes over the runs in a descent, and moves of a pass.
const SWEEPS: usize = 3;
const MOST_MOVES: usize = 200;
/// The shape and place of a Gaussian that is moved are rounded anew: what that costs in nats, and how far it moves the
/// sums, in responses.
const MOVE: f64 = 0.5;
const ROUNDED: f64 = 0.1;

/// Codes that are moved in steps of a kind.
trait Descent: Sync {
    type Move;
    /// The move at a place that gains most, what it leaves of the sums, and its gain over what is there, in nats.
    fn best(&self, place: usize, left: &SumChanges, weight: f64) -> (Self::Move, SumChanges, f64);
    fn take(&mut self, place: usize, chosen: Self::Move);
}

/// Moves codes at `places`: those first that gain most, so that few are moved.
fn descend<D: Descent>(descent: &mut D, places: &[usize], balance: &CountBalance<'_>) {
    let mut left = SumChanges::default();
    left.iter_mut().zip(balance.wanted).for_each(|(left, wanted)| *left = *wanted);
    let largest = |left: &SumChanges| left.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    let within = balance.within;
    let mut error = if largest(&left) < SMALL { within / FINER } else { largest(&left) / FINER };
    while largest(&left) > within && error > within / FINER / FINER {
        let weight = NATS / (error * error);
        for _ in 0..SWEEPS {
            let gains = parallel::map_range(places.len(), |i| descent.best(places[i], &left, weight).2);
            let mut moves: Vec<(f64, usize)> = gains.into_iter().zip(places.iter().copied()).collect();
            moves.retain(|(gain, _)| *gain > 0.0);
            moves.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let mut is_still = true;
            for (_, place) in moves.into_iter().take(MOST_MOVES) {
                // What was moved since may have taken its gain.
                let (chosen, rest, gain) = descent.best(place, &left, weight);
                if gain > 0.0 {
                    descent.take(place, chosen);
                    (left, is_still) = (rest, false);
                }
            }
            if is_still || largest(&left) <= within {
                break;
            }
        }
        error /= FINER;
    }
}

/// Counts whose codes are whole steps, each by itself.
pub(super) struct StepDescent<'a> {
    pub balance: &'a CountBalance<'a>,
    /// Each count as it should be, and its ln over that of code 0.
    pub targets: &'a [(f64, f64)],
    pub step: f64,
    /// The largest code.
    pub most: i32,
    pub codes: &'a mut [i32],
}

impl StepDescent<'_> {
    pub(super) fn run(&mut self) {
        let (places, balance): (Vec<usize>, _) = ((0..self.codes.len()).collect(), self.balance);
        descend(self, &places, balance);
    }
}

impl Descent for StepDescent<'_> {
    type Move = i32;

    fn best(&self, place: usize, left: &SumChanges, weight: f64) -> (i32, SumChanges, f64) {
        let (responses, code, (count, log)) =
            (self.balance.responses_of(place), self.codes[place], self.targets[place]);
        let error = |code: i32| f64::from(code) * self.step - log;
        let mut best = (code, *left, 0.0);
        // Further than a step from what it should be a count is wrong, whatever the sums gain.
        let is_near = |next: &i32| next.abs() <= self.most && error(*next).abs() < self.step;
        for next in [code - 1, code + 1].into_iter().filter(is_near) {
            let change = exp(f64::from(next - code) * self.step) - 1.0;
            let rest: SumChanges = std::array::from_fn(|s| left[s] - change * responses[s]);
            let lost = 0.5 * count * (error(next) * error(next) - error(code) * error(code)) + MOVE;
            let gain = weight * (product(left, left) - product(&rest, &rest)) - lost;
            if gain > best.2 {
                best = (next, rest, gain);
            }
        }
        best
    }

    fn take(&mut self, place: usize, code: i32) {
        self.codes[place] = code;
    }
}

/// Counts in the order of the file, and what is left of the balance.
pub(super) struct CountDescent<'a> {
    balance: &'a CountBalance<'a>,
    /// ln of each count as it should be.
    targets: &'a [f64],
    /// A whole step of ln count.
    step: f64,
    /// Codes in half steps.
    codes: &'a mut [i32],
    /// The trellis's state before each code.
    states: Vec<TrellisState>,
}

/// A code that a count may have.
#[derive(Clone, Copy, Default)]
struct CountCode {
    code: i32,
    /// Its squared error and what it changes in the sums', as far as it is in proportion to the change, in nats.
    cost: f64,
    /// The relative change of the count.
    change: f64,
}

/// Of each code of a run, by lattice: the two nearest of either parity.
type RunCodes = [[[CountCode; 4]; 2]; RUN];

impl CountDescent<'_> {
    /// Moves codes within segments, in which trellises begin anew.
    pub(super) fn run(
        balance: &CountBalance<'_>,
        (targets, step): (&[f64], f64),
        codes: &mut [i32],
        segments: &[Range<usize>],
    ) {
        let all = segments.iter().flat_map(|s| s.start..(s.end + 1).saturating_sub(RUN).max(s.start));
        let starts: Vec<usize> = all.step_by(codes.len().div_ceil(MOST_RUNS).max(1)).collect();
        let states = states(codes, segments);
        descend(&mut CountDescent { balance, targets, step, codes, states }, &starts, balance);
    }

    /// What a code loses, in nats.
    fn error(&self, at: usize, code: i32) -> f64 {
        let error = 0.5 * f64::from(code) * self.step - self.targets[at];
        0.5 * exp(self.targets[at]) * error * error
    }

    /// `moved` is the cost of moving the code at all, and `toward` half of what a change of the count takes off the sums'
    /// squared errors, in nats.
    fn candidates(&self, at: usize, moved: f64, toward: f64) -> [[CountCode; 4]; 2] {
        let (target, count) = (self.targets[at], exp(self.targets[at]));
        std::array::from_fn(|lattice| {
            let below = floor_index(target / self.step - 0.5 * lattice as f64) as i32;
            std::array::from_fn(|i| {
                let code = 2 * (below - 1 + i as i32) + lattice as i32;
                let error = 0.5 * f64::from(code) * self.step - target;
                let cost = 0.5 * count * error * error;
                match code - self.codes[at] {
                    0 => CountCode { code, cost, change: 0.0 },
                    half_steps => {
                        let change = exp(0.5 * f64::from(half_steps) * self.step) - 1.0;
                        CountCode { code, cost: cost + moved - 2.0 * change * toward, change }
                    }
                }
            })
        })
    }
}

impl Descent for CountDescent<'_> {
    type Move = [i32; RUN];

    /// The codes from `start` on that lose least.
    fn best(&self, start: usize, left: &SumChanges, weight: f64) -> ([i32; RUN], SumChanges, f64) {
        let mut end = self.states[start + RUN - 1];
        end.half_steps(self.codes[start + RUN - 1] >> 1);
        let responses: [SumChanges; RUN] = std::array::from_fn(|i| self.balance.responses_of(start + i));
        // What changes leave of the sums is taken from products of responses: sequences are many, products few.
        let products = responses.map(|a| responses.map(|b| weight * product(&a, &b)));
        let candidates: RunCodes = std::array::from_fn(|i| {
            let toward = weight * product(left, &responses[i]);
            self.candidates(start + i, MOVE + ROUNDED * ROUNDED * products[i][i], toward)
        });
        let least =
            candidates.map(|of_code| of_code.iter().flatten().fold(f64::INFINITY, |least, c| least.min(c.cost)));
        let least_after = std::array::from_fn(|place| least[place + 1..].iter().sum());
        let codes: [i32; RUN] = std::array::from_fn(|i| self.codes[start + i]);
        let before: f64 = (0..RUN).map(|i| self.error(start + i, codes[i])).sum();
        let mut search = RunSearch { candidates, products, least_after, end, best: (codes, [0.0; RUN], before) };
        search.go_on(0, self.states[start], ([0; RUN], [0.0; RUN], 0.0, 0.0));
        let (codes, changes, cost) = search.best;
        let left = std::array::from_fn(|s| left[s] - (0..RUN).map(|i| changes[i] * responses[i][s]).sum::<f64>());
        (codes, left, before - cost)
    }

    fn take(&mut self, start: usize, codes: [i32; RUN]) {
        for (i, code) in codes.into_iter().enumerate() {
            self.codes[start + i] = code;
            if i + 1 < RUN {
                self.states[start + i + 1] = self.states[start + i];
                self.states[start + i + 1].half_steps(code >> 1);
            }
        }
    }
}

/// The trellis's state before each code.
fn states(codes: &[i32], segments: &[Range<usize>]) -> Vec<TrellisState> {
    let mut states = Vec::with_capacity(codes.len());
    for segment in segments {
        let mut state = TrellisState::default();
        for code in &codes[segment.clone()] {
            states.push(state);
            state.half_steps(code >> 1);
        }
    }
    states
}

/// All sequences of a run's codes that end in a state.
struct RunSearch {
    candidates: RunCodes,
    /// What changes of two counts add to the sums' squared errors, in nats.
    products: [[f64; RUN]; RUN],
    /// The least cost of the codes after each.
    least_after: [f64; RUN],
    end: TrellisState,
    /// The codes of least cost, their changes, and that cost.
    best: ([i32; RUN], [f64; RUN], f64),
}

impl RunSearch {
    /// Codes and changes up to a place, their cost, and what products add to it.
    fn go_on(&mut self, place: usize, state: TrellisState, part: ([i32; RUN], [f64; RUN], f64, f64)) {
        let (mut codes, mut changes, cost, added) = part;
        if place == RUN {
            if cost + added < self.best.2 {
                self.best = (codes, changes, cost + added);
            }
            return;
        }
        for candidate in self.candidates[place][state.lattice() as usize] {
            let (mut next, change) = (state, candidate.change);
            next.half_steps(candidate.code >> 1);
            let cost = cost + candidate.cost;
            // Products add nothing at best. What ends elsewhere or costs more already is not followed.
            if cost + self.least_after[place] >= self.best.2 || (place + 1 == RUN && next != self.end) {
                continue;
            }
            let products = &self.products[place];
            let common: f64 = (0..place).map(|i| changes[i] * products[i]).sum();
            let added = added + change * (change * products[place] + 2.0 * common);
            (codes[place], changes[place]) = (candidate.code, change);
            self.go_on(place + 1, next, (codes, changes, cost, added));
        }
    }
}

fn product(a: &SumChanges, b: &SumChanges) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::{Encoder, Precision, decode_block};
    use crate::math::{Random, Sym3, each_axis};
    use crate::model::{Block, Mixture};
    use crate::space::Bounds;

    fn block(gaussians: usize) -> Block {
        let mut mixture = Mixture::default();
        for i in 0..gaussians {
            let mut r = Random::new(11, 0, i as u64);
            let mean = each_axis(|_| 10.0 * r.uniform());
            let cov = Sym3([0.02 + 0.05 * r.uniform(), 0.005 * r.normal(), 0.0, 0.03, 0.0, 0.01 + 0.05 * r.uniform()]);
            mixture.push(mean, cov, (20.0 * libm::exp(1.5 * r.normal())).floor() + 1.0, 0.0);
        }
        let count = mixture.count.iter().sum::<f64>() as u64;
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        Block { bounds, count, mass: count as f64, gaussians: mixture }
    }

    /// Shares of the counts on one side of each axis: sums whose change is known.
    fn sums(mixture: &Mixture) -> Vec<f64> {
        let total: f64 = mixture.count.iter().sum();
        let side = |k: usize| (0..mixture.len()).filter(move |&i| mixture.mean[k][i] < 5.0);
        (0..3).map(|k| side(k).map(|i| mixture.count[i]).sum::<f64>() / total).collect()
    }

    #[test]
    fn sums_change_as_wanted_and_few_gaussians_with_them() {
        let (original, precision) = (block(3000), Precision::BALANCED);
        let mut encoder = Encoder::new(&original).unwrap();
        let first = decode_block(&encoder.encode(&precision), "a test").unwrap();
        let wanted: Vec<f64> =
            sums(&first.gaussians).iter().zip([0.004, -0.002, 0.001]).map(|(s, by)| s + by).collect();
        let mut last = first.clone();
        for _ in 0..3 {
            encoder.settle(&precision, &last).unwrap();
            let (g, reached) = (&last.gaussians, sums(&last.gaussians));
            let total: f64 = g.count.iter().sum();
            let response = |i: usize, k: usize| {
                let inside = if g.mean[k][i] < 5.0 { 1.0 } else { 0.0 };
                (g.count[i] / total * (inside - reached[k])) as f32
            };
            let responses: Vec<f32> = (0..g.len()).flat_map(|i| (0..3).map(move |k| response(i, k))).collect();
            let left: Vec<f64> = wanted.iter().zip(&reached).map(|(w, r)| w - r).collect();
            encoder
                .balance_counts(&precision, &CountBalance { responses: &responses, wanted: &left, within: 1e-4 })
                .unwrap();
            last = decode_block(&encoder.encode(&precision), "a test").unwrap();
        }
        for (reached, wanted) in sums(&last.gaussians).iter().zip(&wanted) {
            assert!((reached - wanted).abs() < 1.5e-4, "{reached} {wanted}");
        }
        // Steps hang on the mean count, so that all shapes change by digits that nobody sees.
        let differs = |a: Sym3, b: Sym3| (0..6).any(|k| (a.0[k] - b.0[k]).abs() > 1e-3 * a.trace());
        let moved = (0..3000).filter(|&i| differs(last.gaussians.cov_of(i), first.gaussians.cov_of(i))).count();
        assert!((1..300).contains(&moved), "{moved}");
        assert_eq!(last.gaussians.count.iter().sum::<f64>(), original.count as f64);
    }

    #[test]
    fn nothing_is_moved_where_nothing_is_wanted_or_there_are_too_few() {
        for gaussians in [1, 3, 200] {
            let (block, precision) = (block(gaussians), Precision::BALANCED);
            let mut encoder = Encoder::new(&block).unwrap();
            let bytes = encoder.encode(&precision);
            encoder.settle(&precision, &decode_block(&bytes, "a test").unwrap()).unwrap();
            let responses = vec![0.1; gaussians];
            encoder
                .balance_counts(&precision, &CountBalance { responses: &responses, wanted: &[0.0], within: 1e-4 })
                .unwrap();
            assert!(encoder.encode(&precision) == bytes);
            let short = CountBalance { responses: &[], wanted: &[0.0], within: 1e-4 };
            assert!(encoder.balance_counts(&precision, &short).is_err());
        }
    }
}
