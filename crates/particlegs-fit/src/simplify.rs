//! A smaller mixture from a mixture, without the particles.
//!
//! Two Gaussians become the one that has the moments of both, the pairs that show least first. What
//! shows is measured as split and merge measure it: the squared difference of the projections along
//! the three axes, under the blur of pictures, in closed form. Rounds take the cheapest disjoint
//! pairs of neighbours until few enough are left, so that 2 million Gaussians take no heap and no
//! more than n log n. Then, as k-means does for points, each old Gaussian goes to the new one that
//! explains it best (Goldberger and Roweis 2004), and the new ones get the moments of their own.
//! Count, mass, mean and covariance of the whole are kept throughout.

use super::gain::{Blur, PictureGaussian, picture_sigma};
use super::overlap_tree::{Ellipsoid, OverlapSearch, OverlapTree, SearchReach};
use fearless_simd::Level;
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::Mixture;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, parallel};
use particlegs_files::memory::require;

/// The size of a smaller mixture, and the pictures that it is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimplifyOptions {
    /// Gaussians, at most.
    pub gaussians: usize,
    /// Radius that particles are drawn with, world units.
    pub radius: f64,
    /// A pixel of the pictures that the model is made for, world units.
    pub pixel: f64,
}

/// Neighbours that a Gaussian may merge with, and that its own may go to.
const NEIGHBOURS: usize = 12;
/// Those are neighbours whose separation is within this of the best, ...
const REACH: f64 = 14.0;
/// ... searched for again when a round leaves less than this of those at the last search.
const SEARCH_AGAIN: f64 = 0.6;
/// Searches between two looks at whether to stop.
const CHECK: usize = 64;
/// Largest share of the Gaussians that a round merges away.
const SHARE: f64 = 0.1;
/// A round that merges less than one in so many away is poor.
const POOR: usize = 64;
const REGROUPINGS: usize = 4;
/// Blur of the measure and floor of sizes, in particle radii, as in refinement.
const BLUR_RADII: f64 = 6.0;
const FLOOR_RADII: f64 = 0.6;
/// Bytes that a Gaussian takes in the work.
const BYTES_A_GAUSSIAN: u64 = 600;

/// Merges Gaussians until at most `options.gaussians` are left. The same bits for any number of
/// threads. Gaussians without particles are dropped.
pub fn simplify(mixture: &Mixture, options: &SimplifyOptions, context: &Context<'_>) -> Result<Mixture> {
    if options.gaussians == 0 || !(options.radius > 0.0 && options.radius.is_finite() && options.pixel >= 0.0) {
        return Err(Error::argument(format!(
            "{} Gaussians and a radius of {} must be positive",
            options.gaussians, options.radius
        )));
    }
    require("simplifying", mixture.len() as u64 * BYTES_A_GAUSSIAN)?;
    let frame = WorkUnits::from_mixture(mixture);
    let old = frame.items(mixture);
    if old.len() <= options.gaussians {
        return Ok(frame.mixture(&old, mixture.masses().is_some()));
    }
    let radius = options.radius / frame.unit;
    let blur = Blur::from_sigma(picture_sigma(BLUR_RADII * radius, options.pixel / frame.unit));
    let measure = OverlapMeasure { blur, floor: (FLOOR_RADII * radius).powi(2) };
    let (mut new, mut homes) = merged(&old, options.gaussians, measure, context)?;
    let neighbours = OverlapNeighbours::find(&new, measure, REACH, context)?;
    for _ in 0..REGROUPINGS {
        context.check()?;
        new = regrouped(&old, &new, &mut homes, &neighbours, measure);
    }
    new.retain(|item| item.gaussian.count > 0.0);
    Ok(frame.mixture(&new, mixture.masses().is_some()))
}

#[derive(Clone, Copy)]
struct MergeGaussian {
    gaussian: PictureGaussian,
    mass: f64,
}

impl MergeGaussian {
    fn joined(&self, other: &MergeGaussian) -> MergeGaussian {
        MergeGaussian { gaussian: self.gaussian.union(&other.gaussian), mass: self.mass + other.mass }
    }

    /// The same place without particles.
    fn emptied(&self) -> MergeGaussian {
        MergeGaussian { gaussian: PictureGaussian { count: 0.0, ..self.gaussian }, mass: 0.0 }
    }
}

#[derive(Clone, Copy)]
struct OverlapMeasure {
    blur: Blur,
    /// Least variance in the search for neighbours.
    floor: f64,
}

/// The unit and the origin of the work: products of many lengths stay within f64 whatever the unit.
struct WorkUnits {
    origin: [f64; 3],
    unit: f64,
}

