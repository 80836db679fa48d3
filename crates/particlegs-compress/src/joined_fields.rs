//! Fields of a model that was made smaller: joined from those of the Gaussians that it was made of.

use particlegs_core::codec::{FieldPrecision, StoredSection};
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{Block, FieldMoments, Layer, Metadata, Mixture, Quantity};
use particlegs_core::{Result, codec};
use particlegs_files::memory::require;
use particlegs_fit::{BlockField, FieldCorrelation, FieldShape, correlations, gather};
use particlegs_particles::{Column, Particles, RUN, SnapshotMeta};

/// Points that stand for a Gaussian: two along each of three axes of its places, and of its values.
const POINTS: usize = 12;

/// Adds the `fields` of `old` layers, one block each, to the file that was made of them. Sums stay the particles';
/// joined means, slopes and spreads are those of points with the moments of the old Gaussians and their fields
/// together.
pub(super) fn join_fields(
    bytes: Vec<u8>,
    old: &[Layer<Block>],
    fields: Vec<Quantity>,
    context: &Context<'_>,
) -> Result<Vec<u8>> {
    if fields.is_empty() {
        return Ok(bytes);
    }
    let model = codec::decode_with(&bytes, "the smaller model", context)?;
    let mut coded = codec::coded_layers(&bytes, "the smaller model")?;
    for (layer, stored) in model.layers.iter().zip(&mut coded) {
        let Some(old_layer) = old.iter().find(|l| l.name == layer.name) else { continue };
        let g = &old_layer.content.gaussians;
        let is_there =
            |(n, q): &(usize, &Quantity)| g.fields.get(&q.name).is_some() && Metadata::is_stored(&fields, *n);
        let present_fields: Vec<(usize, &Quantity)> = fields.iter().enumerate().filter(is_there).collect();
        if present_fields.is_empty() {
            continue;
        }
        // A point is held as a place and a weight in float32.
        require("the points of fields", (g.len() * POINTS * 16) as u64)?;
        let points = points(g, &old_layer.content);
        let shapes: Vec<FieldShape<'_>> = present_fields.iter().map(|(_, q)| FieldShape::new(q)).collect();
        let read = |run: u64, out: &mut Vec<Vec<f64>>| {
            let range = run as usize * RUN..points.len().min((run as usize + 1) * RUN);
            for &FieldShape { name, components, logarithmic, share, .. } in &shapes {
                // A share has no spread: the points for values repeat those for places.
                let value = |k: usize, p: usize| {
                    let value = value(g, name, k, if share { p - p % POINTS + p % (POINTS / 2) } else { p });
                    if share { value.clamp(0.0, 1.0) } else { value }
                };
                out.extend((0..components).map(|k| range.clone().map(|p| value(k, p)).collect()));
                if let Some(field) = g.fields.get(name).filter(|_| logarithmic) {
                    out.push(range.clone().map(|p| mean_of_values(g, field, p)).collect());
                }
            }
            out.push(range.map(|p| g.count[p / POINTS] / POINTS as f64).collect());
            Ok(())
        };
        let gathered = gather(&layer.content, &points, &shapes, &read, context)?;
        let pairs = joined_correlations(&layer.content, &points, (&shapes, &gathered), g, context)?;
        for (((block, stored), gathered), pairs) in
            layer.content.iter().zip(&mut stored.content).zip(gathered).zip(pairs)
        {
            for pair in pairs {
                let numbers = pair.fields.map(|f| present_fields[f].0 as u8);
                let bytes = codec::encode_correlation(numbers, &pair.values, &block.gaussians);
                stored.sections.push(StoredSection { tag: codec::CORRELATION, bytes });
            }
            for ((number, q), mut f) in present_fields.iter().zip(gathered) {
                let Some(field) = g.fields.get(&q.name) else { continue };
                let weight = |i: usize| if q.by_mass { g.mass_of(i) } else { g.count[i] };
                let value = |k: usize, i: usize| weight(i) * field.overall_value(k, i, &g.cov_of(i));
                // The points give moments; sums and ranges are still the particles' own.
                f.sums = (0..field.components()).map(|k| (0..g.len()).map(|i| value(k, i)).sum()).collect();
                f.moments.range.clone_from(&field.range);
                let precision = FieldPrecision::default();
                let numbered_quantity = (*number as u8, *q);
                let bytes =
                    codec::encode_field(numbered_quantity, &f.moments, &block.gaussians, &f.sums, &precision, None);
                stored.sections.push(StoredSection { tag: codec::FIELD, bytes });
            }
        }
    }
    let metadata = Metadata { fields, ..model.metadata };
    codec::assemble(&metadata, None, coded)
}

