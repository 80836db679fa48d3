//! A random subset of points, as many as a number of bytes holds: what users do who keep every k-th particle.

use super::CodedPoints;
use crate::Result;
use crate::context::Context;
use crate::math::{Purpose, Random};
use crate::space::Bounds;

/// Points come back this close to their places along every axis, in mean spacings.
const CLOSENESS: f64 = 0.05;
/// Bits a point that the search begins with: what those of a clustered snapshot take.
const FIRST_GUESS: f64 = 14.0;
/// Trials of a number at most; four are usual.
const TRIALS: usize = 8;
/// A subset is as large as the bytes where it leaves less than this share of them.
const CLOSE_ENOUGH: f64 = 1e-3;

/// A subset as it is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Thinning<'a> {
    /// The box that all points lie in.
    pub bounds: &'a Bounds,
    /// The mean spacing of all points, in their unit: positive, finite.
    pub spacing: f64,
    /// Bytes at most.
    pub bytes: u64,
    /// Of the random order.
    pub seed: u64,
}

impl Thinning<'_> {
    /// The most of `n` points whose places, coded, take at most the bytes, each within 0.05 of the spacing along every
    /// axis. They are the first of one random order of all points: their number is sought along the secant of the coded
    /// size, which is measured at every trial. `None` where not one fits. `place` is asked for finite places alone.
    pub fn most(
        &self,
        n: usize,
        place: impl Fn(usize) -> [f64; 3],
        context: &Context<'_>,
    ) -> Result<Option<CodedPoints>> {
        if n == 0 {
            return Ok(None);
        }
        context.begin("subset of the same bytes", 0);
        let mut order = RandomOrder::new(n, self.seed);
        let mut best: Option<(usize, CodedPoints)> = None;
        let bytes = self.bytes as f64;
        let mut number = share_of(n, 8.0 * bytes / FIRST_GUESS);
        // What is known to be too many.
        let mut upper_bound = n + 1;
        for _ in 0..TRIALS {
            context.check()?;
            let coded = self.coded(order.first(number), &place);
            let used = coded.bytes as f64;
            if coded.bytes as u64 <= self.bytes {
                best = Some((number, coded));
            } else {
                upper_bound = number;
            }
            let lower_bound = best.as_ref().map_or(0, |b| b.0);
            let full = best.as_ref().is_some_and(|b| b.1.bytes as f64 >= (1.0 - CLOSE_ENOUGH) * bytes);
            if full || lower_bound + 1 >= upper_bound {
                break;
            }
            // The coded size is nearly proportional to the number; a little less is aimed at than fits.
            let next = share_of(n, number as f64 * (1.0 - 0.3 * CLOSE_ENOUGH) * bytes / used);
            number = next.clamp(lower_bound + 1, upper_bound - 1);
        }
        context.end();
        Ok(best.map(|b| b.1))
    }

    fn coded(&self, indices: &[usize], place: impl Fn(usize) -> [f64; 3]) -> CodedPoints {
        let mut points: [Vec<f64>; 3] = Default::default();
        for &i in indices {
            let p = place(i);
            (0..3).for_each(|k| points[k].push(p[k]));
        }
        CodedPoints::new(&points, self.bounds, 2.0 * CLOSENESS * self.spacing)
    }
}

fn share_of(n: usize, wanted: f64) -> usize {
    (wanted as usize).clamp(1, n)
}

/// All points in a random order, as far as it was asked for.
struct RandomOrder {
    random: Random,
    taken: Vec<u64>,
    order: Vec<usize>,
    n: usize,
}

impl RandomOrder {
    fn new(n: usize, seed: u64) -> Self {
        let random = Random::from_purpose(Purpose::CertificateSubset, seed, 0);
        RandomOrder { random, taken: vec![0; n.div_ceil(64)], order: Vec::new(), n }
    }

    fn first(&mut self, k: usize) -> &[usize] {
        while self.order.len() < k {
            let i = ((u128::from(self.random.bits()) * self.n as u128) >> 64) as usize;
            let (word, bit) = (&mut self.taken[i / 64], 1u64 << (i % 64));
            if *word & bit == 0 {
                *word |= bit;
                self.order.push(i);
            }
        }
        &self.order[..k]
    }
}