impl WorkUnits {
    fn from_mixture(mixture: &Mixture) -> WorkUnits {
        let mut bounds = Bounds::empty();
        (0..mixture.len()).for_each(|i| bounds.include(mixture.mean_of(i)));
        let widest = bounds.extent().into_iter().fold(0.0, f64::max);
        let spread = mixture.cov[0].iter().zip(&mixture.cov[3]).zip(&mixture.cov[5]);
        let size = spread.map(|((x, y), z)| (x + y + z).sqrt()).fold(0.0, f64::max);
        let unit = widest.max(size);
        WorkUnits { origin: bounds.center(), unit: if unit > 0.0 && unit.is_finite() { unit } else { 1.0 } }
    }

    fn items(&self, mixture: &Mixture) -> Vec<MergeGaussian> {
        let per = 1.0 / self.unit;
        let item = |i: usize| {
            let mean = mixture.mean_of(i);
            let mean = each_axis(|k| (mean[k] - self.origin[k]) * per);
            let cov = mixture.cov_of(i).scale(per).scale(per);
            MergeGaussian { gaussian: PictureGaussian { count: mixture.count[i], mean, cov }, mass: mixture.mass_of(i) }
        };
        (0..mixture.len()).filter(|&i| mixture.count[i] > 0.0).map(item).collect()
    }

    fn mixture(&self, items: &[MergeGaussian], masses: bool) -> Mixture {
        let mut out = Mixture::new(masses);
        for MergeGaussian { gaussian, mass } in items {
            let mean = each_axis(|k| self.origin[k] + gaussian.mean[k] * self.unit);
            out.push(mean, gaussian.cov.scale(self.unit).scale(self.unit), gaussian.count, *mass);
        }
        out
    }
}

fn ellipsoid(b: &PictureGaussian, floor: f64) -> Ellipsoid {
    Ellipsoid::new(b.mean, b.cov.add(&Sym3::scaled_identity(floor)), b.count)
}

/// For each Gaussian those that it overlaps most, itself left out, in an order that repeats.
struct OverlapNeighbours(Vec<Vec<u32>>);

impl OverlapNeighbours {
    fn find(items: &[MergeGaussian], measure: OverlapMeasure, reach: f64, context: &Context<'_>) -> Result<Self> {
        let ellipsoids: Vec<Ellipsoid> =
            parallel::map_range(items.len(), |i| ellipsoid(&items[i].gaussian, measure.floor));
        let tree = OverlapTree::new(&ellipsoids, context.simd());
        let reach = SearchReach { most: NEIGHBOURS, beyond: reach };
        let mut place = vec![0u32; items.len()];
        tree.order().iter().enumerate().for_each(|(at, &i)| place[i as usize] = at as u32);
        let scratch = parallel::Scratch::<OverlapSearch>::default();
        let neighbours_of = |j: usize| {
            if j.is_multiple_of(CHECK) {
                context.check()?;
            }
            scratch.with(|search| {
                // Those without particles are in no tree: they have no place to search from.
                match items[j].gaussian.count > 0.0 {
                    true => tree.nearest_to(&ellipsoids[j], place[j], reach, search),
                    false => tree.nearest(&ellipsoids[j], reach, search),
                }
                Ok(search.neighbours.iter().map(|f| f.1).filter(|&n| n as usize != j).collect())
            })
        };
        parallel::try_map_range(items.len(), neighbours_of).map(Self)
    }

    /// Each with those before and after it in the order of a tree over places.
    fn beside(items: &[MergeGaussian], measure: OverlapMeasure) -> Self {
        let ellipsoids: Vec<Ellipsoid> =
            parallel::map_range(items.len(), |i| ellipsoid(&items[i].gaussian, measure.floor));
        let tree = OverlapTree::new(&ellipsoids, Level::new());
        let mut lists = vec![Vec::new(); items.len()];
        for pair in tree.order().windows(2) {
            lists[pair[0] as usize].push(pair[1]);
            lists[pair[1] as usize].push(pair[0]);
        }
        OverlapNeighbours(lists)
    }

    /// Each with the next, the last with the one before.
    fn chain(count: usize) -> Self {
        OverlapNeighbours(
            (0..count).map(|j| if j + 1 < count { j as u32 + 1 } else { j as u32 - 1 }).map(|n| vec![n]).collect(),
        )
    }

