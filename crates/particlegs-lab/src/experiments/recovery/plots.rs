//! Plots of P(k), r(k), xi(r) and groups.

use super::facts::{Facts, Power, Xi};
use super::{MethodRecovery, RATIO, RecoveryMeasurements, tables};
use crate::results::{Plot, PlotAxis, PlotSeries, Point, spread};

/// Range of ratios, slightly wider than in the paper's figure.
const RATIOS: [f64; 2] = [0.6, 1.4];
/// Most shells of P(k) per decade; more are joined.
const SHELLS_A_DECADE: f64 = 16.0;

pub(super) fn all(m: &RecoveryMeasurements) -> Vec<Plot> {
    vec![power_of_methods(m), r_of_methods(m), power_of_sizes(m), xi(m), xi_ratio(m), xi_ratio_of_blocks(m), groups(m)]
}

fn plot(name: &str, title: String, x: PlotAxis, y: PlotAxis, series: Vec<PlotSeries>) -> Plot {
    Plot { name: name.into(), title, x, y, series, levels: vec![] }
}

fn ratio_axis(label: &str) -> PlotAxis {
    PlotAxis::ratios(label, RATIOS)
}

fn wave_numbers(m: &RecoveryMeasurements) -> PlotAxis {
    PlotAxis::logarithmic(format!("wave number k, 1 / ({})", m.unit))
}

fn separations(m: &RecoveryMeasurements) -> PlotAxis {
    PlotAxis::logarithmic(format!("separation r, {}", m.unit))
}

/// Joins curves of several seeds: one point wherever all have a value, with the range.
fn points<T>(sets: &[Vec<T>], x: impl Fn(&T) -> f64, y: impl Fn(&T) -> Option<f64>) -> Vec<Point> {
    let Some(first) = sets.first() else { return vec![] };
    let at = |i: usize| {
        let values: Option<Vec<f64>> = sets.iter().map(|s| y(s.get(i)?)).collect();
        spread(x(&first[i]), &values?)
    };
    (0..first.len()).filter_map(at).collect()
}

