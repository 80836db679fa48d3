//! Joint histograms of two scalar fields, such as density and temperature: how much mass has which pair of values.

use super::presentation::*;
use super::velocities::FieldPair;
use super::{ParticleFields, StatsOptions, Subject};
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_core::picture::Colormap;
use particlegs_core::{Result, text};
use particlegs_figure::{ColourBar, EdgeAxis, Figure, Panel, PaperColour};
use particlegs_files::memory::require;
use particlegs_particles::{FieldColumns, LayerFields, RUN, StarFormingGas};

/// An axis of positive values is logarithmic if the largest is this many times the least.
const DECADES: f64 = 100.0;

/// Shares of the mass of a layer by the values of two fields, truth and other: of particles where these have no
/// weights. An axis goes over the truth's values.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct JointHistogram {
    /// Name of the layer.
    pub layer: String,
    /// Names of the fields, x and y.
    pub fields: [String; 2],
    /// Their units, where they are known.
    pub units: [Option<String>; 2],
    /// Whether bins are of equal factors; else they are of equal steps.
    pub logarithmic: [bool; 2],
    /// Edges of the bins of either field: one more than bins.
    pub edges: [Vec<f64>; 2],
    /// Share of the mass in each cell, truth and other: those of the first bin of x first.
    pub share: [Vec<f64>; 2],
    /// Share of the other's mass beyond the truth's values.
    pub outside: f64,
    /// Share of the mass that lies in other cells: half the sum of absolute differences.
    pub difference: f64,
    /// The mean of `difference` between two samples of the same distribution, as large as these.
    pub noise: f64,
    /// Pearson's coefficient of the fields, truth and other, of logarithms along a logarithmic axis.
    pub correlation: [Option<f64>; 2],
}

/// Values of two fields of the particles that have both, and their weights.
#[derive(Default)]
struct FieldPairs {
    values: Vec<[f64; 2]>,
    weights: Vec<f64>,
    /// Particles without a value.
    left_out: usize,
}

struct JointAxis {
    logarithmic: bool,
    low: f64,
    width: f64,
    bins: usize,
}