    /// Those of the Gaussians after a round: of a merged pair both ones' in turn.
    fn after(&self, round: &Round) -> Self {
        let neighbours_after = |&i: &u32| {
            let mut lists = [Some(i), round.partner[i as usize]].map(|k| {
                let list: &[u32] = k.map_or(&[], |k| &self.0[k as usize]);
                list.iter()
            });
            let number = round.place[i as usize];
            let mut all: Vec<u32> = Vec::with_capacity(NEIGHBOURS);
            while all.len() < NEIGHBOURS && lists.iter().any(|l| l.len() > 0) {
                for n in lists.iter_mut().filter_map(|l| l.next()) {
                    let n = round.place[*n as usize];
                    if n != number && !all.contains(&n) {
                        all.push(n);
                    }
                }
            }
            all
        };
        OverlapNeighbours(parallel::map(&round.kept, neighbours_after))
    }
}

/// The Gaussians that a round merged.
struct Round {
    /// The Gaussian that each one that stays was merged with.
    partner: Vec<Option<u32>>,
    /// Gaussians that are there after the round, by their old numbers.
    kept: Vec<u32>,
    /// The new number of each old Gaussian, or of the one that it was merged into.
    place: Vec<u32>,
}

/// Merges pairs until `wanted` are left; for each old one says where it went.
fn merged(
    old: &[MergeGaussian],
    wanted: usize,
    measure: OverlapMeasure,
    context: &Context<'_>,
) -> Result<(Vec<MergeGaussian>, Vec<u32>)> {
    context.begin("simplifying", (old.len() - wanted) as u64);
    let mut items = old.to_vec();
    let mut homes: Vec<u32> = (0..old.len() as u32).collect();
    let (mut reach, mut searched) = (REACH, items.len());
    let mut neighbours = OverlapNeighbours::find(&items, measure, reach, context)?;
    while items.len() > wanted {
        context.check()?;
        let merges = cheapest(&items, &neighbours, measure);
        if merges.is_empty() {
            // Islands have no neighbours within reach: look as far as it takes. Flat Gaussians whose
            // overlaps are no numbers go with the next.
            neighbours = match reach.is_finite() {
                true => OverlapNeighbours::find(&items, measure, f64::INFINITY, context)?,
                false => OverlapNeighbours::chain(items.len()),
            };
            (reach, searched) = (f64::INFINITY, items.len());
            continue;
        }
        // Lists that were only joined since the last search miss more and more of the nearest.
        if (items.len() as f64) < SEARCH_AGAIN * searched as f64 {
            neighbours = OverlapNeighbours::find(&items, measure, reach, context)?;
            searched = items.len();
            continue;
        }
        let mut round = Round::new(items.len(), &merges, wanted);
        if round.is_poor(wanted) {
            // Where thousands overlap, a few heavy ones are the nearest of all and merge one at a time.
            let beside = OverlapNeighbours::beside(&items, measure);
            round = Round::new(items.len(), &cheapest(&items, &beside, measure), wanted);
        }
        context.advance((items.len() - round.kept.len()) as u64);
        neighbours = neighbours.after(&round);
        homes.iter_mut().for_each(|home| *home = round.place[*home as usize]);
        let joined = |&i: &u32| {
            let item = items[i as usize];
            round.partner[i as usize].map_or(item, |j| item.joined(&items[j as usize]))
        };
        items = parallel::map(&round.kept, joined);
    }
    context.end();
    Ok((items, homes))
}

impl Round {
    /// It merges far fewer pairs than it might to reach `wanted`.
    fn is_poor(&self, wanted: usize) -> bool {
        let (before, after) = (self.partner.len(), self.kept.len());
        after > wanted && (before - after) * POOR < before
    }

    /// The cheapest disjoint pairs, until `wanted` are left or a round's share is used up.
    fn new(count: usize, merges: &[MergeCandidate], wanted: usize) -> Round {
        let most = (count - wanted).min((count as f64 * SHARE) as usize).max(1);
        let mut partner = vec![None; count];
        let mut into: Vec<Option<u32>> = vec![None; count];
        let mut merge_count = 0;
        for &MergeCandidate { a, b, .. } in merges {
            let free = |k: u32| partner[k as usize].is_none() && into[k as usize].is_none();
            if merge_count == most {
                break;
            }
            if free(a) && free(b) {
                partner[a as usize] = Some(b);
                into[b as usize] = Some(a);
                merge_count += 1;
            }
        }
        let survivors: Vec<u32> = (0..count as u32).filter(|&i| into[i as usize].is_none()).collect();
        let mut place = vec![0; count];
        survivors.iter().enumerate().for_each(|(to, &i)| place[i as usize] = to as u32);
        (0..count).for_each(|i| {
            if let Some(a) = into[i] {
                place[i] = place[a as usize];
            }
        });
        Round { partner, kept: survivors, place }
    }
}

