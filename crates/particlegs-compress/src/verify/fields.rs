//! The fields of a model against those that are coded anew of its snapshot.

use super::{StatedFigure, StoredModel};
use crate::FieldSelection;
use particlegs_core::Result;
use particlegs_core::codec::FieldPrecision;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{
    Block, FieldAgreement, FieldAgreements, FieldMoments, Layer, Metadata, Mixture, Quantity, QuantityKind, RecipeStep,
};

/// Relative error of a sum over Gaussians, at most, to their values' absolute sum.
const SUM: f64 = 1e-10;
/// Relative error of a bound: logarithms may be those of another machine.
const BOUND: f64 = 1e-12;
/// Root mean square of the moments' differences in steps of the coder, at most, where they are near those coded anew.
const STEPS: f64 = 1.0;
/// Largest ratio of the spreads to those coded anew if Gaussians were joined or blocks overlap.
const SPREADS: f64 = 1.5;
/// Steps of correlations in standard errors, and their area tangents at most.
const CORRELATION_STEP: f64 = 4.0;
const LARGEST_TANGENT: f64 = 4.0;
/// Part of the means' variance that the model may explain less than means that are gathered anew, if these explain
/// the most of it.
const EXPLAINED: f64 = 0.25;

/// Nearness of a model's fields to those that this program codes of its particles.
#[derive(Clone, Copy, PartialEq)]
enum Nearness {
    /// To the last digit: this version made it of them.
    Same,
    /// Within the coder's steps.
    Steps,
    /// The same, of a frame whose Gaussians were coded anew: their places moved, and with them what slopes explain.
    Extracted,
    /// In sums and means alone: its Gaussians were joined, or blocks of several snapshots overlap.
    Means,
}

impl Nearness {
    fn of(stored: &StoredModel) -> Nearness {
        let m = &stored.model.metadata;
        let joined = m.recipe.steps.iter().any(|s| *s != RecipeStep::Merge) || m.recipe.differing.contains("steps");
        let overlap = |l: &Layer<Vec<Block>>| {
            let apart = |a: &Block, b: &Block| {
                (0..3).any(|k| a.bounds.max[k] < b.bounds.min[k] || b.bounds.max[k] < a.bounds.min[k])
            };
            l.content.iter().enumerate().any(|(i, a)| l.content[..i].iter().any(|b| !apart(a, b)))
        };
        match stored.of_several {
            _ if joined => Nearness::Means,
            true if stored.model.layers.iter().any(overlap) => Nearness::Means,
            false if m.tool_version == env!("CARGO_PKG_VERSION") && !stored.extracted => Nearness::Same,
            _ if stored.extracted => Nearness::Extracted,
            _ => Nearness::Steps,
        }
    }
}

/// Results of a comparison of fields.
pub(super) struct FieldComparison {
    /// Numbers that the model states of them.
    pub figures: Vec<StatedFigure>,
    /// Agreement of fields that are gathered from halves of the particles, as a certificate has it.
    pub gathered: Option<FieldAgreements>,
    /// The same of the model's own, where these are worse.
    pub of_model: FieldAgreements,
}

impl FieldComparison {
    pub fn new(
        stored: &StoredModel,
        fields: &FieldSelection<'_>,
        seed: u64,
        context: &Context<'_>,
    ) -> Result<FieldComparison> {
        let (model, nearness) = (&stored.model, Nearness::of(stored));
        let before = |at: [usize; 2], quantity: &Quantity| {
            let [before, frame] = stored.frames.as_ref()?;
            before.field_before(frame, at, quantity)
        };
        let anew = fields.coded_anew(model, &before, context)?;
        let mut figures = Vec::new();
        for (layer, anew) in model.layers.iter().zip(&anew.layers) {
            let of_several = model.layers.len() > 1;
            let suffix = if of_several { format!(", layer `{}`", layer.name) } else { String::new() };
            let listed = &model.metadata.fields;
            for (_, q) in listed.iter().enumerate().filter(|(n, _)| Metadata::is_stored(listed, *n)) {
                figures.extend(of_field(q, &suffix, &layer.content, &anew.content, nearness));
            }
            // A merge may have left out fields that others correlate with.
            let merged = model.metadata.recipe.steps.contains(&RecipeStep::Merge);
            let pairs = (0..listed.len()).flat_map(|b| (0..b).map(move |a| [&listed[a].name[..], &listed[b].name[..]]));
            figures.extend(
                pairs.filter_map(|pair| {
                    of_correlation(pair, &suffix, &layer.content, &anew.content, (nearness, merged))
                }),
            );
        }
        let gathered = fields.agreement(model, seed, context)?;
        let model_agreements = fields.agreement_of_model(model, seed, context)?;
        let mut of_model = gathered.unwrap_or_default();
        let model_agreements = model_agreements.unwrap_or_default().each;
        for ((q, to), agreement) in model.metadata.fields.iter().zip(&mut of_model.each).zip(model_agreements) {
            let (Some(anew), Some(agreement)) = (to.as_ref().copied(), agreement) else { continue };
            figures.extend(explained(q, &anew, &agreement));
            *to = Some(FieldAgreement { error: anew.error.max(agreement.error), ..anew });
        }
        Ok(FieldComparison { figures, gathered, of_model })
    }
}

