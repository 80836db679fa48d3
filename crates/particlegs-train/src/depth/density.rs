//! Density control at a fixed number: Gaussians that pictures hardly depend on are merged into a
//! neighbour, and their places go to halves of those whose gradients are the largest. Counts and first
//! and second moments stay exactly what they were.

use super::parameters::{DepthGaussians, Numbers};
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::Mixture;
use particlegs_core::parallel;

/// Gaussians moved at most at a time.
const MOST: usize = 512;
/// Halves of a normal distribution have their means this many sigma from its own: sqrt(2 / pi).
const HALF_MEAN: f64 = 0.797_884_560_802_865_4;

/// A Gaussian that gave up its place, the one it was merged into, and the one whose half came there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Relocation {
    pub from: usize,
    pub into: usize,
    pub half_of: usize,
}

/// Moves `share` of the Gaussians, by the size of their gradients, and tells which.
pub(super) fn relocate(columns: &mut DepthGaussians, gradients: &[f64], share: f64) -> Vec<Relocation> {
    let m = columns.0.len();
    let number = ((share * m as f64) as usize).min(MOST).min(m / 4);
    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&a, &b| gradients[a].total_cmp(&gradients[b]).then(a.cmp(&b)));
    let mixture = columns.mixture();
    let mut taken = vec![false; m];
    let (quiet, loud) = (&order[..number], &order[m - number..]);
    quiet.iter().chain(loud).for_each(|&i| taken[i] = true);
    let neighbours = parallel::map(quiet, |&i| nearest(&mixture, i, &taken));
    let mut moves = Vec::with_capacity(number);
    for ((&from, into), &half_of) in quiet.iter().zip(neighbours).zip(loud.iter().rev()) {
        // A neighbour that another has been merged into meanwhile is taken as it is now.
        let Some(into) = into else { continue };
        columns.0[into] = merged(&columns.0[into], &columns.0[from]);
        let (a, b) = halves(&columns.0[half_of]);
        (columns.0[half_of], columns.0[from]) = (a, b);
        moves.push(Relocation { from, into, half_of });
    }
    moves
}

/// The Gaussian nearest to `i` that is not taken, in units of both spreads.
fn nearest(m: &Mixture, i: usize, taken: &[bool]) -> Option<usize> {
    let (at, size) = (m.mean_of(i), m.cov_of(i).trace());
    let mut best = (f64::INFINITY, None);
    for (j, _) in taken.iter().enumerate().filter(|(_, t)| !**t) {
        let square: f64 = (0..3).map(|k| (m.mean[k][j] - at[k]).powi(2)).sum();
        let distance = square / (size + m.cov[0][j] + m.cov[3][j] + m.cov[5][j]);
        if distance < best.0 {
            best = (distance, Some(j));
        }
    }
    best.1
}

/// One Gaussian of the count, mean and covariance of two.
fn merged(a: &Numbers, b: &Numbers) -> Numbers {
    let (na, nb) = (a[9].exp(), b[9].exp());
    let n = na + nb;
    let (wa, wb) = (na / n, nb / n);
    let mean: [f64; 3] = each_axis(|k| wa * a[k] + wb * b[k]);
    let apart: [f64; 3] = each_axis(|k| a[k] - b[k]);
    let both = covariance(a).scale(wa).add(&covariance(b).scale(wb));
    numbers(mean, &both.add(&Sym3::outer(apart).scale(wa * wb)), n)
}

/// The halves of a Gaussian on either side of the plane through its mean across its longest axis.
fn halves(g: &Numbers) -> (Numbers, Numbers) {
    let cov = covariance(g);
    let e = cov.eigen();
    let offset = e.vectors[0].map(|v| HALF_MEAN * e.values[0].max(0.0).sqrt() * v);
    let rest = cov.add(&Sym3::outer(offset).scale(-1.0));
    let half = |sign: f64| numbers(each_axis(|k| g[k] + sign * offset[k]), &rest, 0.5 * g[9].exp());
    (half(1.0), half(-1.0))
}

fn covariance(g: &Numbers) -> Sym3 {
    DepthGaussians(vec![*g]).mixture().cov_of(0)
}

fn numbers(mean: [f64; 3], cov: &Sym3, count: f64) -> Numbers {
    let mut m = Mixture::default();
    m.push(mean, *cov, count, 0.0);
    DepthGaussians::from_mixture(&m, |i| i).0[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    fn some(number: usize) -> DepthGaussians {
        let mut m = Mixture::default();
        for i in 0..number {
            let mut d = Random::new(3, 0, i as u64);
            let mut cov = Sym3::scaled_identity(0.01);
            for _ in 0..3 {
                cov = cov.add(&Sym3::outer(each_axis(|_| 0.3 * d.normal())));
            }
            m.push(each_axis(|_| d.normal()), cov, 1.0 + 50.0 * d.uniform(), 0.0);
        }
        DepthGaussians::from_mixture(&m, |i| i)
    }

    /// Sums of counts, means and second moments.
    fn sums(c: &DepthGaussians) -> [f64; 10] {
        let m = c.mixture();
        let mut s = [0.0; 10];
        for i in 0..m.len() {
            let (n, mean) = (m.count[i], m.mean_of(i));
            s[0] += n;
            (0..3).for_each(|k| s[1 + k] += n * mean[k]);
            let second = m.cov_of(i).add(&Sym3::outer(mean));
            (0..6).for_each(|k| s[4 + k] += n * second.0[k]);
        }
        s
    }

    #[test]
    fn number_count_and_moments_stay() {
        let mut c = some(200);
        let (before, as_was) = (sums(&c), c.clone());
        let gradients: Vec<f64> = (0..200).map(|i| f64::from(i * 37 % 200)).collect();
        let moves = relocate(&mut c, &gradients, 0.1);
        assert_eq!((c.0.len(), moves.len()), (200, 20));
        for (a, b) in before.iter().zip(sums(&c)) {
            assert!((a - b).abs() < 1e-9 * before[0], "{a} {b}");
        }
        // The loudest gave halves to the places of the quietest.
        assert_eq!(moves[0].half_of, (0..200).find(|i| i * 37 % 200 == 199).unwrap());
        assert_eq!(moves[0].from, 0);
        let touched = |i: usize| moves.iter().any(|m| [m.from, m.into, m.half_of].contains(&i));
        assert!((0..200).all(|i| touched(i) || c.0[i] == as_was.0[i]));
    }

    #[test]
    fn few_gaussians_stay_as_they_are() {
        let mut c = some(3);
        let before = c.clone();
        assert!(relocate(&mut c, &[1.0, 2.0, 3.0], 1.0).is_empty());
        assert_eq!(c, before);
    }
}
