//! Moves Gaussians from where they are not needed to where they are, at a fixed number.
//!
//! A split's gain and a merge's cost are the same measure: what pictures show ([`Blur::difference`]) and, with
//! less weight, what particles tell of the density (log likelihood).

use super::cut::principal_axis;
use super::em::{Candidates, GaussianExchange, GroupedParticles, RefinedGaussians, Regularisation};
use super::gain::{Blur, PictureGaussian};
use super::prior::Neighbourhood;
use super::transmittance::TransmittanceMaps;
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::{Result, parallel};

/// Bins of the cut along an axis.
const BINS: usize = 32;

/// Cuts points along `axis` where the variance between the parts is largest (Otsu), and returns the
/// moments of both parts; `None` where they cannot be cut.
pub(crate) fn cut(points: &[[f32; 3]], mean: [f64; 3], axis: [f64; 3]) -> Option<[PictureGaussian; 2]> {
    let place = |p: &[f32; 3]| -> f64 { (0..3).map(|k| (f64::from(p[k]) - mean[k]) * axis[k]).sum() };
    let (lo, hi) = points.iter().map(place).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
    if hi.is_nan() || hi <= lo {
        return None;
    }
    let scale = BINS as f64 / (hi - lo);
    let bin = |t: f64| (((t - lo) * scale) as usize).min(BINS - 1);
    let mut histogram = [(0f64, 0f64); BINS];
    for t in points.iter().map(place) {
        let b = &mut histogram[bin(t)];
        b.0 += 1.0;
        b.1 += t;
    }
    let total = histogram.iter().fold((0.0, 0.0), |s, h| (s.0 + h.0, s.1 + h.1));
    let (mut low, mut best) = ((0.0, 0.0), (0.0, 0));
    // Behind the last bin there is nothing to part from.
    for (k, h) in histogram[..BINS - 1].iter().enumerate() {
        low = (low.0 + h.0, low.1 + h.1);
        let high = total.0 - low.0;
        if low.0 > 0.0 && high > 0.0 {
            let d = low.1 / low.0 - (total.1 - low.1) / high;
            let between = low.0 * high * d * d;
            if between > best.0 {
                best = (between, k + 1);
            }
        }
    }
    if best.1 == 0 {
        return None;
    }
    // About the mean of the whole, so that products of large coordinates do not cancel.
    let mut sums = [[0f64; 10]; 2];
    for p in points {
        let d: [f64; 3] = each_axis(|k| f64::from(p[k]) - mean[k]);
        let t = d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2];
        let s = &mut sums[usize::from(bin(t) >= best.1)];
        let products =
            [1.0, d[0], d[1], d[2], d[0] * d[0], d[0] * d[1], d[0] * d[2], d[1] * d[1], d[1] * d[2], d[2] * d[2]];
        for k in 0..10 {
            s[k] += products[k];
        }
    }
    Some(sums.map(|s| {
        let d: [f64; 3] = each_axis(|k| s[1 + k] / s[0]);
        let cov = Sym3(std::array::from_fn(|k| s[4 + k] / s[0])).add(&Sym3::outer(d).scale(-1.0));
        PictureGaussian { count: s[0], mean: each_axis(|k| mean[k] + d[k]), cov }
    }))
}

/// Measure and bounds of a round's exchanges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MoveOptions {
    pub(crate) blur: Blur,
    pub(crate) shape: Regularisation,
    /// Weight of a split's share of the log likelihood that all splits would gain, beside its share of what
    /// they would gain in pictures.
    pub(crate) likelihood: f64,
    /// A split must gain this many times what its merge costs.
    pub(crate) ratio: f64,
    /// Largest share of the Gaussians that may be split in a round.
    pub(crate) share: f64,
}

/// The gain of two Gaussians in the place of one.
#[derive(Clone, Copy)]
struct SplitGain {
    /// In pictures, by what shows.
    picture: f64,
    likelihood: f64,
}

