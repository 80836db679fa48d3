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
/// How many times the spreads may be those coded anew where Gaussians were joined or blocks overlap.
const SPREADS: f64 = 1.5;
/// Steps of correlations in standard errors, and their area tangents at most.
const CORRELATION_STEP: f64 = 4.0;
const LARGEST_TANGENT: f64 = 4.0;
/// How much less of the means' variance the model may explain than means that are gathered anew, where these explain
/// the most of it.
const EXPLAINED: f64 = 0.25;

/// How near the fields of a model are to those that this program codes of its particles.
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

/// What was found of the fields.
pub(super) struct FieldComparison {
    /// What the model says of them.
    pub figures: Vec<StatedFigure>,
    /// What fields that are gathered from halves of the particles say, as a certificate has it.
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
            let [before, own] = stored.frames.as_ref()?;
            before.field_before(own, at, quantity)
        };
        let anew = fields.coded_anew(model, &before, context)?;
        let mut figures = Vec::new();
        for (layer, anew) in model.layers.iter().zip(&anew.layers) {
            let of_several = model.layers.len() > 1;
            let of = if of_several { format!(", layer `{}`", layer.name) } else { String::new() };
            let listed = &model.metadata.fields;
            for (_, q) in listed.iter().enumerate().filter(|(n, _)| Metadata::is_stored(listed, *n)) {
                figures.extend(of_field(q, &of, &layer.content, &anew.content, nearness));
            }
            // A merge may have left out fields that others correlate with.
            let merged = model.metadata.recipe.steps.contains(&RecipeStep::Merge);
            let pairs = (0..listed.len()).flat_map(|b| (0..b).map(move |a| [&listed[a].name[..], &listed[b].name[..]]));
            figures.extend(
                pairs.filter_map(|pair| of_correlation(pair, &of, &layer.content, &anew.content, (nearness, merged))),
            );
        }
        let gathered = fields.agreement(model, seed, context)?;
        let own = fields.agreement_of_model(model, seed, context)?;
        let mut of_model = gathered.unwrap_or_default();
        for ((q, to), own) in model.metadata.fields.iter().zip(&mut of_model.each).zip(own.unwrap_or_default().each) {
            let (Some(anew), Some(own)) = (to.as_ref().copied(), own) else { continue };
            figures.extend(explained(q, &anew, &own));
            *to = Some(FieldAgreement { error: anew.error.max(own.error), ..anew });
        }
        Ok(FieldComparison { figures, gathered, of_model })
    }
}

fn figure(name: String, stored: String, measured: String, tolerance: String, differs: bool) -> StatedFigure {
    StatedFigure { name: format!("fields {name}"), stored, measured, tolerance, differs }
}

/// The share of the means' variance that the model's means explain, beside that of means gathered anew.
fn explained(q: &Quantity, anew: &FieldAgreement, own: &FieldAgreement) -> Option<StatedFigure> {
    let [anew, own] = [anew.explained()?, own.explained().unwrap_or(f64::NEG_INFINITY)];
    let differs = anew >= 0.5 && own < anew - EXPLAINED;
    let text = |v: f64| format!("{:.1} %", 100.0 * v);
    let name = format!("{}: variance of means explained", q.name);
    Some(figure(name, text(own), text(anew), format!("{:.0} % less", 100.0 * EXPLAINED), differs))
}

