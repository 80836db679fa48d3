//! Tables of the report.

use super::facts::Facts;
use super::{BlocksRecovery, MethodRecovery, RATIO, RecoveryMeasurements, SizeRecovery};
use crate::experiments::published::recovery as paper;
use crate::results::{ResultTable, TableCell};
use particlegs_fit::recover::Method;

pub(super) fn all(m: &RecoveryMeasurements) -> Vec<ResultTable> {
    vec![of_methods_as_published(m), spectra_of_methods(m), groups_of_methods(m), of_blocks(m)]
        .into_iter()
        .chain([spectra_of_sizes(m), groups_of_sizes(m), of_models(m), other_draws(m)])
        .collect()
}

/// Name of a method, here and in the paper.
pub(super) fn name(method: Method) -> String {
    let published = match method {
        Method::Count => ", V0",
        Method::Volume => ", V1",
        Method::Ellipsoid => ", V4",
        Method::Grid => ", V6",
        Method::Stratified | Method::Spaced => "",
    };
    format!("{}{published}", method.name())
}

/// One number over seeds.
fn spread(facts: &[Facts], digits: usize, measure: impl Fn(&Facts) -> Option<f64>) -> TableCell {
    TableCell::spread(&facts.iter().filter_map(measure).collect::<Vec<_>>(), digits)
}

/// Largest k of a limit over seeds; 0 if not even the first shell is within it.
fn up_to(facts: &[Facts], measure: impl Fn(&Facts) -> Option<f64>) -> TableCell {
    match facts.iter().any(|f| measure(f).is_some()) {
        true => spread(facts, 2, |f| Some(measure(f).unwrap_or(0.0))),
        false => TableCell::text("nowhere"),
    }
}

const PAPER: [&str; 4] = ["paper: correlation", "paper: MAE", "paper: nearest mean / truth", "paper: xi error, %"];

fn published(row: Option<paper::PublishedRecovery>) -> Vec<TableCell> {
    let Some(r) = row else { return vec![TableCell::Empty; 4] };
    let nearest = TableCell::number(r.nearest / paper::TRUTH_NEAREST, 2);
    vec![TableCell::number(r.correlation, 3), TableCell::number(r.mae, 3), nearest, TableCell::number(r.xi, 1)]
}

/// Correlation, MAE, nearest neighbour and its ratio in the paper's convention; deviation of xi over all bins and from
/// one spacing on.
fn as_published(m: &RecoveryMeasurements, all: &[Facts], of_paper: &[Facts]) -> Vec<TableCell> {
    vec![
        spread(of_paper, 4, |f| f.correlation),
        spread(of_paper, 3, |f| f.mae),
        spread(of_paper, 3, |f| f.nearest.map(|n| n[1])),
        spread(of_paper, 3, Facts::nearest_mean),
        spread(all, 1, |f| f.xi_deviation(0.0).map(|v| 100.0 * v)),
        spread(all, 1, |f| f.xi_deviation(m.spacing).map(|v| 100.0 * v)),
    ]
}

fn published_heads(m: &RecoveryMeasurements, first: &[&str]) -> Vec<String> {
    let truth = m.methods.iter().find_map(|o| Some(o.paper.first()?.nearest?[0]));
    let truth = truth.map_or(String::new(), |t| format!(" (truth {t:.3})"));
    let columns = [
        "density correlation".to_string(),
        "MAE of delta".into(),
        format!("nearest neighbour: mean{truth}, {}", m.unit),
        "nearest mean / truth".into(),
        "xi error, %: all bins".into(),
        "xi error, %: from one mean spacing".into(),
    ];
    first.iter().map(|s| (*s).to_string()).chain(columns).chain(PAPER.map(String::from)).collect()
}

fn table<const N: usize>(
    name: &str,
    title: String,
    columns: Vec<String>,
    rows: impl Iterator<Item = [Vec<TableCell>; N]>,
) -> ResultTable {
    ResultTable { name: name.into(), title, columns, rows: rows.map(|groups| groups.concat()).collect() }
}

fn of_method(o: &MethodRecovery) -> Vec<TableCell> {
    vec![TableCell::text(name(o.method))]
}