fn figure(name: String, stored: String, measured: String, tolerance: String, differs: bool) -> StatedFigure {
    StatedFigure { name: format!("fields {name}"), stored, measured, tolerance, differs }
}

/// The share of the means' variance that the model's means explain, beside that of means gathered anew.
fn explained(q: &Quantity, anew: &FieldAgreement, of_model: &FieldAgreement) -> Option<StatedFigure> {
    let [anew, of_model] = [anew.explained()?, of_model.explained().unwrap_or(f64::NEG_INFINITY)];
    let differs = anew >= 0.5 && of_model < anew - EXPLAINED;
    let text = |v: f64| format!("{:.1} %", 100.0 * v);
    let name = format!("{}: variance of means explained", q.name);
    Some(figure(name, text(of_model), text(anew), format!("{:.0} % less", 100.0 * EXPLAINED), differs))
}

/// Numbers of a field in the blocks of a layer, beside those that are coded anew.
fn of_field(q: &Quantity, suffix: &str, stored: &[Block], anew: &[Block], nearness: Nearness) -> Vec<StatedFigure> {
    let pairs: Vec<[&Mixture; 2]> = stored.iter().zip(anew).map(|(a, b)| [&a.gaussians, &b.gaussians]).collect();
    let field = |g: &Mixture| g.fields.get(&q.name).is_some();
    if pairs.iter().all(|p| p.iter().all(|g| !field(g))) {
        return Vec::new();
    }
    let have = [0, 1].map(|side| pairs.iter().filter(|p| field(p[side])).count());
    if pairs.iter().any(|[a, b]| field(a) != field(b)) {
        let name = format!("{}{suffix}: blocks that have it", q.name);
        let [stored_blocks, anew] = have.map(|n| n.to_string());
        return vec![figure(name, stored_blocks, anew, "same".into(), true)];
    }
    // From here on both sides have the field in the same blocks.
    let pairs: Vec<[FieldOfBlock<'_>; 2]> =
        pairs.into_iter().filter_map(|[a, b]| Some([FieldOfBlock::new(a, q)?, FieldOfBlock::new(b, q)?])).collect();
    let mut figures = Vec::new();
    for (c, component) in q.component_names().into_iter().enumerate() {
        let total =
            |side: usize, transform: &dyn Fn(f64) -> f64| pairs.iter().map(|p| p[side].sum(c, transform)).sum::<f64>();
        let [stored_sum, anew] = [0, 1].map(|side| total(side, &|v| v));
        // Relative to absolute values, as values of both signs may sum to almost 0.
        let differs = (stored_sum - anew).abs() > SUM * total(1, &f64::abs);
        figures.push(figure(
            format!("{component}{suffix}: sum"),
            stored_sum.to_string(),
            anew.to_string(),
            format!("{SUM:e} of all"),
            differs,
        ));
        for (end, name) in ["least value", "largest value"].into_iter().enumerate() {
            let bound = |side: usize| {
                let all = pairs.iter().map(|p| p[side].moments.range[c][end]);
                if end == 0 { all.fold(f64::INFINITY, f64::min) } else { all.fold(f64::NEG_INFINITY, f64::max) }
            };
            let [stored_bound, anew] = [0, 1].map(bound);
            let differs = (stored_bound - anew).abs() > BOUND * stored_bound.abs().max(anew.abs());
            // A range of logarithms is reported as the values that a user knows.
            let text = |v: f64| if q.logarithmic { libm::exp(v).to_string() } else { v.to_string() };
            figures.push(figure(
                format!("{component}{suffix}: {name}"),
                text(stored_bound),
                text(anew),
                format!("{BOUND:e}"),
                differs,
            ));
        }
    }
    figures.push(match nearness {
        // Such Gaussians have other moments one by one, but about as much spread in all.
        Nearness::Means => {
            let [stored_spread, anew] = [0, 1].map(|side| pairs.iter().map(|p| p[side].spread()).sum::<f64>().sqrt());
            let differs = stored_spread > SPREADS * anew || anew > SPREADS * stored_spread;
            let name = format!("{}{suffix}: spread within Gaussians", q.name);
            figure(name, stored_spread.to_string(), anew.to_string(), format!("{SPREADS} times"), differs)
        }
        nearness => {
            let steps = differing_steps(&pairs, nearness == Nearness::Extracted);
            let same = nearness == Nearness::Same;
            let differs =
                if same { pairs.iter().any(|[a, b]| !a.has_moments_of(b)) } else { steps.is_nan() || steps > STEPS };
            let tolerance = if same { "same".into() } else { STEPS.to_string() };
            let name = format!("{}{suffix}: moments, steps off", q.name);
            figure(name, format!("{steps:.1e}"), "0".into(), tolerance, differs)
        }
    });
    figures
}

/// Correlations of two fields in the blocks of a layer, beside those that are coded anew.
fn of_correlation(
    [a, b]: [&str; 2],
    suffix: &str,
    stored: &[Block],
    anew: &[Block],
    (nearness, merged): (Nearness, bool),
) -> Option<StatedFigure> {
    let [stored_values, anew] = [stored, anew].map(|blocks| {
        let all = blocks.iter().map(|block| block.gaussians.correlation(a, b).cloned());
        all.collect::<Vec<Option<Vec<f64>>>>()
    });
    let is_there = |all: &[Option<Vec<f64>>]| all.iter().any(Option::is_some);
    if nearness == Nearness::Means || !is_there(&stored_values) && (merged || !is_there(&anew)) {
        return None;
    }
    let name = format!("{a} with {b}{suffix}: correlations");
    if stored_values.iter().zip(&anew).any(|(a, b)| a.is_some() != b.is_some()) {
        let [stored_count, anew] = [stored_values, anew].map(|all| all.iter().flatten().count().to_string());
        return Some(figure(format!("{name}, blocks that have them"), stored_count, anew, "same".into(), true));
    }
    // The error of an area tangent is about the same for all correlations (Fisher's transformation).
    let number = |r: f64| r.atanh().clamp(-LARGEST_TANGENT, LARGEST_TANGENT);
    let (mut square, mut n) = (0.0, 0.0f64);
    for ((block, values), anew) in stored.iter().zip(&stored_values).zip(&anew) {
        for ((count, r), anew) in block.gaussians.count.iter().zip(values.iter().flatten()).zip(anew.iter().flatten()) {
            square += count * ((number(*r) - number(*anew)) / CORRELATION_STEP).powi(2);
            n += 1.0;
        }
    }
    let (steps, same) = ((square / n.max(1.0)).sqrt(), nearness == Nearness::Same && !merged);
    let differs = if same { stored_values != anew } else { steps.is_nan() || steps > STEPS };
    let tolerance = if same { "same".into() } else { STEPS.to_string() };
    Some(figure(format!("{name}, steps off"), format!("{steps:.1e}"), "0".into(), tolerance, differs))
}

/// A field of a block's Gaussians.
struct FieldOfBlock<'a> {
    g: &'a Mixture,
    moments: &'a FieldMoments,
    quantity: &'a Quantity,
}