/// Correlations of the scalars, of points that have the moments of the old Gaussians. None where a pair's are not
/// known.
fn joined_correlations(
    blocks: &[Block],
    points: &Particles,
    (shapes, gathered): (&[FieldShape<'_>], &[Vec<BlockField>]),
    g: &Mixture,
    context: &Context<'_>,
) -> Result<Vec<Vec<FieldCorrelation>>> {
    let read = |run: u64, out: &mut Vec<Vec<f64>>| {
        let range = run as usize * RUN..points.len().min((run as usize + 1) * RUN);
        for &FieldShape { name, components, logarithmic, .. } in shapes {
            let mean = |k: usize, p: usize| {
                let i = p / POINTS;
                g.fields.get(name).map_or(0.0, |f| f.mean_at(k, i, offset(p, &root(&g.cov_of(i)))))
            };
            let columns = components + usize::from(logarithmic);
            out.extend((0..columns).map(|k| range.clone().map(|p| mean(k.min(components - 1), p)).collect()));
        }
        out.push(range.map(|p| g.count[p / POINTS] / POINTS as f64).collect());
        Ok(())
    };
    // Points carry means alone here: the spread of values inside an old Gaussian comes in as a covariance.
    let within = |p: usize, [a, b]: [usize; 2]| {
        let (i, [a, b]) = (p / POINTS, [a, b].map(|f| shapes[f].name));
        let spread = |name: &str| g.fields.get(name).map_or(0.0, |f| f.spread[0][i]);
        if a == b {
            return spread(a);
        }
        g.correlation(a, b).map_or(0.0, |r| r[i] * (spread(a) * spread(b)).sqrt())
    };
    let mut block_correlations = correlations(blocks, points, (shapes, gathered), &read, Some(&within), context)?;
    let is_known = |c: &FieldCorrelation| g.correlation(shapes[c.fields[0]].name, shapes[c.fields[1]].name).is_some();
    block_correlations.iter_mut().for_each(|pairs| pairs.retain(is_known));
    Ok(block_correlations)
}

/// The points of all Gaussians, each with its share of the mass.
fn points(g: &Mixture, block: &Block) -> Particles {
    let origin = block.bounds.center();
    let roots: Vec<[[f64; 3]; 3]> = (0..g.len()).map(|i| root(&g.cov_of(i))).collect();
    let place = |p: usize| offset(p, &roots[p / POINTS]);
    let column = |k: usize| {
        let at = |p: usize| (g.mean[k][p / POINTS] - origin[k] + place(p)[k]) as f32;
        Column::owned((0..POINTS * g.len()).map(at).collect())
    };
    // A weight must be above 0, also where float32 would round it to 0.
    let weight = |p: usize| (g.mass_of(p / POINTS) / POINTS as f64).max(f64::from(f32::MIN_POSITIVE)) as f32;
    let weights = Column::owned((0..POINTS * g.len()).map(weight).collect());
    Particles::from_column_list(
        vec![column(0), column(1), column(2), weights],
        origin,
        SnapshotMeta::default(),
        Vec::new(),
    )
}

/// Component `k` of a field at a point.
fn value(g: &Mixture, name: &str, k: usize, p: usize) -> f64 {
    let (i, corner) = (p / POINTS, p % POINTS);
    let Some(field) = g.fields.get(name) else { return 0.0 };
    if corner < POINTS / 2 {
        return field.mean_at(k, i, offset(p, &root(&g.cov_of(i))));
    }
    let spread = match field.components() {
        1 => Sym3([field.spread[0][i], 0.0, 0.0, 0.0, 0.0, 0.0]),
        _ => Sym3(std::array::from_fn(|c| field.spread[c][i])),
    };
    field.mean[k][i] + along(corner - POINTS / 2, &root(&spread))[k]
}

/// The mean of a logarithmic field's values at a point's place.
fn mean_of_values(g: &Mixture, field: &FieldMoments, p: usize) -> f64 {
    field.value_at(0, p / POINTS, offset(p, &root(&g.cov_of(p / POINTS))))
}

/// The offset of a point from the mean: half of them lie along the axes, the others at the mean itself.
fn offset(p: usize, root: &[[f64; 3]; 3]) -> [f64; 3] {
    match p % POINTS {
        corner if corner < POINTS / 2 => along(corner, root),
        _ => [0.0; 3],
    }
}

/// One of six ends of three axes, so far out that twelve points, of which six lie at the mean, have the covariance.
fn along(corner: usize, root: &[[f64; 3]; 3]) -> [f64; 3] {
    let side = if corner.is_multiple_of(2) { 1.0 } else { -1.0 };
    root[corner / 2].map(|v| side * (0.5 * POINTS as f64).sqrt() * v)
}

/// Three vectors whose outer products sum to a covariance.
fn root(cov: &Sym3) -> [[f64; 3]; 3] {
    let eigen = cov.eigen();
    std::array::from_fn(|a| each_axis(|k| eigen.vectors[a][k] * eigen.values[a].max(0.0).sqrt()))
}