fn of_methods_as_published(m: &RecoveryMeasurements) -> ResultTable {
    let title = format!("Methods at ratio {RATIO:.0} in the paper's convention, with the paper's numbers");
    let row =
        |o: &MethodRecovery| [of_method(o), as_published(m, &o.all, &o.paper), published(paper::method(o.method))];
    table("recovery-methods-paper", title, published_heads(m, &["method"]), m.methods.iter().map(row))
}

fn of_blocks(m: &RecoveryMeasurements) -> ResultTable {
    let title = format!("`count` by number of blocks at ratio {RATIO:.0}, in the paper's convention");
    let row = |o: &BlocksRecovery| {
        let (gaussians, _, ratio) = o.size;
        let first = vec![TableCell::count(o.blocks.into()), TableCell::count(gaussians), TableCell::number(ratio, 0)];
        [first, as_published(m, &o.all, &o.paper), published(paper::blocks(o.blocks))]
    };
    let heads = published_heads(m, &["blocks", "Gaussians", "ratio"]);
    table("recovery-blocks", title, heads, m.blocks.iter().map(row))
}

fn spectrum_heads(m: &RecoveryMeasurements, first: &[&str], xi: bool) -> Vec<String> {
    let at = format!("at k, 1 / ({})", m.unit);
    let columns = [
        "density correlation",
        "MAE of delta",
        "P(k): largest deviation, %",
        &at,
        "within 1 % up to k",
        "within 5 % up to k",
        "within 10 % up to k",
        "r(k) at the largest k",
        "r at least 0.99 up to k",
        "r at least 0.9 up to k",
    ];
    let xi = xi.then(|| format!("xi within 10 % from r, {}", m.unit));
    first.iter().chain(&columns).map(|s| (*s).to_string()).chain(xi).collect()
}

fn spectrum(facts: &[Facts], xi: bool) -> Vec<TableCell> {
    let mut cells = vec![
        spread(facts, 4, |f| f.correlation),
        spread(facts, 3, |f| f.mae),
        spread(facts, 1, |f| Some(100.0 * f.power_worst()?.0)),
        spread(facts, 2, |f| Some(f.power_worst()?.1)),
    ];
    cells.extend((0..3).map(|i| up_to(facts, |f| f.power_to[i])));
    cells.push(spread(facts, 3, |f| f.shells.last()?.r));
    cells.extend((0..2).map(|i| up_to(facts, |f| f.r_to[i])));
    if xi {
        cells.push(match facts.iter().any(|f| f.xi_from.is_none()) {
            true => TableCell::text("nowhere"),
            false => spread(facts, 3, |f| f.xi_from),
        });
    }
    cells
}

fn spectra_of_methods(m: &RecoveryMeasurements) -> ResultTable {
    let title = format!("Methods at ratio {RATIO:.0}: density, P(k), r(k), xi(r), in the correct convention");
    let rows = m.methods.iter().map(|o| [of_method(o), spectrum(&o.all, true)]);
    table("recovery-methods", title, spectrum_heads(m, &["method"], true), rows)
}

fn spectra_of_sizes(m: &RecoveryMeasurements) -> ResultTable {
    let title = "`count` by ratio and effort: density, P(k), r(k), xi(r)".to_string();
    let rows = m.sizes.iter().map(|o| [of_size(o), spectrum(std::slice::from_ref(&o.count), true)]);
    table("recovery-ratios", title, spectrum_heads(m, &["ratio", "Gaussians", "bytes"], true), rows)
}

fn of_models(m: &RecoveryMeasurements) -> ResultTable {
    let title = "The models themselves, with mixtures integrated over the cells: no draw, no shot noise".to_string();
    let rows = m.sizes.iter().map(|o| [of_size(o), spectrum(std::slice::from_ref(&o.model), false)]);
    table("recovery-models", title, spectrum_heads(m, &["ratio", "Gaussians", "bytes"], false), rows)
}

fn of_size(o: &SizeRecovery) -> Vec<TableCell> {
    vec![TableCell::text(&o.name), TableCell::count(o.size.0), TableCell::count(o.size.1)]
}

