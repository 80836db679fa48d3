//! Neighbouring Gaussians whose counts keep their sum: pictures move mass between neighbours,
//! not across the box. The largest scales' power, and what is drawn with a large radius, hang on that.

use super::parameters::{FrameChange, Numbers};

/// Share of a group's straying that is mended at each coding, and the farthest that goes.
const CHASE: f64 = 0.2;
const FARTHEST: f64 = 1.25;

/// The group of every Gaussian, and the groups' particles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianGroups {
    pub of: Vec<u32>,
    pub counts: Vec<f64>,
    /// Sums of the parameters' counts, by group, with which the decoded ones sum to `counts`.
    pub aims: Vec<f64>,
}

impl GaussianGroups {
    /// Halves of halves at the median of the widest axis, until they have `most` Gaussians at most; 0 =
    /// all in one.
    pub fn new(now: &[Numbers], particles: u64, most: u64) -> GaussianGroups {
        let mut groups = GaussianGroups { of: vec![0; now.len()], ..GaussianGroups::default() };
        let mut order: Vec<u32> = (0..now.len() as u32).collect();
        let most = if most == 0 { now.len() } else { usize::try_from(most).unwrap_or(usize::MAX) };
        groups.split(now, &mut order, most);
        groups.count(now, particles);
        groups
    }

    fn split(&mut self, now: &[Numbers], members: &mut [u32], most: usize) {
        if members.len() <= most {
            members.iter().for_each(|&i| self.of[i as usize] = self.counts.len() as u32);
            self.counts.push(0.0);
            return;
        }
        let width = |k: usize| {
            let at = members.iter().map(|&i| now[i as usize][k]);
            at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
        };
        let widths = [0, 1, 2].map(width);
        let axis = (0..3).fold(0, |a, k| if widths[k] > widths[a] { k } else { a });
        let at = |i: u32| now[i as usize][axis];
        let middle = members.len() / 2;
        members.select_nth_unstable_by(middle, |&a, &b| at(a).total_cmp(&at(b)).then(a.cmp(&b)));
        let (low, high) = members.split_at_mut(middle);
        self.split(now, low, most);
        self.split(now, high, most);
    }

    /// Sums over groups of a number a Gaussian.
    fn sums(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.counts.len()];
        self.of.iter().enumerate().for_each(|(i, &g)| sums[g as usize] += value(i));
        sums
    }

    /// The groups' particles are those of `now`, of `particles` in all.
    pub fn count(&mut self, now: &[Numbers], particles: u64) {
        self.counts = self.sums(|i| now[i][9].exp());
        let scale = particles as f64 / self.counts.iter().sum::<f64>();
        self.counts.iter_mut().for_each(|c| *c *= scale);
        self.aims = self.counts.clone();
    }

    /// Aims so that groups whose `decoded` counts strayed come back.
    pub fn aim(&mut self, decoded: &[Numbers]) {
        let sums = self.sums(|i| decoded[i][9].exp());
        for ((aim, count), sum) in self.aims.iter_mut().zip(&self.counts).zip(sums) {
            let correction = (CHASE * (count / sum).ln()).exp();
            *aim = (*aim * correction).clamp(count / FARTHEST, count * FARTHEST);
        }
    }

    /// The gradient with logarithms of counts, for counts whose sums stay: what one gains its group
    /// loses.
    pub(super) fn share(&self, gradient: &mut [f32], now: &[Numbers]) {
        let total = self.sums(|i| f64::from(gradient[i]));
        let counts = self.sums(|i| now[i][9].exp());
        for ((g, n), &k) in gradient.iter_mut().zip(now).zip(&self.of) {
            let k = k as usize;
            *g -= (total[k] * n[9].exp() / counts[k].max(f64::MIN_POSITIVE)) as f32;
        }
    }

    /// Shifts changes of logarithms of counts so that the groups keep their particles.
    pub(super) fn keep(&self, now: &[Numbers], changes: &mut [FrameChange]) {
        let changed = self.sums(|i| (now[i][9] + f64::from(changes[i][9])).exp());
        let shift = |(aim, changed): (&f64, f64)| (aim / changed).ln() as f32;
        let shifts: Vec<f32> = self.aims.iter().zip(changed).map(shift).collect();
        changes.iter_mut().zip(&self.of).for_each(|(by, &g)| by[9] += shifts[g as usize]);
    }
}
