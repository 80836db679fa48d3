//! What a reader of the tables must know.

use super::measure::{MeasurementScope, cells};
use super::{RATIO, RecoveryMeasurements, paper};
use crate::lab::Lab;
use crate::snapshot::Snapshot;
use particlegs_pipeline::recover::Method;

/// How it was measured, what differs from the paper and why, in the order of reading.
pub(super) fn all(m: &RecoveryMeasurements, lab: &Lab<'_>, snapshot: &Snapshot) -> Vec<String> {
    let n = snapshot.particles.len();
    let o = MeasurementScope::All.options(n, lab.settings.quick);
    let k_max = m.sizes.iter().find_map(|s| s.count.k_max()).unwrap_or(f64::NAN);
    let seeds = lab.settings.seeds;
    vec![
        format!(
            "Particles are drawn from a model as its file decodes, as many as the snapshot has ({n}), and compared \
             with the snapshot: what `particlegs recover MODEL --method METHOD` writes and `particlegs stats` \
             compares. Tables by method and by blocks have the median of {seeds} seeds of the draw with their range; \
             tables by ratio the first seed. The fit has one seed."
        ),
        format!(
            "Correct convention: densities by nearest grid point in cubic cells, {c} along the longest edge, so that \
             a cell has about as many particles as the paper's ({per:.1}); P(k) and r(k) by triangular-shaped clouds \
             on two grids of {s} cells half a cell apart, window divided out, shot noise subtracted from P(k) and \
             not from r(k), to k = {k_max:.2}; groups by friends of friends, 0.2 of the mean spacing ({l:.3} {u}); \
             core mass is the median over groups of 100 to 299 of other / truth within 0.128 mean spacings; \
             distances to nearest neighbours among all particles, from a sample of {sample}.",
            c = cells(n),
            per = paper::PARTICLES_A_CELL,
            s = o.spectrum_cells,
            l = m.spacing,
            u = m.unit,
            sample = o.neighbour_sample.min(n),
        ),
        format!(
            "xi(r): pair counts as far as every particle is a primary, and the transform of the density from there \
             on, where counts of a sample scatter more. Its deviation is the paper's, the mean of |xi / xi_truth - \
             1| over bins where the truth's is above 0; the paper does not say from which r on, so it stands here \
             over all bins, from {low:.3} {u} on, and from one mean spacing on. `nowhere` and 0: not even the first \
             shell keeps the limit.",
            low = 0.05 * m.spacing,
            u = m.unit,
        ),
        format!(
            "Paper's convention: density on a grid stretched over the bounds, of as many cells as above; distances \
             to nearest neighbours among a random 500 000 of the particles, one in {thinned} here and one in 562 in \
             the paper, so that they grow with the particles left out: distances do not compare, and the columns over \
             the truth only roughly. The paper's figures are of 281 million particles and of opacities trained on \
             pictures, the methods' of 8 blocks at ratio 65; these are of the fit's own counts at ratio {RATIO:.0}. \
             `volume` weighs by count times volume, which gives most particles to the wide Gaussians of voids, and \
             `grid` by count, where the paper has opacity. Its text has P(k) within 10 % to k = {k} h/Mpc and xi \
             within 10 % from r = {r} Mpc/h.",
            thinned = format_args!("{:.1}", (n as f64 / 500_000.0).max(1.0)),
            k = paper::POWER_TO,
            r = paper::XI_FROM,
        ),
        "Plots of ratios end at 0.6 and 1.4, that of r(k) at 0.8: points beyond, of `volume` nearly all, are not \
         drawn, and their lines end. Bars are the range of the seeds."
            .into(),
        found(m),
        "Not measured here: alpha-blend models, whose opacities training moves away from masses (the experiments that \
         train have them); seconds of the draw."
            .into(),
    ]
}

/// What the tables say at the ratio of the methods, from their figures.
fn found(m: &RecoveryMeasurements) -> String {
    let median = |method: Method, of: fn(&super::Facts) -> Option<f64>| {
        let facts = m.methods.iter().find(|o| o.method == method)?;
        crate::results::Spread::new(&facts.all.iter().filter_map(of).collect::<Vec<_>>()).map(|s| s.median)
    };
    let said = |method, of, digits: usize| median(method, of).map_or("–".into(), |v| format!("{v:.digits$}"));
    let best = m.methods.iter().filter_map(|o| Some((o.method, median(o.method, |f| f.correlation)?)));
    let best = best.max_by(|a, b| a.1.total_cmp(&b.1)).map_or("none", |b| b.0.name());
    format!(
        "At ratio {RATIO:.0}: the density correlates best by `{best}`. `count` has {c} there, P(k) off by {p} % at \
         most, the mean distance to the nearest neighbour at {n} of the truth's; `spaced` has {ns}, `stratified` \
         counts in cells to {ms} (MAE of delta, `count` {mc}).",
        c = said(Method::Count, |f| f.correlation, 4),
        p = said(Method::Count, |f| Some(100.0 * f.power_worst()?.0), 1),
        n = said(Method::Count, super::Facts::nearest_mean, 3),
        ns = said(Method::Spaced, super::Facts::nearest_mean, 3),
        ms = said(Method::Stratified, |f| f.mae, 3),
        mc = said(Method::Count, |f| f.mae, 3),
    )
}