/// Histograms of the layers that both sides have with both fields, and a note of those that cannot be compared.
pub fn joint_histograms(
    subjects: [Subject<'_>; 2],
    fields: FieldPair<'_>,
    o: &StatsOptions,
    notes: &mut Vec<String>,
    context: &Context<'_>,
) -> Result<Vec<JointHistogram>> {
    let [Some(truth), Some(other)] = fields else {
        let side = if fields[0].is_none() { "truth" } else { "other" };
        notes.push(format!("no joint histogram: the {side} has no fields"));
        return Ok(Vec::new());
    };
    let layers = same_layers(truth, other);
    let both = |[a, b]: &[usize; 2]| -> Vec<String> {
        let has = |name: &String| other.layers[*b].find(name, StarFormingGas::Keep).is_ok_and(|f| f.columns.len() == 1);
        truth.layers[*a].scalars().into_iter().filter(has).collect()
    };
    // Without a choice, the first two scalars that a particle type has on both sides (docs/guide/statistics.md).
    let first = || layers.iter().find_map(|pair| both(pair).first_chunk().cloned());
    let Some(names) = o.joint.clone().or_else(first) else {
        notes.push("no joint histogram: no particle type has the same two scalar fields on both sides".into());
        return Ok(Vec::new());
    };
    let (mut all, mut missing) = (Vec::new(), true);
    for pair in layers {
        let column_pairs =
            [(truth, pair[0]), (other, pair[1])].map(|(side, layer)| columns(&side.layers[layer], &names));
        let [Some(of_truth), Some(of_other)] = column_pairs else { continue };
        missing = false;
        let layer = &truth.particles.layers()[pair[0]].name;
        let other_layer = &other.particles.layers()[pair[1]].name;
        // Without stored correlations, drawn values scatter about their means independently of each other.
        let refused = differing_unit(&names, &of_truth, &of_other)
            .or_else(|| uncorrelated(subjects[0], layer, &names))
            .or_else(|| uncorrelated(subjects[1], other_layer, &names));
        if let Some(why) = refused {
            notes.push(format!("no joint histogram of {layer}: {why}"));
            continue;
        }
        let values = [
            FieldPairs::read(truth, pair[0], &of_truth, context)?,
            FieldPairs::read(other, pair[1], &of_other, context)?,
        ];
        for (side, pairs) in ["truth", "other"].iter().zip(&values).filter(|(_, pairs)| pairs.left_out > 0) {
            let n = pairs.left_out;
            notes.push(format!(
                "{n} particles of the {side} have no {} or no {}: they are left out",
                names[0], names[1]
            ));
        }
        // A unit that one side does not state is taken to be the other's.
        let units = [0, 1].map(|k| of_truth[k].unit.clone().or_else(|| of_other[k].unit.clone()));
        all.extend(histogram(&values, o.joint_bins).map(|histogram| JointHistogram {
            layer: layer.clone(),
            fields: names.clone(),
            units,
            ..histogram
        }));
    }
    if missing {
        let [x, y] = &names;
        notes.push(format!("no joint histogram: no particle type has the scalar fields {x} and {y} on both sides"));
    }
    Ok(all)
}

/// The layers that both sides have, by their names; a single one has its counterpart in a single one.
fn same_layers(truth: &ParticleFields, other: &ParticleFields) -> Vec<[usize; 2]> {
    let [a, b] = [truth, other].map(|s| s.particles.layers());
    if a.len() == 1 && b.len() == 1 {
        return vec![[0, 0]];
    }
    let same = |(i, l): (usize, &particlegs_core::model::Layer<_>)| Some([i, b.iter().position(|o| o.name == l.name)?]);
    a.iter().enumerate().filter_map(same).collect()
}

/// The two fields of a layer, where it has both as scalars.
fn columns(layer: &LayerFields, names: &[String; 2]) -> Option<[FieldColumns; 2]> {
    let find = |name| layer.find(name, StarFormingGas::Keep).ok().filter(|f| f.columns.len() == 1);
    Some([find(&names[0])?, find(&names[1])?])
}

fn differing_unit(names: &[String; 2], truth: &[FieldColumns; 2], other: &[FieldColumns; 2]) -> Option<String> {
    (0..2).find_map(|k| match (&truth[k].unit, &other[k].unit) {
        (Some(a), Some(b)) if a != b => Some(format!("{} is in {a} in the truth and in {b} in the other", names[k])),
        _ => None,
    })
}

/// The reason for which particles drawn from a model do not show the correlation of two fields; `None` where they do,
/// and of particles.
fn uncorrelated(subject: Subject<'_>, layer: &str, names: &[String; 2]) -> Option<String> {
    let Subject::Model(model) = subject else { return None };
    let [a, b] = names;
    let is_stored = |model: &Model| {
        let stored_name =
            |name: &str| model.metadata.fields.iter().find(|q| q.name.eq_ignore_ascii_case(name)).map(|q| &q.name);
        let mut blocks = model.layers.iter().filter(|l| l.name == layer).flat_map(|l| &l.content);
        let (a, b) = (stored_name(a)?, stored_name(b)?);
        blocks.all(|block| block.gaussians.is_empty() || block.gaussians.correlation(a, b).is_some()).then_some(())
    };
    is_stored(model).is_none().then(|| format!("the model does not store how {a} and {b} correlate"))
}

impl FieldPairs {
    fn read(
        side: &ParticleFields,
        layer: usize,
        from: &[FieldColumns; 2],
        context: &Context<'_>,
    ) -> Result<FieldPairs> {
        let particles = &side.particles.layers()[layer].content;
        require("the values of two fields", 24 * particles.len() as u64)?;
        let (mut pairs, mut run) = (FieldPairs::default(), Vec::new());
        for (id, start) in particles.clone().step_by(RUN).enumerate() {
            context.check()?;
            side.layers[layer].read_some(id as u64, |c| from.iter().any(|f| f.needs(c)), &mut run)?;
            for (i, pair) in from[0].values(&run, 0).zip(from[1].values(&run, 0)).enumerate() {
                match pair.0.is_finite() && pair.1.is_finite() {
                    true => {
                        pairs.values.push(pair.into());
                        pairs.weights.push(side.weight(start + i));
                    }
                    false => pairs.left_out += 1,
                }
            }
        }
        Ok(pairs)
    }
}

impl JointAxis {
    /// Over the values of field `k`; `None` without any.
    fn new(pairs: &FieldPairs, k: usize, bins: usize) -> Option<JointAxis> {
        let ends = |[low, high]: [f64; 2], v: &[f64; 2]| [low.min(v[k]), high.max(v[k])];
        let [low, high] = pairs.values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
        let logarithmic = low > 0.0 && high >= DECADES * low;
        let [mut low, mut high] = if logarithmic { [libm::log10(low), libm::log10(high)] } else { [low, high] };
        // Values that are all alike need an axis of some width.
        if low == high {
            let half = if low == 0.0 { 0.5 } else { 0.01 * low.abs() };
            (low, high) = (low - half, high + half);
        }
        // Divided before they are subtracted, the ends of the widest range do not overflow.
        let width = high / bins as f64 - low / bins as f64;
        (low <= high).then_some(JointAxis { logarithmic, low, width, bins })
    }

    /// The place of a value along it, its decimal logarithm on a logarithmic one; NaN where that has none.
    fn place(&self, value: f64) -> f64 {
        match self.logarithmic {
            true if value > 0.0 => libm::log10(value),
            true => f64::NAN,
            false => value,
        }
    }

    /// The bin of a place.
    fn bin(&self, place: f64) -> Option<usize> {
        // The last bin has both its edges.
        let last = self.edge(self.bins);
        (self.low..=last).contains(&place).then(|| (((place - self.low) / self.width) as usize).min(self.bins - 1))
    }

    fn edge(&self, number: usize) -> f64 {
        self.low + self.width * number as f64
    }

    fn edges(&self) -> Vec<f64> {
        let value = |at: f64| if self.logarithmic { libm::pow(10f64, at) } else { at };
        (0..=self.bins).map(|i| value(self.edge(i))).collect()
    }
}

/// Of both sides, without names; `None` where one has no particles with values.
fn histogram(pairs: &[FieldPairs; 2], bins: usize) -> Option<JointHistogram> {
    let axes = [JointAxis::new(&pairs[0], 0, bins)?, JointAxis::new(&pairs[0], 1, bins)?];
    let [truth, other] = pairs.each_ref().map(|side_pairs| cells(side_pairs, &axes));
    let (truth, other) = (truth?, other?);
    let cells = || truth.iter().zip(&other);
    let difference = 0.5 * cells().map(|(a, b)| (a[0] - b[0]).abs()).sum::<f64>();
    // The mean of a normal distribution's absolute values.
    let expected = |(a, b): (&[f64; 2], &[f64; 2])| (std::f64::consts::FRAC_2_PI * (a[1] + b[1])).sqrt();
    let noise = 0.5 * cells().map(expected).sum::<f64>();
    // The truth defines the axes: only the other's values may lie beyond them.
    let outside = other[bins * bins][0];
    Some(JointHistogram {
        layer: String::new(),
        fields: Default::default(),
        units: Default::default(),
        logarithmic: axes.each_ref().map(|a| a.logarithmic),
        edges: axes.each_ref().map(JointAxis::edges),
        share: [truth, other].map(|all| all[..bins * bins].iter().map(|c| c[0]).collect()),
        outside,
        difference,
        // Two histograms differ by no more than all of the mass.
        noise: noise.min(1.0),
        correlation: pairs.each_ref().map(|side_pairs| correlation(side_pairs, &axes)),
    })
}

/// Of each cell, and of all that lies beyond: its share of the weights, and that share's variance.
fn cells(pairs: &FieldPairs, [x, y]: &[JointAxis; 2]) -> Option<Vec<[f64; 2]>> {
    let mut cells = vec![[0.0; 2]; x.bins * y.bins + 1];
    let total: f64 = pairs.weights.iter().sum();
    for (value, w) in pairs.values.iter().zip(&pairs.weights) {
        let cell = x.bin(x.place(value[0])).zip(y.bin(y.place(value[1]))).map(|(i, j)| i * y.bins + j);
        let cell = &mut cells[cell.unwrap_or(x.bins * y.bins)];
        let share = w / total;
        // Of a Poisson number of particles, the sum of squared weights is the variance of their sum.
        *cell = [cell[0] + share, cell[1] + share * share];
    }
    (total > 0.0).then_some(cells)
}

/// `None` where a field does not vary.
fn correlation(pairs: &FieldPairs, axes: &[JointAxis; 2]) -> Option<f64> {
    let place = |v: &[f64; 2]| [axes[0].place(v[0]), axes[1].place(v[1])];
    let placed_pairs = || {
        let placed = pairs.values.iter().zip(&pairs.weights).map(|(v, w)| (place(v), *w));
        // Values from 0 down have no place on a logarithmic axis.
        placed.filter(|(p, _)| !p[0].is_nan() && !p[1].is_nan())
    };
    let total: f64 = placed_pairs().map(|(_, w)| w).sum();
    let mean = [0, 1].map(|k| placed_pairs().map(|(p, w)| w * p[k]).sum::<f64>() / total);
    let moment = |j: usize, k: usize| placed_pairs().map(|(p, w)| w * (p[j] - mean[j]) * (p[k] - mean[k])).sum::<f64>();
    let size = (moment(0, 0) * moment(1, 1)).sqrt();
    (size > 0.0).then(|| moment(0, 1) / size)
}

/// Shares of a cell that have colours, below the largest.
const LEAST_SHARE: f64 = 1e-4;

/// Shows them.
pub(super) fn show(all: &[JointHistogram], to: &mut Presentation) {
    let cells = all.iter().flat_map(|j| {
        let ([x, y], [a, b], name) = (&j.edges, &j.share, text::cell(&j.layer));
        (0..a.len()).map(move |cell| {
            let (i, k) = (cell / (y.len() - 1), cell % (y.len() - 1));
            row![name, x[i], x[i + 1], y[k], y[k + 1], a[cell], b[cell]]
        })
    });
    to.table("joint.csv", "particle_type,x_low,x_high,y_low,y_high,truth,other", cells);
    to.figures.push(("joint", figure(all)));
    for j in all {
        let name = |k: usize| if j.logarithmic[k] { format!("log {}", j.fields[k]) } else { j.fields[k].clone() };
        to.line(&format!("{}: {} and {}", j.layer, name(0), name(1)), {
            let [difference, noise] = [j.difference, j.noise].map(|v| 100.0 * v);
            format!("{difference:.2} % of the mass is in other cells, sampling noise {noise:.2} %")
        });
        let r = |side: usize| j.correlation[side].map_or("-".into(), |r| format!("{r:.3}"));
        to.line(&format!("{}: their correlation", j.layer), format!("{}, truth {}", r(1), r(0)));
    }
}

/// Truth and other side by side, a row a particle type: the logarithm of the share of mass in a cell over the largest.
fn figure(all: &[JointHistogram]) -> Figure {
    // Cells below the least share, and empty ones, are as white as the ground.
    let color = |share: f64| match libm::log10(share) / -libm::log10(LEAST_SHARE) + 1.0 {
        v if v >= 0.0 => Colormap::Viridis.color(v as f32),
        _ => [255; 3],
    };
    let mut panels = Vec::new();
    for j in all {
        let [columns, rows] = j.edges.each_ref().map(|e| e.len() - 1);
        // About 400 pixels along an edge, each cell a square of pixels.
        let scale = (400 / columns).max(1);
        let largest = j.share.iter().flatten().copied().fold(0.0, f64::max);
        let axes = [0, 1].map(|k| {
            let unit = j.units[k].as_ref().map_or(String::new(), |u| format!(" [{u}]"));
            let [low, high] = [j.edges[k][0], j.edges[k][j.edges[k].len() - 1]];
            let (name, [low, high]) = match j.logarithmic[k] {
                true => (format!("log10 {}", j.fields[k]), [libm::log10(low), libm::log10(high)]),
                false => (j.fields[k].clone(), [low, high]),
            };
            EdgeAxis { label: name + &unit, low, high }
        });
        for (share, side) in j.share.iter().zip(["truth", "other"]) {
            panels.push(Panel {
                caption: Some(format!("{}: {side}", j.layer)),
                axes: Some(axes.clone()),
                ..Panel::plain(block_picture(share, [columns, rows], scale, |v| color(v / largest)))
            });
        }
    }
    let title = "mass in a cell / largest".into();
    let bar = ColourBar::logarithmic(title, [LEAST_SHARE, 1.0], |share| Colormap::Viridis.color(share));
    Figure { bar: Some(bar), ground: PaperColour::White, ..Figure::plain(panels, 2) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// Densities over three decades, and temperatures that fall or rise with them.
    fn pairs(n: u64, seed: u64, slope: f64) -> FieldPairs {
        let mut pairs = FieldPairs::default();
        for i in 0..n {
            let mut r = Random::new(seed, 0, i);
            let density = 0.4 * r.normal();
            pairs.values.push([10f64.powf(density), 100.0 + 10.0 * (slope * density + 0.4 * r.normal())]);
            pairs.weights.push(1.0 + (i % 3) as f64);
        }
        pairs
    }

    #[test]
    fn samples_of_one_distribution_differ_by_their_noise() {
        for (n, bins, slack) in [(200_000, 20, 0.05), (20_000, 50, 0.1)] {
            let histogram = histogram(&[pairs(n, 1, -0.8), pairs(2 * n, 2, -0.8)], bins).unwrap();
            assert!(
                (histogram.difference / histogram.noise - 1.0).abs() < slack,
                "{} {}",
                histogram.difference,
                histogram.noise
            );
            assert_eq!((histogram.logarithmic, histogram.edges[0].len()), ([true, false], bins + 1));
            let truth = -0.8 / (0.8f64 * 0.8 + 1.0).sqrt();
            assert!(
                histogram.correlation.iter().all(|r| (r.unwrap() - truth).abs() < 0.02),
                "{:?}",
                histogram.correlation
            );
            let sums = histogram.share.each_ref().map(|s| s.iter().sum::<f64>());
            assert!((sums[0] - 1.0).abs() < 1e-9 && (sums[1] + histogram.outside - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn what_moves_to_other_cells_is_counted_also_beyond_the_range() {
        let pairs_of =
            |values: &[[f64; 2]]| FieldPairs { values: values.into(), weights: vec![1.0; values.len()], left_out: 0 };
        let truth = pairs_of(&[[1.0, 1.0], [2.0, 1.0], [3.0, 4.0], [10.0, 4.0]]);
        let same = histogram(&[pairs_of(&truth.values), pairs_of(&truth.values)], 4).unwrap();
        assert_eq!((same.difference, same.outside, same.share[0][0], same.share[0][15]), (0.0, 0.0, 0.5, 0.25));
        let moved = histogram(&[truth, pairs_of(&[[1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [-5.0, 4.0]])], 4).unwrap();
        assert_eq!((moved.difference, moved.outside), (0.5, 0.25));
        // Nothing positive lies on a logarithmic axis; values that are all alike have a bin.
        let wide =
            histogram(&[pairs_of(&[[1.0, 7.0], [1000.0, 7.0]]), pairs_of(&[[0.0, 7.0], [-1.0, 8.0]])], 3).unwrap();
        assert_eq!((wide.logarithmic, wide.outside, wide.difference), ([true, false], 1.0, 1.0));
        assert_eq!(wide.correlation, [None, None]);
        assert!(histogram(&[pairs_of(&[]), pairs_of(&[[1.0, 1.0]])], 3).is_none());
    }
}