fn group_heads(m: &RecoveryMeasurements, first: &[&str]) -> Vec<String> {
    let classes = m.methods.iter().flat_map(|o| o.all.first()).flat_map(|f| &f.classes).take(3);
    let classes =
        classes.map(|c| format!("groups of {} (truth {}): error, %", c.describe(), c.number[0])).collect::<Vec<_>>();
    let rest =
        ["number within 10 % from size", "core mass / truth", "nearest: mean / truth", "nearest: median / truth"];
    let rest = rest.iter().map(|s| (*s).to_string());
    first.iter().map(|s| (*s).to_string()).chain(classes).chain(rest).collect()
}

fn groups(m: &RecoveryMeasurements, facts: &[Facts]) -> Vec<TableCell> {
    let classes = m.methods.iter().flat_map(|o| o.all.first()).map(|f| f.classes.len()).next().unwrap_or(0);
    let class = |i: usize| spread(facts, 1, |f| Some(100.0 * f.classes.get(i)?.off()?));
    let from = match facts.iter().any(|f| f.groups_from.is_none()) {
        true => TableCell::text("no size"),
        false => spread(facts, 0, |f| f.groups_from.map(|v| v as f64)),
    };
    let rest = [
        from,
        spread(facts, 2, |f| f.core_mass),
        spread(facts, 3, Facts::nearest_mean),
        spread(facts, 3, |f| f.nearest_median),
    ];
    (0..classes.min(3)).map(class).chain(rest).collect()
}

fn groups_of_methods(m: &RecoveryMeasurements) -> ResultTable {
    let title = format!("Methods at ratio {RATIO:.0}: groups, their cores, nearest neighbours");
    let rows = m.methods.iter().map(|o| [of_method(o), groups(m, &o.all)]);
    table("recovery-methods-groups", title, group_heads(m, &["method"]), rows)
}

fn groups_of_sizes(m: &RecoveryMeasurements) -> ResultTable {
    let title = "`count` by ratio and effort: groups, their cores, nearest neighbours".to_string();
    let rows = m.sizes.iter().map(|o| [vec![TableCell::text(&o.name)], groups(m, std::slice::from_ref(&o.count))]);
    table("recovery-ratios-groups", title, group_heads(m, &["ratio"]), rows)
}

fn other_draws(m: &RecoveryMeasurements) -> ResultTable {
    let title = "Our three drawing methods, by ratio and effort".to_string();
    let rows = m.sizes.iter().flat_map(|o| {
        let draws = [(Method::Count, &o.count), (Method::Stratified, &o.stratified), (Method::Spaced, &o.spaced)];
        draws.map(|(method, facts)| {
            let first = vec![TableCell::text(&o.name), TableCell::text(method.name()), TableCell::number(facts.mae, 3)];
            [first, groups(m, std::slice::from_ref(facts))]
        })
    });
    table("recovery-draws", title, group_heads(m, &["ratio", "method", "MAE of delta"]), rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_that_no_shell_meets_are_shown_as_nowhere() {
        let facts = |k: Option<f64>| Facts { power_to: [k; 3], ..Facts::default() };
        let power_limit = |f: &Facts| f.power_to[0];
        assert_eq!(up_to(&[facts(None), facts(None)], power_limit), TableCell::text("nowhere"));
        let some = up_to(&[facts(None), facts(Some(2.0)), facts(Some(4.0))], power_limit);
        assert_eq!(some, TableCell::Spread { value: 2.0, range: [0.0, 4.0], digits: 2 });
    }

    #[test]
    fn rows_are_as_long_as_their_header() {
        let measured =
            RecoveryMeasurements { methods: vec![], sizes: vec![], blocks: vec![], spacing: 1.0, unit: "kpc".into() };
        let published_row = as_published(&measured, &[], &[]).len() + published(None).len();
        assert_eq!(published_heads(&measured, &[]).len(), published_row);
        for xi in [true, false] {
            assert_eq!(spectrum_heads(&measured, &[], xi).len(), spectrum(&[], xi).len());
        }
        assert_eq!(group_heads(&measured, &[]).len(), groups(&measured, &[]).len());
    }
}