impl SplitGain {
    fn weighted(self, per_nat: f64) -> f64 {
        self.picture + per_nat * self.likelihood
    }
}

/// Log likelihood that parts gain that lie apart; 0 where they overlap so much that it would be lost.
fn likelihood_gain(whole: &PictureGaussian, a: &PictureGaussian, b: &PictureGaussian, floor: f64) -> f64 {
    let floor = Sym3::scaled_identity(floor);
    let width = |x: &PictureGaussian| 0.5 * x.count * libm::log(x.cov.add(&floor).det().max(f64::MIN_POSITIVE));
    let share = |x: &PictureGaussian| if x.count > 0.0 { x.count * libm::log(x.count / whole.count) } else { 0.0 };
    (width(whole) - width(a) - width(b) + share(a) + share(b)).max(0.0)
}

struct SplitProposal {
    gain: SplitGain,
    at: u32,
    parts: [PictureGaussian; 2],
}

struct MergeProposal {
    cost: f64,
    a: u32,
    b: u32,
}

/// Pairs the best splits with the cheapest merges, and makes them. `cloud` holds the Gaussians' own
/// particles (group j is Gaussian j's), `candidates` whom each may merge with. A dead Gaussian is a merge that costs
/// nothing.
pub(crate) fn exchange(
    gaussians: &mut RefinedGaussians,
    particles: GroupedParticles<'_>,
    candidates: &Candidates,
    transmittance: &TransmittanceMaps,
    options: MoveOptions,
    context: &Context<'_>,
) -> Result<Vec<GaussianExchange>> {
    let mut splits = best_splits(particles, transmittance, &options, context)?;
    // All splits' likelihood together counts as this share of what they gain in pictures, whatever the data's units.
    let all = splits.iter().fold((0.0, 0.0), |s, x| (s.0 + x.gain.picture, s.1 + x.gain.likelihood));
    let per_nat = if all.1 > 0.0 { options.likelihood * all.0 / all.1 } else { 0.0 };
    let cost = MergeCost { shade: transmittance, per_nat, blur: options.blur, floor: options.shape.floor };
    let mut merges = cheapest_merges(gaussians, candidates, &cost, context)?;
    splits.sort_unstable_by(|a, b| b.gain.weighted(per_nat).total_cmp(&a.gain.weighted(per_nat)).then(a.at.cmp(&b.at)));
    merges.sort_unstable_by(|p, q| p.cost.total_cmp(&q.cost).then((p.a, p.b).cmp(&(q.a, q.b))));
    let most = ((options.share * gaussians.len() as f64) as usize).max(1);
    let mut used = vec![false; gaussians.len()];
    let mut merges = merges.into_iter();
    let mut exchanges = Vec::new();
    for split in splits {
        let at = split.at as usize;
        if used[at] {
            continue;
        }
        let free = |m: &MergeProposal| !used[m.a as usize] && !used[m.b as usize] && m.a != split.at && m.b != split.at;
        // A merge of Gaussians that are used is never free again: both lists are passed over once.
        let Some(merge) = merges.find(free) else { break };
        if exchanges.len() == most || split.gain.weighted(per_nat) <= options.ratio * merge.cost {
            break;
        }
        for k in [merge.a, merge.b, split.at] {
            used[k as usize] = true;
        }
        apply(gaussians, at, &split.parts, merge.a as usize, merge.b as usize);
        exchanges.push(GaussianExchange { split: split.at, kept: merge.a, freed: merge.b });
    }
    Ok(exchanges)
}

fn picture_gaussian(g: &RefinedGaussians, j: usize) -> PictureGaussian {
    PictureGaussian { count: g.count[j], mean: g.mean[j], cov: g.cov[j] }
}

fn replace(g: &mut RefinedGaussians, j: usize, b: &PictureGaussian, mass: f64) {
    g.mean[j] = b.mean;
    g.cov[j] = b.cov;
    g.count[j] = b.count;
    g.mass[j] = mass;
}

