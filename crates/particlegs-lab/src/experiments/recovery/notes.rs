//! Notes of the report.

use super::measure::{MeasurementScope, cells};
use super::{RATIO, RecoveryMeasurements};
use crate::experiments::published::recovery as paper;
use crate::lab::Lab;
use crate::snapshot::Snapshot;
use particlegs_fit::recover::Method;

/// Notes on the measurements, and on differences from the paper and their reasons.
pub(super) fn all(m: &RecoveryMeasurements, lab: &Lab<'_>, snapshot: &Snapshot) -> Vec<String> {
    let n = snapshot.particles.len();
    let o = MeasurementScope::All.options(n, lab.settings.quick);
    let k_max = m.sizes.iter().find_map(|s| s.count.k_max()).unwrap_or(f64::NAN);
    let seeds = lab.settings.seeds;
    vec![
        format!(
            "As many particles as the snapshot has ({n}) are drawn from a decoded model and compared with the \
             snapshot, as by `particlegs recover MODEL --method METHOD` and `particlegs stats`. Tables by method \
             and by blocks show the median and the range of {seeds} seeds of the draw; tables by ratio show the \
             first seed. The fit has one seed."
        ),
        format!(
            "Correct convention: densities by nearest grid point in cubic cells, {c} along the longest edge, so \
             that a cell has about as many particles as in the paper ({per:.1}); P(k) and r(k) by triangular-shaped \
             clouds on two grids of {s} cells, shifted by half a cell, with the window divided out and shot noise \
             subtracted from P(k) but not from r(k), up to k = {k_max:.2}; groups by friends of friends with 0.2 of \
             the mean spacing ({l:.3} {u}); core mass is the median ratio of other to truth within 0.128 mean \
             spacings over groups of 100 to 299; distances to nearest neighbours among all particles, for a sample \
             of {sample}.",
            c = cells(n),
            per = paper::PARTICLES_A_CELL,
            s = o.spectrum_cells,
            l = m.spacing,
            u = m.unit,
            sample = o.neighbour_sample.min(n),
        ),
        format!(
            "xi(r): pair counts at separations where every particle is counted, and the transform of the density \
             beyond, where counts of a sample scatter more. Its deviation is the paper's: the mean of |xi / \
             xi_truth - 1| over bins where the truth's xi is above 0. The paper does not state the smallest r, so \
             both are listed: all bins, from {low:.3} {u}, and bins from one mean spacing. `nowhere` and 0: not \
             even the first shell meets the limit.",
            low = 0.05 * m.spacing,
            u = m.unit,
        ),
        format!(
            "Paper's convention: density on a grid stretched over the bounds, with as many cells as above; \
             distances to nearest neighbours among 500 000 random particles, one in {thinned} here and one in 562 \
             in the paper. Such distances depend on the fraction, so they cannot be compared, and their ratios to \
             the truth only roughly. The paper has 281 million particles and opacities trained on pictures, and its \
             methods 8 blocks at ratio 65; we use the fit's own counts at ratio {RATIO:.0}. `volume` weights by \
             count times volume, which gives most particles to the wide Gaussians of voids, and `grid` by count, \
             where the paper uses opacity. The paper states P(k) within 10 % up to k = {k} h/Mpc and xi within 10 % \
             from r = {r} Mpc/h.",
            thinned = format_args!("{:.1}", (n as f64 / 500_000.0).max(1.0)),
            k = paper::POWER_TO,
            r = paper::XI_FROM,
        ),
        "Plots of ratios show 0.6 to 1.4, and the plot of r(k) starts at 0.8: points outside, nearly all of \
         `volume`, are not drawn. Bars are the range of the seeds."
            .into(),
        found(m),
        "Not measured here: the time of the draw, and alpha-blend models, whose trained opacities differ from \
         masses (see the experiments that train)."
            .into(),
    ]
}

/// Summary of the tables at the ratio of the methods.
fn found(m: &RecoveryMeasurements) -> String {
    let median = |method: Method, measure: fn(&super::Facts) -> Option<f64>| {
        let facts = m.methods.iter().find(|o| o.method == method)?;
        crate::results::Spread::new(&facts.all.iter().filter_map(measure).collect::<Vec<_>>()).map(|s| s.median)
    };
    let said =
        |method, measure, digits: usize| median(method, measure).map_or("–".into(), |v| format!("{v:.digits$}"));
    let best = m.methods.iter().filter_map(|o| Some((o.method, median(o.method, |f| f.correlation)?)));
    let best = best.max_by(|a, b| a.1.total_cmp(&b.1)).map_or("none", |b| b.0.name());
    format!(
        "At ratio {RATIO:.0}, `{best}` has the best density correlation. `count` has {c}, a P(k) error of at most \
         {p} %, and a mean distance to the nearest neighbour of {n} of the truth's; `spaced` has {ns} for that \
         distance. The MAE of delta in cells is {ms} for `stratified` and {mc} for `count`.",
        c = said(Method::Count, |f| f.correlation, 4),
        p = said(Method::Count, |f| Some(100.0 * f.power_worst()?.0), 1),
        n = said(Method::Count, super::Facts::nearest_mean, 3),
        ns = said(Method::Spaced, super::Facts::nearest_mean, 3),
        ms = said(Method::Stratified, |f| f.mae, 3),
        mc = said(Method::Count, |f| f.mae, 3),
    )
}