/// The cheapest merge of a Gaussian.
struct MergeCandidate {
    cost: f64,
    a: u32,
    b: u32,
}

/// Each Gaussian's cheapest merge among its neighbours, the cheapest of all first.
fn cheapest(items: &[MergeGaussian], neighbours: &OverlapNeighbours, measure: OverlapMeasure) -> Vec<MergeCandidate> {
    let cheapest_of = |j: usize| {
        let gaussian = &items[j].gaussian;
        let merge = |&n: &u32| {
            let other = &items[n as usize].gaussian;
            let cost = measure.blur.difference(&gaussian.union(other), gaussian, other);
            MergeCandidate { cost, a: (j as u32).min(n), b: (j as u32).max(n) }
        };
        neighbours.0[j].iter().map(merge).min_by(by_cost)
    };
    let mut merges: Vec<MergeCandidate> = parallel::map_range(items.len(), cheapest_of).into_iter().flatten().collect();
    merges.sort_unstable_by(by_cost);
    merges
}

fn by_cost(p: &MergeCandidate, q: &MergeCandidate) -> std::cmp::Ordering {
    p.cost.total_cmp(&q.cost).then((p.a, p.b).cmp(&(q.a, q.b)))
}

/// Each old Gaussian goes to the one under which it is likeliest, of its home and the home's
/// neighbours; the new ones get the moments of their own, which may be none.
fn regrouped(
    old: &[MergeGaussian],
    new: &[MergeGaussian],
    homes: &mut [u32],
    neighbours: &OverlapNeighbours,
    measure: OverlapMeasure,
) -> Vec<MergeGaussian> {
    let fields = parallel::map(new, |item| MergeDensity::new(item, measure));
    parallel::for_each(homes.iter_mut().zip(old), |(home, item)| {
        let cov = item.gaussian.cov.add(&Sym3::scaled_identity(measure.floor));
        let cost = |n: u32| fields[n as usize].as_ref().map_or(f64::INFINITY, |f| f.cost(item.gaussian.mean, &cov));
        let others = neighbours.0[*home as usize].iter().map(|&n| (cost(n), n));
        let best = others.fold((cost(*home), *home), |best, next| if next.0 < best.0 { next } else { best });
        *home = best.1;
    });
    let mut groups: Vec<Option<MergeGaussian>> = vec![None; new.len()];
    for (item, &home) in old.iter().zip(homes.iter()) {
        let group = &mut groups[home as usize];
        *group = Some(group.map_or(*item, |g| g.joined(item)));
    }
    groups.into_iter().zip(new).map(|(group, was)| group.unwrap_or(was.emptied())).collect()
}

/// A Gaussian as a density that others are judged by.
struct MergeDensity {
    mean: [f64; 3],
    inverse: Sym3,
    /// ln det - 2 ln count.
    constant: f64,
}

impl MergeDensity {
    fn new(item: &MergeGaussian, measure: OverlapMeasure) -> Option<MergeDensity> {
        let cov = item.gaussian.cov.add(&Sym3::scaled_identity(measure.floor));
        let inverse = cov.inverse().filter(|_| item.gaussian.count > 0.0)?;
        Some(MergeDensity {
            mean: item.gaussian.mean,
            inverse,
            constant: libm::log(cov.det()) - 2.0 * libm::log(item.gaussian.count),
        })
    }

    /// Minus twice the mean log-likelihood of a Gaussian's particles, but for a constant.
    fn cost(&self, mean: [f64; 3], cov: &Sym3) -> f64 {
        let d = each_axis(|k| mean[k] - self.mean[k]);
        trace_of_product(&self.inverse, cov) + self.inverse.quadratic(d) + self.constant
    }
}