impl<'a> FieldOfBlock<'a> {
    fn new(g: &'a Mixture, quantity: &'a Quantity) -> Option<Self> {
        Some(FieldOfBlock { g, moments: g.fields.get(&quantity.name)?, quantity })
    }

    /// Whether they are those of another, but for correlations.
    fn has_moments_of(&self, other: &FieldOfBlock<'_>) -> bool {
        self.moments.columns().eq(other.moments.columns()) && self.moments.range == other.moments.range
    }

    fn weight(&self, i: usize) -> f64 {
        if self.quantity.by_mass { self.g.mass_of(i) } else { self.g.count[i] }
    }

    /// The weighted sum over Gaussians of the transformed values of component `c`.
    fn sum(&self, c: usize, transform: &dyn Fn(f64) -> f64) -> f64 {
        let value = |i: usize| self.weight(i) * transform(self.moments.overall_value(c, i, &self.g.cov_of(i)));
        (0..self.g.len()).map(value).sum()
    }

    /// The weighted sum of the variances.
    fn spread(&self) -> f64 {
        (0..self.g.len()).map(|i| self.weight(i) * self.trace(i)).sum()
    }

    fn trace(&self, i: usize) -> f64 {
        (0..self.moments.components()).map(|c| self.moments.variance(c, i)).sum()
    }
}