/// Joins shells to the limit per decade by averaging k, ratio and r.
fn shells(facts: &Facts) -> Vec<Power> {
    let mut joined: Vec<(i64, Vec<Power>)> = Vec::new();
    for s in &facts.shells {
        let bin = (s.k.log10() * SHELLS_A_DECADE).floor() as i64;
        match joined.last_mut().filter(|j| j.0 == bin) {
            Some((_, list)) => list.push(*s),
            None => joined.push((bin, vec![*s])),
        }
    }
    let mean = |list: &[Power], measure: fn(&Power) -> Option<f64>| {
        let values: Vec<f64> = list.iter().filter_map(measure).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let one = |(_, list): (i64, Vec<Power>)| Power {
        k: mean(&list, |s| Some(s.k)).unwrap_or(0.0),
        ratio: mean(&list, |s| s.ratio),
        r: mean(&list, |s| s.r),
    };
    joined.into_iter().map(one).collect()
}

fn power_points(facts: &[Facts], measure: fn(&Power) -> Option<f64>) -> Vec<Point> {
    points(&facts.iter().map(shells).collect::<Vec<_>>(), |s| s.k, measure)
}

fn xi_points(facts: &[Facts], measure: fn(&Xi) -> Option<f64>) -> Vec<Point> {
    points(&facts.iter().map(|f| f.xi.clone()).collect::<Vec<_>>(), Xi::middle, measure)
}

fn of_methods(m: &RecoveryMeasurements, points_of: impl Fn(&MethodRecovery) -> Vec<Point>) -> Vec<PlotSeries> {
    let one = |(style, o): (usize, &MethodRecovery)| PlotSeries {
        name: tables::name(o.method),
        style,
        dashed: tables::name(o.method) != o.method.name() && style > 0,
        points: points_of(o),
    };
    m.methods.iter().enumerate().map(one).collect()
}

fn power_of_methods(m: &RecoveryMeasurements) -> Plot {
    let series = of_methods(m, |o| power_points(&o.all, |s| s.ratio));
    let title = format!("P(k) of particles drawn at ratio {RATIO:.0}, by method");
    plot("recovery-power", title, wave_numbers(m), ratio_axis("P(k), recovered / truth"), series)
}

fn r_of_methods(m: &RecoveryMeasurements) -> Plot {
    let series = of_methods(m, |o| power_points(&o.all, |s| s.r));
    let title = format!("Cross-correlation r(k) at ratio {RATIO:.0}, by method");
    let y = PlotAxis { range: Some([0.8, 1.005]), ..PlotAxis::linear("r(k), shot noise included") };
    plot("recovery-phases", title, wave_numbers(m), y, series)
}

fn power_of_sizes(m: &RecoveryMeasurements) -> Plot {
    let series = m.sizes.iter().enumerate().map(|(style, o)| PlotSeries {
        name: format!("ratio {}", o.name),
        style,
        dashed: o.name.contains("fast"),
        points: power_points(std::slice::from_ref(&o.count), |s| s.ratio),
    });
    let title = "P(k) of particles drawn by count, by ratio".to_string();
    plot("recovery-power-ratios", title, wave_numbers(m), ratio_axis("P(k), recovered / truth"), series.collect())
}

fn xi(m: &RecoveryMeasurements) -> Plot {
    let truth = m.methods.first().and_then(|o| o.all.first());
    let truth = PlotSeries {
        name: "truth".into(),
        style: 8,
        dashed: false,
        points: truth.map_or(vec![], |f| xi_points(std::slice::from_ref(f), |b| Some(b.xi[0]))),
    };
    let series = of_methods(m, |o| xi_points(&o.all, |b| Some(b.xi[1])));
    let title = format!("Two-point correlation xi(r) at ratio {RATIO:.0}, by method");
    let y = PlotAxis::logarithmic("xi(r)");
    plot("recovery-xi", title, separations(m), y, [vec![truth], series].concat())
}

fn xi_ratio(m: &RecoveryMeasurements) -> Plot {
    let series = of_methods(m, |o| xi_points(&o.all, Xi::ratio));
    let title = format!("xi(r) of particles drawn at ratio {RATIO:.0}, by method");
    plot("recovery-xi-ratio", title, separations(m), ratio_axis("xi(r), recovered / truth"), series)
}

fn xi_ratio_of_blocks(m: &RecoveryMeasurements) -> Plot {
    let series = m.blocks.iter().enumerate().map(|(style, o)| PlotSeries {
        name: if o.blocks == 1 { "1 block".into() } else { format!("{} blocks", o.blocks) },
        style,
        dashed: false,
        points: xi_points(&o.all, Xi::ratio),
    });
    let title = format!("xi(r) of particles drawn by count at ratio {RATIO:.0}, by number of blocks");
    plot("recovery-xi-blocks", title, separations(m), ratio_axis("xi(r), recovered / truth"), series.collect())
}

fn groups(m: &RecoveryMeasurements) -> Plot {
    let number = |side: usize, facts: &[Facts]| {
        let sets: Vec<_> = facts.iter().map(|f| f.sizes.clone()).collect();
        points(&sets, |c| c.from as f64, move |c| Some(c.number[side] as f64))
    };
    let truth = m.methods.first().map_or(vec![], |o| number(0, &o.all[..1.min(o.all.len())]));
    let truth = PlotSeries { name: "truth".into(), style: 8, dashed: false, points: truth };
    let series = of_methods(m, |o| number(1, &o.all));
    let title = format!("Friends-of-friends groups by size at ratio {RATIO:.0}, by method");
    let x = PlotAxis::logarithmic("smallest size of the class, particles (each up to 1.41 times it)");
    plot("recovery-groups", title, x, PlotAxis::logarithmic("groups"), [vec![truth], series].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_shells_are_joined_to_one_point() {
        let shell = |k, ratio| Power { k, ratio: Some(ratio), r: None };
        let facts = Facts { shells: vec![shell(0.1, 1.0), shell(1.01, 1.0), shell(1.03, 2.0)], ..Facts::default() };
        let points = power_points(&[facts.clone(), facts], |s| s.ratio);
        assert_eq!(points.iter().map(|p| p.y).collect::<Vec<_>>(), [1.0, 1.5]);
        assert!((points[1].x - 1.02).abs() < 1e-12 && points[1].range == Some([1.5, 1.5]));
    }
}