fn trace_of_product(a: &Sym3, b: &Sym3) -> f64 {
    let (a, b) = (&a.0, &b.0);
    a[0] * b[0] + a[3] * b[3] + a[5] * b[5] + 2.0 * (a[1] * b[1] + a[2] * b[2] + a[4] * b[4])
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::{Context, ProgressEvent, ProgressSink};
    use particlegs_core::math::Random;
    use particlegs_particles::testing::cancelled;

    fn mixture(n: u64, unit: f64) -> Mixture {
        let mut m = Mixture::new(true);
        for i in 0..n {
            let mut r = Random::new(9, 0, i);
            let mut v = || [r.normal(), r.normal(), r.normal()];
            let (mean, a, b) = (v(), v(), v());
            let cov = Sym3::outer(a).add(&Sym3::outer(b)).scale(0.01).add(&Sym3::scaled_identity(1e-4));
            let count = (1.0 + 20.0 * v()[0].abs()).round();
            m.push(mean.map(|x| unit * (7.0 + x)), cov.scale(unit).scale(unit), count, 0.5 * count);
        }
        m
    }

    /// Count, mass, mean and covariance of the whole.
    fn moments(m: &Mixture) -> (f64, PictureGaussian) {
        let item = |i| PictureGaussian { count: m.count[i], mean: m.mean_of(i), cov: m.cov_of(i) };
        let whole = (1..m.len()).fold(item(0), |all, i| all.union(&item(i)));
        ((0..m.len()).map(|i| m.mass_of(i)).sum(), whole)
    }

    #[test]
    fn moments_are_conserved_at_any_unit() {
        for unit in [1.0, 1e-20, 1e20] {
            let m = mixture(500, unit);
            for k in [1, 7, 200, 499, 500, 900] {
                let options = SimplifyOptions { gaussians: k, radius: 0.02 * unit, pixel: 0.01 * unit };
                let small = simplify(&m, &options, &Context::SILENT).unwrap();
                assert!(small.len() <= k && small.len() >= k.min(500) * 9 / 10, "{k}: {}", small.len());
                let ((mass, a), (mass2, b)) = (moments(&m), moments(&small));
                assert_eq!((a.count, mass), (b.count, mass2));
                for j in 0..3 {
                    assert!((a.mean[j] - b.mean[j]).abs() < 1e-10 * unit);
                }
                for j in 0..6 {
                    assert!((a.cov.0[j] - b.cov.0[j]).abs() < 1e-10 * unit * unit);
                }
            }
        }
    }

    #[test]
    fn twins_merge_first() {
        let mut m = Mixture::default();
        for x in [0.0, 1.0, 1.001, 2.0] {
            m.push([x, 0.0, 0.0], Sym3::scaled_identity(0.01), 10.0, 0.0);
        }
        let small =
            simplify(&m, &SimplifyOptions { gaussians: 3, radius: 0.01, pixel: 0.0 }, &Context::SILENT).unwrap();
        assert_eq!(small.count, [10.0, 20.0, 10.0]);
        assert!((small.mean[0][1] - 1.0005).abs() < 1e-12);
    }

    #[test]
    fn points_and_islands_merge_too() {
        let mut m = Mixture::default();
        for i in 0..40 {
            m.push([f64::from(i * i * i), 0.0, 0.0], Sym3::default(), 3.0, 0.0);
        }
        let small =
            simplify(&m, &SimplifyOptions { gaussians: 3, radius: 1e-9, pixel: 0.0 }, &Context::SILENT).unwrap();
        assert!(!small.is_empty() && small.len() <= 3);
        assert_eq!(small.count.iter().sum::<f64>(), 120.0);
    }

    /// Thousands at one place, equal or not, halve by a tenth a round as others do: rounds and
    /// searches are few.
    #[test]
    fn thousands_at_one_place_take_few_rounds() {
        struct RoundCounter(std::sync::atomic::AtomicUsize);
        impl ProgressSink for RoundCounter {
            fn event(&self, event: ProgressEvent<'_>) {
                let round = matches!(event, ProgressEvent::Advance(_));
                self.0.fetch_add(round.into(), std::sync::atomic::Ordering::Relaxed);
            }
        }
        for sizes in [0.0, 1e-3] {
            let mut m = Mixture::default();
            (0..1500).for_each(|i| m.push([0.5; 3], Sym3::scaled_identity(0.01 + sizes * f64::from(i % 7)), 2.0, 0.0));
            let rounds = RoundCounter(Default::default());
            let small = simplify(
                &m,
                &SimplifyOptions { gaussians: 15, radius: 0.01, pixel: 0.0 },
                &Context::SILENT.with_sink(&rounds),
            )
            .unwrap();
            assert_eq!(small.count.iter().sum::<f64>(), 3000.0);
            let rounds = rounds.0.into_inner();
            assert!(small.len() <= 15 && rounds < 120, "{} left after {rounds} rounds", small.len());
        }
    }

    #[test]
    fn a_stop_is_heard_in_the_first_search() {
        let options = SimplifyOptions { gaussians: 3, radius: 0.01, pixel: 0.0 };
        assert!(matches!(simplify(&mixture(200, 1.0), &options, &cancelled()), Err(Error::Cancelled)));
    }

    #[test]
    fn no_gaussians_is_refused_as_a_target() {
        let options = SimplifyOptions { gaussians: 0, radius: 1.0, pixel: 0.0 };
        assert!(simplify(&mixture(3, 1.0), &options, &Context::SILENT).is_err());
    }
}