/// `a` becomes the union of a and b, `at` the split's first part and `b` its second.
fn apply(g: &mut RefinedGaussians, at: usize, [first, second]: &[PictureGaussian; 2], a: usize, b: usize) {
    if a != b {
        let whole = picture_gaussian(g, a).union(&picture_gaussian(g, b));
        replace(g, a, &whole, g.mass[a] + g.mass[b]);
    }
    let share = first.count / (first.count + second.count);
    let (mass, count) = (g.mass[at], g.count[at]);
    let part = |p: &PictureGaussian, s: f64| PictureGaussian { count: count * s, ..*p };
    replace(g, at, &part(first, share), mass * share);
    replace(g, b, &part(second, 1.0 - share), mass * (1.0 - share));
}

fn best_splits(
    particles: GroupedParticles<'_>,
    transmittance: &TransmittanceMaps,
    options: &MoveOptions,
    context: &Context<'_>,
) -> Result<Vec<SplitProposal>> {
    let Regularisation { prior, floor, .. } = options.shape;
    let fitted = |b: &PictureGaussian| PictureGaussian {
        cov: prior.most_probable(&b.cov, b.count, &Neighbourhood::UNKNOWN),
        ..*b
    };
    let groups = particles.groups;
    let split = |j: usize| {
        let points = &particles.xyz[groups.range[j].clone()];
        let whole = PictureGaussian { count: points.len() as f64, mean: groups.mean[j], cov: groups.cov[j] };
        let (_, axis) = principal_axis(&whole.cov);
        let parts = cut(points, whole.mean, axis)?;
        let [a, b] = &parts;
        let picture = options.blur.difference(&whole, a, b) * transmittance.at(whole.mean);
        let likelihood = likelihood_gain(&fitted(&whole), &fitted(a), &fitted(b), floor);
        Some(SplitProposal { gain: SplitGain { picture, likelihood }, at: j as u32, parts })
    };
    let splits = parallel::try_map_range(groups.range.len(), |j| context.check().map(|()| split(j)))?;
    Ok(splits.into_iter().flatten().collect())
}

/// The measure of a merge's cost: a split's gain, the other way round.
struct MergeCost<'a> {
    shade: &'a TransmittanceMaps,
    /// Worth of a nat of log likelihood in pictures.
    per_nat: f64,
    blur: Blur,
    floor: f64,
}

fn cheapest_merges(
    g: &RefinedGaussians,
    candidates: &Candidates,
    cost: &MergeCost<'_>,
    context: &Context<'_>,
) -> Result<Vec<MergeProposal>> {
    let cheapest = |j: usize| {
        let me = picture_gaussian(g, j);
        if me.count == 0.0 {
            return Some(MergeProposal { cost: 0.0, a: j as u32, b: j as u32 });
        }
        // One that may merge lies beside it, where as much shows.
        let shade = cost.shade.at(me.mean);
        let merge = |n: u32| {
            let other = picture_gaussian(g, n as usize);
            let whole = me.union(&other);
            let picture = cost.blur.difference(&whole, &me, &other) * shade;
            let likelihood = likelihood_gain(&whole, &me, &other, cost.floor);
            let cost = SplitGain { picture, likelihood }.weighted(cost.per_nat);
            MergeProposal { cost, a: (j as u32).min(n), b: (j as u32).max(n) }
        };
        let others = candidates.of(j).iter().filter(|&&n| n as usize != j);
        others.map(|&n| merge(n)).min_by(|p, q| p.cost.total_cmp(&q.cost).then((p.a, p.b).cmp(&(q.a, q.b))))
    };
    let merges = parallel::try_map_range(g.len(), |j| context.check().map(|()| cheapest(j)))?;
    Ok(merges.into_iter().flatten().collect())
}