/// Distance of moments from others, in steps of the coder at its default precision: the root mean square over
/// Gaussians, which are the same in the same order on both sides, of the kind of number that is furthest. Of a frame that was `extracted` the variance that slopes explain
/// counts, too.
fn differing_steps(pairs: &[[FieldOfBlock<'_>; 2]], extracted: bool) -> f64 {
    let FieldPrecision { steps, logarithmic, shares } = FieldPrecision::default();
    // Of means, logarithms of spreads, shapes, slopes, the excess.
    let mut squares = [[0.0f64; 2]; 5];
    for [stored_field, anew] in pairs {
        let (components, n_of) = (stored_field.moments.components(), &stored_field.g.count);
        let is_share = stored_field.quantity.kind == QuantityKind::Category;
        let [mean, log, shape, slope] = match (is_share, stored_field.quantity.logarithmic) {
            (true, _) => [shares[0], 1.0, 1.0, shares[1]],
            (_, true) => [0, 1, 2, 3].map(|k| logarithmic[k]),
            _ => steps,
        }
        .map(f64::from);
        // Without a particle there is no standard error to measure by.
        for i in (0..stored_field.g.len()).filter(|&i| n_of[i] >= 1.0) {
            let [(a, own_trace), (b, trace)] = [stored_field, anew].map(|f| (f.moments, f.trace(i).max(1e-200)));
            let mut add = |kind: usize, off: f64| {
                squares[kind][0] += off * off;
                squares[kind][1] += 1.0;
            };
            let cov = stored_field.g.cov_of(i);
            let by_slope = |c: usize| cov.quadratic(each_axis(|k| b.slope[c][k][i])).max(0.0);
            let explained_by_slopes = if extracted { (0..components).map(by_slope).sum() } else { 0.0 };
            let (own_trace, trace) = (own_trace + explained_by_slopes, trace + explained_by_slopes);
            let (n, size) = (n_of[i], (trace / components as f64).sqrt());
            // A share of none or all still has the deviation of one particle.
            let size = if is_share { size.max(1.0 / n.sqrt()) } else { size };
            // Steps are in standard errors, as the coder's are (docs/format.md, section 14); those of the excess and of
            // shapes, which are compared by their traces, are bounds.
            let error = size / n.sqrt();
            for c in 0..components {
                add(0, (a.mean[c][i] - b.mean[c][i]) / (mean * error));
                let off = each_axis(|k| a.slope[c][k][i] - b.slope[c][k][i]);
                // The mean over the Gaussian's three axes.
                add(3, (cov.quadratic(off) / 3.0).max(0.0).sqrt() / (slope * error));
            }
            if !is_share {
                // The inverse standard error of the logarithm of a deviation.
                let each = (2.0 * components as f64 * n).sqrt();
                add(1, 0.5 * libm::log(own_trace / trace) * each / log);
            }
            if components == 3 {
                let off = (0..6).map(|k| a.spread[k][i] / own_trace - b.spread[k][i] / trace);
                add(2, off.map(|v| v * v).sum::<f64>().sqrt() * n.sqrt() / shape);
            }
            if let (Some(stored_excess), Some(anew)) = (&a.excess, &b.excess) {
                add(4, (stored_excess[i] - anew[i]) * n.sqrt() / f64::from(logarithmic[4]));
            }
        }
    }
    squares.iter().map(|[sum, n]| (sum / n.max(1.0)).sqrt()).fold(0.0, f64::max)
}
