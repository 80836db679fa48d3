//! Distances to nearest neighbours: a k-d tree that lies in the order of its points.

use particlegs_core::parallel;

/// Points in a leaf.
const LEAF: usize = 8;

/// The mean squared distance of every point to its three nearest others (3DGS, `distCUDA2`); of
/// fewer points, to those there are.
pub(super) fn mean_square_of_three(points: &[[f64; 3]]) -> Vec<f64> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    arrange(points, &mut order, 0);
    parallel::map_range(points.len(), |i| {
        let mut best = [f64::INFINITY; 3];
        search(points, &order, 0, points[i], i as u32, &mut best);
        let squares: Vec<f64> = best.into_iter().filter(|d| d.is_finite()).collect();
        if squares.is_empty() { 0.0 } else { squares.iter().sum::<f64>() / squares.len() as f64 }
    })
}

/// The middle of every part divides it along its axis; axes take turns.
fn arrange(points: &[[f64; 3]], order: &mut [u32], axis: usize) {
    if order.len() <= LEAF {
        return;
    }
    let middle = order.len() / 2;
    let key = |i: &u32| points[*i as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(middle);
    parallel::join(|| arrange(points, low, (axis + 1) % 3), || arrange(points, &mut high[1..], (axis + 1) % 3));
}

fn search(points: &[[f64; 3]], order: &[u32], axis: usize, at: [f64; 3], own_index: u32, best: &mut [f64; 3]) {
    if order.len() <= LEAF {
        order.iter().for_each(|i| consider(points, *i, at, own_index, best));
        return;
    }
    let middle = order.len() / 2;
    consider(points, order[middle], at, own_index, best);
    let beyond = at[axis] - points[order[middle] as usize][axis];
    let (low, high) = (&order[..middle], &order[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
    search(points, near, (axis + 1) % 3, at, own_index, best);
    if beyond * beyond < best[2] {
        search(points, far, (axis + 1) % 3, at, own_index, best);
    }
}

fn consider(points: &[[f64; 3]], i: u32, at: [f64; 3], own_index: u32, best: &mut [f64; 3]) {
    if i != own_index {
        let p = points[i as usize];
        let d = (0..3).map(|k| (p[k] - at[k]).powi(2)).sum::<f64>();
        if d < best[2] {
            best[2] = d;
            best.sort_by(f64::total_cmp);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    #[test]
    fn agrees_with_all_pairs() {
        let points: Vec<[f64; 3]> = (0..500)
            .map(|i| {
                let mut r = Random::new(1, 2, i);
                // Some coincide, some share a coordinate.
                [0; 3].map(|_| if i % 3 == 0 { (4.0 * r.uniform()).floor() } else { 4.0 * r.uniform() })
            })
            .collect();
        for (i, mean_square) in mean_square_of_three(&points).into_iter().enumerate() {
            let mut all: Vec<f64> = (0..points.len())
                .filter(|j| *j != i)
                .map(|j| (0..3).map(|k| (points[j][k] - points[i][k]).powi(2)).sum())
                .collect();
            all.sort_by(f64::total_cmp);
            assert!((mean_square - (all[0] + all[1] + all[2]) / 3.0).abs() < 1e-12);
        }
        assert_eq!(mean_square_of_three(&[[1.0; 3]]), [0.0]);
    }
}