/// What the blocks of a layer say of a field, beside what is coded anew.
fn of_field(q: &Quantity, of: &str, stored: &[Block], anew: &[Block], nearness: Nearness) -> Vec<StatedFigure> {
    let pairs: Vec<[&Mixture; 2]> = stored.iter().zip(anew).map(|(a, b)| [&a.gaussians, &b.gaussians]).collect();
    let field = |g: &Mixture| g.fields.get(&q.name).is_some();
    if pairs.iter().all(|p| p.iter().all(|g| !field(g))) {
        return Vec::new();
    }
    let have = [0, 1].map(|side| pairs.iter().filter(|p| field(p[side])).count());
    if pairs.iter().any(|[a, b]| field(a) != field(b)) {
        let name = format!("{}{of}: blocks that have it", q.name);
        let [own, anew] = have.map(|n| n.to_string());
        return vec![figure(name, own, anew, "same".into(), true)];
    }
    let pairs: Vec<[FieldOfBlock<'_>; 2]> =
        pairs.into_iter().filter_map(|[a, b]| Some([FieldOfBlock::new(a, q)?, FieldOfBlock::new(b, q)?])).collect();
    let mut figures = Vec::new();
    for (c, component) in q.component_names().into_iter().enumerate() {
        let total = |side: usize, of: &dyn Fn(f64) -> f64| pairs.iter().map(|p| p[side].sum(c, of)).sum::<f64>();
        let [own, anew] = [0, 1].map(|side| total(side, &|v| v));
        let differs = (own - anew).abs() > SUM * total(1, &f64::abs);
        figures.push(figure(
            format!("{component}{of}: sum"),
            own.to_string(),
            anew.to_string(),
            format!("{SUM:e} of all"),
            differs,
        ));
        for (end, name) in ["least value", "largest value"].into_iter().enumerate() {
            let bound = |side: usize| {
                let all = pairs.iter().map(|p| p[side].moments.range[c][end]);
                if end == 0 { all.fold(f64::INFINITY, f64::min) } else { all.fold(f64::NEG_INFINITY, f64::max) }
            };
            let [own, anew] = [0, 1].map(bound);
            let differs = (own - anew).abs() > BOUND * own.abs().max(anew.abs());
            let text = |v: f64| if q.logarithmic { v.exp().to_string() } else { v.to_string() };
            figures.push(figure(
                format!("{component}{of}: {name}"),
                text(own),
                text(anew),
                format!("{BOUND:e}"),
                differs,
            ));
        }
    }
    figures.push(match nearness {
        Nearness::Means => {
            let [own, anew] = [0, 1].map(|side| pairs.iter().map(|p| p[side].spread()).sum::<f64>().sqrt());
            let differs = own > SPREADS * anew || anew > SPREADS * own;
            let name = format!("{}{of}: spread within Gaussians", q.name);
            figure(name, own.to_string(), anew.to_string(), format!("{SPREADS} times"), differs)
        }
        nearness => {
            let steps = differing_steps(&pairs, nearness == Nearness::Extracted);
            let same = nearness == Nearness::Same;
            let differs =
                if same { pairs.iter().any(|[a, b]| !a.has_moments_of(b)) } else { steps.is_nan() || steps > STEPS };
            let tolerance = if same { "same".into() } else { STEPS.to_string() };
            let name = format!("{}{of}: moments, steps off", q.name);
            figure(name, format!("{steps:.1e}"), "0".into(), tolerance, differs)
        }
    });
    figures
}

/// What the blocks of a layer say of how two fields correlate, beside what is coded anew.
fn of_correlation(
    [a, b]: [&str; 2],
    of: &str,
    stored: &[Block],
    anew: &[Block],
    (nearness, merged): (Nearness, bool),
) -> Option<StatedFigure> {
    let [own, anew] = [stored, anew].map(|blocks| {
        let all = blocks.iter().map(|block| block.gaussians.correlation(a, b).cloned());
        all.collect::<Vec<Option<Vec<f64>>>>()
    });
    let is_there = |all: &[Option<Vec<f64>>]| all.iter().any(Option::is_some);
    if nearness == Nearness::Means || !is_there(&own) && (merged || !is_there(&anew)) {
        return None;
    }
    let name = format!("{a} with {b}{of}: correlations");
    if own.iter().zip(&anew).any(|(own, anew)| own.is_some() != anew.is_some()) {
        let [own, anew] = [own, anew].map(|all| all.iter().flatten().count().to_string());
        return Some(figure(format!("{name}, blocks that have them"), own, anew, "same".into(), true));
    }
    let number = |r: f64| r.atanh().clamp(-LARGEST_TANGENT, LARGEST_TANGENT);
    let (mut square, mut n) = (0.0, 0.0f64);
    for ((block, own), anew) in stored.iter().zip(&own).zip(&anew) {
        for ((count, own), anew) in block.gaussians.count.iter().zip(own.iter().flatten()).zip(anew.iter().flatten()) {
            square += count * ((number(*own) - number(*anew)) / CORRELATION_STEP).powi(2);
            n += 1.0;
        }
    }
    let (steps, same) = ((square / n.max(1.0)).sqrt(), nearness == Nearness::Same && !merged);
    let differs = if same { own != anew } else { steps.is_nan() || steps > STEPS };
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

    /// Are they those of another, but for correlations?
    fn has_moments_of(&self, other: &FieldOfBlock<'_>) -> bool {
        self.moments.columns().eq(other.moments.columns()) && self.moments.range == other.moments.range
    }

    fn weight(&self, i: usize) -> f64 {
        if self.quantity.by_mass { self.g.mass_of(i) } else { self.g.count[i] }
    }

    /// The weighted sum over Gaussians of what `of` makes of the values of component `c`.
    fn sum(&self, c: usize, of: &dyn Fn(f64) -> f64) -> f64 {
        let value = |i: usize| self.weight(i) * of(self.moments.overall_value(c, i, &self.g.cov_of(i)));
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

/// How far moments are from others, in steps of the coder at its default precision: the root mean square over Gaussians, of
/// the kind of number that is furthest. Of a frame that was `extracted` the variance that slopes explain counts, too.
fn differing_steps(pairs: &[[FieldOfBlock<'_>; 2]], extracted: bool) -> f64 {
    let FieldPrecision { steps, logarithmic, shares } = FieldPrecision::default();
    // Of means, logarithms of spreads, shapes, slopes, the excess.
    let mut squares = [[0.0f64; 2]; 5];
    for [own, anew] in pairs {
        let (components, n_of) = (own.moments.components(), &own.g.count);
        let is_share = own.quantity.kind == QuantityKind::Category;
        let [mean, log, shape, slope] = match (is_share, own.quantity.logarithmic) {
            (true, _) => [shares[0], 1.0, 1.0, shares[1]],
            (_, true) => [0, 1, 2, 3].map(|k| logarithmic[k]),
            _ => steps,
        }
        .map(f64::from);
        for i in (0..own.g.len()).filter(|&i| n_of[i] >= 1.0) {
            let [(a, own_trace), (b, trace)] = [own, anew].map(|f| (f.moments, f.trace(i).max(1e-200)));
            let mut add = |kind: usize, off: f64| {
                squares[kind][0] += off * off;
                squares[kind][1] += 1.0;
            };
            let cov = own.g.cov_of(i);
            let by_slope = |c: usize| cov.quadratic(each_axis(|k| b.slope[c][k][i])).max(0.0);
            let moved = if extracted { (0..components).map(by_slope).sum() } else { 0.0 };
            let (own_trace, trace) = (own_trace + moved, trace + moved);
            let (n, size) = (n_of[i], (trace / components as f64).sqrt());
            // A share of none or all still has the deviation of one particle.
            let size = if is_share { size.max(1.0 / n.sqrt()) } else { size };
            let error = size / n.sqrt();
            for c in 0..components {
                add(0, (a.mean[c][i] - b.mean[c][i]) / (mean * error));
                let off = each_axis(|k| a.slope[c][k][i] - b.slope[c][k][i]);
                add(3, (cov.quadratic(off) / 3.0).max(0.0).sqrt() / (slope * error));
            }
            if !is_share {
                let each = (2.0 * components as f64 * n).sqrt();
                add(1, 0.5 * (own_trace / trace).ln() * each / log);
            }
            if components == 3 {
                let off = (0..6).map(|k| a.spread[k][i] / own_trace - b.spread[k][i] / trace);
                add(2, off.map(|v| v * v).sum::<f64>().sqrt() * n.sqrt() / shape);
            }
            if let (Some(own), Some(anew)) = (&a.excess, &b.excess) {
                add(4, (own[i] - anew[i]) * n.sqrt() / f64::from(logarithmic[4]));
            }
        }
    }
    squares.iter().map(|[sum, n]| (sum / n.max(1.0)).sqrt()).fold(0.0, f64::max)
}
