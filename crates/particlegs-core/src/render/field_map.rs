//! Maps of a field: its weighted mean along each line of sight, or its dispersion about that (docs/law/fields.md).

use super::bin::RasterSplat;
use super::field_query::{FieldQuery, MapComponent};
use super::field_strokes::{FieldFootprint, FieldStroke, FieldTerms, SumKind, draw};
use super::lens::Lens;
use super::pixel_moments::{DepthCut, LogExcess, WeightFootprint};
use super::project::{CameraGaussian, DepthMoments, slices};
use super::raster::RasterCanvas;
use super::raster::pyramid::{BAND, FIELD_W, Level};
use super::scene::Scene;
use super::scratch::Scratch;
use super::surface::{all_tails, moved, reach};
use crate::camera::DensityView;
use crate::context::Context;
use crate::math::{Sym3, dot, each_axis, float32_scale, norm};
use crate::model::{FieldMoments, Mixture};
use crate::picture::{Plane, Size};
use crate::{Error, Hint, Result, parallel};
use std::borrow::Cow;
use std::f64::consts::{LN_10, PI};

/// Pixels with less than this of what one particle gives, over the disc of its default radius or a pixel where that is
/// larger, count as empty: tails of Gaussians, where values mean nothing.
const LEAST_DENSITY: f64 = 1e-4;
/// Gaussians projected in one step.
const RUN: usize = 1024;

/// A field on the picture plane.
#[derive(Clone, Debug)]
pub struct FieldMap {
    /// What the query asks for: the mean weighted by surface density, in the field's unit, or the root mean square of what
    /// single particles differ from it; of a logarithmic field that of the decimal logarithm (dex). NaN where there is no
    /// mass, or less than 1e-4 of what one particle gives.
    pub values: Plane<f64>,
    /// The surface density, of the parts that have the field.
    pub density: Plane,
}

/// Maps a field of a scene; of a sum, such as a charge, per world unit squared. Parts without it add nothing; an error where
/// none has it. Means are weighted as the query says.
pub fn field_map(
    scene: &Scene,
    query: &FieldQuery,
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
) -> Result<FieldMap> {
    field_map_by(scene, query, view, size, context, |strokes, sums, canvas| {
        let bands = banded(strokes, &canvas.levels);
        canvas.draw_bands(|number, mut band| {
            context.check()?;
            draw(context.simd(), &mut band, bands[number].iter().map(|&s| &strokes[s as usize]), sums);
            Ok(())
        })
    })
}

/// The same, where `sum` adds strokes to the planes of a canvas, in their order.
pub fn field_map_by(
    scene: &Scene,
    query: &FieldQuery,
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
    sum: impl Fn(&[FieldStroke], &FieldTerms, &mut RasterCanvas<'_>) -> Result<()>,
) -> Result<FieldMap> {
    // Values of sums are over the particles' own weights.
    let unit = |mass: f64| if query.per_area { 1.0 } else { mass };
    let has_it = scene.parts.iter().filter(|(m, _)| m.fields.get(&query.name).is_some());
    let all: Vec<(&Mixture, f64)> = has_it.map(|&(m, mass)| (m, unit(mass))).collect();
    let FieldRange { range, half_width } = FieldRange::new(&all, query)?;
    check_weighting(&all, query)?;
    let is_logarithmic = all.iter().any(|(m, _)| m.fields.get(&query.name).is_some_and(|f| f.excess.is_some()));
    let kind = match query.dispersion {
        true => SumKind::Square,
        false if is_logarithmic => SumKind::Exponential,
        false => SumKind::Value,
    };
    // Planes are float32, which would not hold squares of very large or very small values.
    let largest = if kind == SumKind::Exponential { range[0].abs().max(range[1].abs()) } else { half_width };
    let (reference, scale) = (overall_mean(&all, query), float32_scale(largest));
    let sums = FieldTerms { kind, reference, scale, weighed: query.by.is_some() };
    let least = least_density(scene, &all, query, Lens::density(view, size, [0.0; 3])?.unit);
    let scene = Scene { parts: all, shifts: scene.shifts.clone(), ..*scene };
    let cell = view.centered_cell();
    let parts: Vec<Cow<'_, Mixture>> =
        scene.parts.iter().map(|(m, _)| cell.as_ref().map_or(Cow::Borrowed(*m), |c| moved(m, c))).collect();
    let parts = parts.iter().zip(&scene.parts).map(|(m, (_, mass))| (&**m, *mass)).collect();
    let scene = Scene { parts, shifts: scene.shifts.clone(), ..scene };
    let tails = |cell: &_| all_tails(&scene, view.camera.focal_point, cell);
    let mut planes =
        view.wrapped_planes(size, tails, |view, size| drawn(&scene, query, &sums, (view, size), context, &sum))?;
    // Mass sets the threshold of an empty pixel, also where another field weighs (docs/law/fields.md).
    let mass = if sums.weighed { &planes[sums.planes() - 1] } else { &planes[0] };
    let at = |i: usize| -> f64 {
        let [mass, w, first] = [mass, &planes[0], &planes[1]].map(|p| f64::from(p.data[i]));
        if mass.is_nan() || mass <= least || w <= 0.0 {
            return f64::NAN;
        }
        let scaled_mean = first / w;
        match kind {
            SumKind::Square => {
                // Rounding of the planes may leave a difference below zero.
                let variance = (f64::from(planes[2].data[i]) / w - scaled_mean * scaled_mean).max(0.0);
                (variance.sqrt() / scale).min(half_width) / if is_logarithmic { LN_10 } else { 1.0 }
            }
            _ => {
                let about = if kind == SumKind::Value { reference } else { 0.0 };
                // Values are linear in the place, and would leave the particles' range in the tails of Gaussians.
                let value = (about + scaled_mean / scale).clamp(range[0], range[1]);
                if query.per_area { w * value } else { value }
            }
        }
    };
    let mut values = Plane { size, data: vec![f64::NAN; size.pixels()] };
    parallel::for_each_chunk(&mut values.data, size.width, |j, row| {
        row.iter_mut().enumerate().for_each(|(i, v)| *v = at(j * size.width + i));
    });
    let mut density = planes.swap_remove(if sums.weighed { sums.planes() - 1 } else { 0 });
    density.data.iter_mut().for_each(|v| *v = v.max(0.0));
    Ok(FieldMap { values, density })
}

/// Refuses a field that cannot weigh means: one that can be negative, or whose correlations with the mapped one are not known.
fn check_weighting(parts: &[(&Mixture, f64)], query: &FieldQuery) -> Result<()> {
    let Some(by) = &query.by else { return Ok(()) };
    for (m, _) in parts {
        let Some(field) = m.fields.get(by) else {
            return Err(Error::argument(format!(
                "a layer with field `{}` has no field `{by}` to weigh by",
                query.name
            )));
        };
        if field.excess.is_none() && field.range[0][0] < 0.0 {
            return Err(Error::argument(format!("field `{by}` has negative values: means cannot be weighted by it")));
        }
        if *by != query.name && m.correlation(&query.name, by).is_none() {
            let message = format!("the model has no correlations of `{}` and `{by}`", query.name);
            let hint = Hint::from("compress the snapshot again with ").option("fields", format!("{},{by}", query.name));
            return Err(Error::argument_with(message, hint));
        }
    }
    Ok(())
}

/// The surface density below which a pixel counts as empty; a world unit squared has `pixels`.
fn least_density(scene: &Scene, parts: &[(&Mixture, f64)], query: &FieldQuery, pixels: f64) -> f64 {
    let count = |m: &Mixture| m.count.iter().sum::<f64>();
    let all = scene.parts().map(count).sum::<f64>() * scene.shifts.len() as f64;
    let radius = scene.bounds.default_radius(all as u64);
    let weights = parts.iter().map(|(m, unit)| (0..m.len()).map(|i| query.weight.of(m, *unit, i)).sum::<f64>());
    let particles: f64 = parts.iter().map(|(m, _)| count(m)).sum();
    LEAST_DENSITY * weights.sum::<f64>() / particles.max(1.0) * pixels.min(1.0 / (PI * radius * radius))
}

/// Values that the number can have.
struct FieldRange {
    /// The least and the largest.
    range: [f64; 2],
    /// Half the difference, of a logarithmic field that of the logarithms: no distribution has a larger dispersion.
    half_width: f64,
}

impl FieldRange {
    fn new(parts: &[(&Mixture, f64)], query: &FieldQuery) -> Result<FieldRange> {
        let FieldQuery { name, component, bulk, .. } = query;
        let fields: Vec<&FieldMoments> = parts.iter().filter_map(|(m, _)| m.fields.get(name)).collect();
        let Some(first) = fields.first() else {
            return Err(Error::argument(format!("the model has no field `{name}`")));
        };
        let wanted = if *component == MapComponent::Scalar { 1 } else { 3 };
        if first.components() != wanted {
            let kind = if first.components() == 1 { "a scalar" } else { "a vector" };
            return Err(Error::argument(format!("field `{name}` is {kind}: it has no such component")));
        }
        let joined = |ends: &mut dyn Iterator<Item = [f64; 2]>| {
            ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [a, b]| [lo.min(a), hi.max(b)])
        };
        let shifted_range =
            |k: usize, shift: f64| joined(&mut fields.iter().map(|f| f.value_range(k).map(|v| v - shift)));
        let range = match component {
            MapComponent::Scalar => shifted_range(0, 0.0),
            MapComponent::Axis(k) => shifted_range(*k, bulk[*k]),
            MapComponent::LineOfSight => {
                let farthest: [f64; 3] =
                    each_axis(|k| shifted_range(k, bulk[k]).map(f64::abs).into_iter().fold(0.0, f64::max));
                [-norm(farthest), norm(farthest)]
            }
        };
        let [lo, hi] = if first.excess.is_some() { joined(&mut fields.iter().map(|f| f.range[0])) } else { range };
        Ok(FieldRange { range, half_width: 0.5 * (hi - lo) })
    }
}

/// The number that is subtracted before squares are added up: the mean of all, so that dispersions keep their digits.
fn overall_mean(parts: &[(&Mixture, f64)], query: &FieldQuery) -> f64 {
    let column = match query.component {
        MapComponent::Scalar => 0,
        MapComponent::Axis(k) => k,
        MapComponent::LineOfSight => return 0.0,
    };
    let (mut sum, mut total) = (0.0, 0.0);
    for (m, unit) in parts {
        let Some(field) = m.fields.get(&query.name) else { continue };
        for i in 0..m.len() {
            let w = query.weight.of(m, *unit, i);
            (sum, total) = (sum + w * field.mean[column][i], total + w);
        }
    }
    let bulk = if query.component == MapComponent::Scalar { 0.0 } else { query.bulk[column] };
    if total > 0.0 { sum / total - bulk } else { 0.0 }
}

/// The mean of the field that weighs, which weights are over: sums stay within float32 in any unit.
fn mean_weight(parts: &[(&Mixture, f64)], query: &FieldQuery) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (m, unit) in parts {
        let Some(field) = query.by.as_ref().and_then(|by| m.fields.get(by)) else { continue };
        for i in 0..m.len() {
            let w = query.weight.of(m, *unit, i);
            (sum, total) = (sum + w * field.value_at(0, i, [0.0; 3]), total + w);
        }
    }
    let mean = sum / total;
    if mean > 0.0 && mean.is_finite() { mean } else { 1.0 }
}

/// The planes of sums.
fn drawn(
    scene: &Scene,
    query: &FieldQuery,
    sums: &FieldTerms,
    (view, size): (&DensityView, Size),
    context: &Context<'_>,
    sum: &impl Fn(&[FieldStroke], &FieldTerms, &mut RasterCanvas<'_>) -> Result<()>,
) -> Result<Vec<Plane>> {
    let mut scratch = Scratch::default();
    let mut canvas = RasterCanvas::new(size, sums.planes(), &mut scratch, context)?;
    let mut strokes: Vec<FieldStroke> = Vec::new();
    let per_mean = 1.0 / mean_weight(&scene.parts, query);
    for copy_shift in view.copies(size, &scene.bounds, reach(scene))? {
        for shift in &scene.shifts {
            let lens = Lens::density(view, size, each_axis(|k| copy_shift[k] + shift[k]))?;
            for &(m, unit) in &scene.parts {
                let Some(field) = m.fields.get(&query.name) else { continue };
                let by = query
                    .by
                    .as_ref()
                    .and_then(|by| Some((m.fields.get(by)?, m.correlation(&query.name, by).map(|r| &r[..]))));
                let part =
                    FieldProjection { lens, mixture: m, field, by, per_mean, unit, query, reference: sums.reference };
                let new_strokes = parallel::map_range(m.len().div_ceil(RUN), |run| {
                    let mut footprints = Vec::with_capacity(RUN);
                    (run * RUN..m.len().min((run + 1) * RUN)).for_each(|i| part.project(i, &mut footprints));
                    footprints.into_iter().filter_map(|f| f.placed(&canvas.levels, sums)).collect::<Vec<_>>()
                });
                context.check()?;
                // In the order of the Gaussians, as in every band: sums have the same bits for any number of threads.
                strokes.extend(new_strokes.into_iter().flatten());
            }
        }
    }
    sum(&strokes, sums, &mut canvas)?;
    let rows = canvas.finish(&FIELD_W, context);
    let plane = |k: usize| {
        let mut plane = Plane::zeros(size);
        parallel::for_each_chunk(&mut plane.data, size.width, |j, row| {
            let start = j * rows.stride + k * (rows.stride / sums.planes());
            row.copy_from_slice(&rows.data[start..start + size.width]);
        });
        plane
    };
    Ok((0..sums.planes()).map(plane).collect())
}

/// The strokes that touch each band, by their places.
fn banded(strokes: &[FieldStroke], levels: &[Level]) -> Vec<Vec<u32>> {
    let mut bands = vec![Vec::new(); levels.iter().map(Level::bands).sum()];
    for (place, s) in strokes.iter().enumerate() {
        let level = &levels[s.level];
        let row = |y: f32| y.clamp(0.0, (level.rows - 1) as f32) as usize / BAND;
        let RasterSplat { y, half, .. } = s.splat.raster;
        let touched = row(y - half)..=row(y + half);
        bands[level.first_band..][touched].iter_mut().for_each(|band| band.push(place as u32));
    }
    bands
}

/// The lens, the part and the fields by which Gaussians are projected.
struct FieldProjection<'a> {
    lens: Lens,
    mixture: &'a Mixture,
    field: &'a FieldMoments,
    /// A field that weighs, and its correlations with the other; none of a field with itself.
    by: Option<(&'a FieldMoments, Option<&'a [f64]>)>,
    /// One over the mean of the field that weighs.
    per_mean: f64,
    /// Mass of a particle of weight 1.
    unit: f64,
    query: &'a FieldQuery,
    /// The number that is subtracted from values.
    reference: f64,
}

/// The number that is mapped, at one Gaussian: mean, variance, slope in world units.
struct FieldNumber {
    mean: f64,
    variance: f64,
    slope: [f64; 3],
    excess: Option<f64>,
}

impl FieldNumber {
    /// A scalar, at Gaussian `i`.
    fn scalar(field: &FieldMoments, i: usize) -> FieldNumber {
        let slope = each_axis(|a| field.slope[0][a][i]);
        let excess = field.excess.as_ref().map(|e| e[i]);
        FieldNumber { mean: field.mean[0][i], variance: field.spread[0][i], slope, excess }
    }
}

impl FieldProjection<'_> {
    /// The footprints of Gaussian `i`, of all its pieces along depth.
    fn project(&self, i: usize, out: &mut Vec<FieldFootprint>) {
        let (lens, m) = (&self.lens, self.mixture);
        let Some(g) = CameraGaussian::from_mixture(lens, m, i, self.query.weight.of(m, self.unit, i)) else { return };
        let number = self.number(i);
        // Per unit of the camera's axes.
        let in_camera = |slope: [f64; 3]| lens.axes.map(|axis| dot(axis, slope) / dot(axis, axis));
        let slope = in_camera(number.slope);
        let by = self.by.map(|(field, r)| {
            let weight = FieldNumber::scalar(field, i);
            // `c = r sqrt(S_q S_w)`; of a field with itself it is the variance (docs/law/fields.md, "Two fields").
            let covariance = r.map_or(weight.variance, |r| r[i] * (number.variance * weight.variance).sqrt());
            (in_camera(weight.slope), weight, covariance, field.range[0])
        });
        let ([x, y, depth], along, rest) = (g.mean.map(f64::from), g.slope.map(f64::from), g.rest());
        let [_, depths] = g.depths();
        let is_cut = slices::clip_class(lens, depth, depths) == slices::ClipClass::Cut;
        let mut add = |piece: DepthMoments| {
            let footprint = g.footprint(lens, &piece);
            // The piece as a Gaussian in the camera's axes.
            // Moments are of 1 / z in perspective: to first order z has the variance var(1 / z) / mean^4.
            let (at, depths) = match lens.perspective {
                true => (1.0 / piece.mean, piece.variance / (piece.mean * piece.mean * piece.mean * piece.mean)),
                false => (piece.mean, piece.variance),
            };
            let offset = at - depth;
            // x and y follow depth by regression (docs/law/depth.md): the rest is the same in every piece.
            let cov = Sym3([
                rest[0] + along[0] * along[0] * depths,
                rest[1] + along[0] * along[1] * depths,
                along[0] * depths,
                rest[2] + along[1] * along[1] * depths,
                along[1] * depths,
                depths,
            ]);
            // Covariances with the camera's axes, to those on the picture.
            let on_picture = |with: [f64; 3]| match lens.perspective {
                true => {
                    let [u, v] = [(x + along[0] * offset) / at, (y + along[1] * offset) / at];
                    [with[0] - u * with[2], with[1] - v * with[2]].map(|c| c * lens.focal / at)
                }
                false => [with[0] * lens.focal, with[1] * lens.focal],
            };
            let [xx, xy, yy] = footprint.cov();
            // `A^-1` by the footprint's factors: `xx yy - xy^2` would cancel for needles.
            let det = f64::from(footprint.across) * yy;
            let tilt_of = |seen: [f64; 2]| [(yy * seen[0] - xy * seen[1]) / det, (xx * seen[1] - xy * seen[0]) / det];
            let explained = |tilt: [f64; 2], seen: [f64; 2]| tilt[0] * seen[0] + tilt[1] * seen[1];
            let moved = |slope| dot(slope, [along[0] * offset, along[1] * offset, offset]);
            let with = cov.apply(slope);
            let seen = on_picture(with);
            let tilt = tilt_of(seen);
            let value = number.mean - self.reference + moved(slope);
            let variance = (number.variance + dot(slope, with) - explained(tilt, seen)).max(0.0);
            // In an orthographic view a slab truncates depth at each pixel; in perspective pieces stand for it.
            let with_depth = [cov.0[2], cov.0[4]].map(|c| c * lens.focal);
            let tilt_of_depth = tilt_of(with_depth);
            // Where the place on the picture explains all of depth, a slab still needs a width to divide by.
            let left = (depths - explained(tilt_of_depth, with_depth)).max(1e-12 * depths);
            let with_depth_left = |with: [f64; 3], seen| (with[2] - explained(tilt_of_depth, seen)) / left;
            let slab = (is_cut && !lens.perspective && depths > 0.0).then(|| DepthCut {
                mean: depth,
                tilt: tilt_of_depth,
                deviation: left.sqrt(),
                range: lens.range,
                slope: with_depth_left(with, seen),
            });
            let excess = number.excess.map(|added| LogExcess { added, range: self.field.range[0] });
            let by = by.as_ref().map(|(slope, weight, covariance, range)| {
                let (mapped_with, with) = (with, cov.apply(*slope));
                let by_seen = on_picture(with);
                let by_tilt = tilt_of(by_seen);
                WeightFootprint {
                    value: weight.mean + moved(*slope),
                    tilt: by_tilt,
                    variance: (weight.variance + dot(*slope, with) - explained(by_tilt, by_seen)).max(0.0),
                    covariance: covariance + dot(*slope, mapped_with) - explained(by_tilt, seen),
                    range: *range,
                    per_mean: self.per_mean,
                    excess: weight.excess.map(|added| LogExcess { added, range: *range }),
                    slope: if slab.is_some() { with_depth_left(with, by_seen) } else { 0.0 },
                }
            });
            out.push(FieldFootprint { footprint, value, tilt, variance, excess, slab, by });
        };
        match is_cut && !lens.perspective && depths > 0.0 {
            true => add(slices::whole(lens, depth, depths)),
            false => slices::pieces(lens, &g, add),
        }
    }

    fn number(&self, i: usize) -> FieldNumber {
        let FieldProjection { lens, field, query, .. } = self;
        let mean = |bulk: [f64; 3]| -> [f64; 3] { each_axis(|k| field.mean[k][i] - bulk[k]) };
        // How the direction turns with the place, in perspective: what lies across it, over the distance.
        let mut turn = [0.0; 3];
        let direction = match query.component {
            MapComponent::Scalar => return FieldNumber::scalar(field, i),
            MapComponent::Axis(k) => each_axis(|a| if a == k { 1.0 } else { 0.0 }),
            MapComponent::LineOfSight => {
                let place = self.mixture.mean_of(i);
                let away = match lens.perspective {
                    true => each_axis(|k| place[k] - lens.position[k]),
                    false => lens.axes[2],
                };
                let length = norm(away).max(f64::MIN_POSITIVE);
                let away = away.map(|v| v / length);
                if lens.perspective {
                    let (vector, along) = (mean(query.bulk), dot(away, mean(query.bulk)));
                    turn = each_axis(|k| (vector[k] - along * away[k]) / length);
                }
                away
            }
        };
        let spread = Sym3(std::array::from_fn(|k| field.spread[k][i]));
        FieldNumber {
            mean: dot(direction, mean(query.bulk)),
            variance: dot(direction, spread.apply(direction)),
            slope: each_axis(|a| turn[a] + dot(direction, each_axis(|k| field.slope[k][a][i]))),
            excess: None,
        }
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::camera::{Images, Projection, spherical_camera};
    use crate::math::Random;
    use crate::space::Bounds;

    const SIZE: Size = Size { width: 72, height: 60 };

    fn vector(r: &mut Random) -> [f64; 3] {
        each_axis(|_| r.normal())
    }

    /// Gaussians of several pixels, with a scalar and a vector that change across them.
    fn model() -> Mixture {
        let mut m = Mixture::new(false);
        let (mut scalar, mut flow) = (FieldMoments::new(1), FieldMoments::new(3));
        for i in 0..40 {
            let mut r = Random::new(2, 0, i);
            let axes = [vector(&mut r), vector(&mut r), vector(&mut r)];
            let cov = axes.iter().fold(Sym3::scaled_identity(0.3), |sum, a| sum.add(&Sym3::outer(*a))).scale(0.06);
            m.push(vector(&mut r).map(|v| 0.8 * v), cov, 1.0 + 50.0 * r.uniform(), 0.0);
            for (field, components) in [(&mut scalar, 1), (&mut flow, 3)] {
                for k in 0..components {
                    field.mean[k].push(3.0 + 2.0 * r.normal());
                    (0..3).for_each(|a| field.slope[k][a].push(2.0 * r.normal()));
                }
                let spread = Sym3::outer(vector(&mut r)).add(&Sym3::scaled_identity(0.2));
                field.spread.iter_mut().enumerate().for_each(|(k, column)| column.push(spread.0[k]));
                field.range.fill([-1e3, 1e3]);
            }
        }
        // The same numbers as logarithms, smaller.
        let mut heat = FieldMoments { range: vec![[-40.0, 40.0]], excess: Some(Vec::new()), ..scalar.clone() };
        heat.spread[0].iter_mut().for_each(|v| *v *= 0.2);
        heat.slope[0].iter_mut().flatten().for_each(|v| *v *= 0.4);
        heat.excess = Some((0..m.len()).map(|i| 0.1 * (i as f64).cos()).collect());
        // Fields that weigh.
        let mut warmth = heat.clone();
        warmth.mean[0].reverse();
        // Large exponentials outgrow what lies beyond the footprints' ends.
        warmth.slope[0].iter_mut().flatten().chain(&mut warmth.mean[0]).for_each(|v| *v *= 0.25);
        let mut calm = warmth.clone();
        calm.mean[0].rotate_left(7);
        let mut metals = scalar.clone();
        metals.mean[0].iter_mut().for_each(|v| *v += 60.0);
        metals.slope[0][1].reverse();
        metals.range = vec![[0.0, 1e3]];
        let sines = |k: f64| (0..m.len()).map(|i| (k * i as f64).sin()).collect::<Vec<f64>>();
        heat.correlations.set("metals", sines(1.7));
        metals.correlations.set("scalar", sines(0.3));
        warmth.correlations.set("calm", sines(1.1));
        warmth.correlations.set("scalar", sines(2.3));
        m.fields.set("warmth", warmth);
        m.fields.set("calm", calm);
        m.fields.set("metals", metals);
        m.fields.set("heat", heat);
        m.fields.set("scalar", scalar);
        m.fields.set("velocity", flow);
        m
    }

    fn view(projection: Projection, range: [f64; 2]) -> DensityView {
        let mut camera = spherical_camera([0.1, -0.2, 0.0], 35.0, 20.0, 9.0);
        camera.projection = projection;
        DensityView { name: "a".into(), camera, range, images: Images::Own }
    }

    fn query(name: &str, component: MapComponent) -> FieldQuery {
        let (bulk, weight) = ([0.5, 0.0, -0.3], Default::default());
        FieldQuery { name: name.into(), component, dispersion: false, bulk, per_area: false, weight, by: None }
    }

    /// Density, mean and dispersion of a pixel, by sums along lines of sight.
    fn integrated(m: &Mixture, q: &FieldQuery, v: &DensityView, pixel: [usize; 2]) -> [f64; 3] {
        // Three points of Gauss and Legendre across a pixel, each way.
        let nodes = [(-0.5 * 0.6f64.sqrt(), 5.0 / 18.0), (0.0, 4.0 / 9.0), (0.5 * 0.6f64.sqrt(), 5.0 / 18.0)];
        let frame = v.camera.frame().unwrap();
        let [right, up, back] = frame.axes;
        let focal = v.camera.focal_pixels(SIZE);
        let perspective = matches!(v.camera.projection, Projection::Perspective { .. });
        let mut sums = [0.0; 4];
        let inverses: Vec<Sym3> = (0..m.len()).map(|i| m.cov_of(i).inverse().unwrap()).collect();
        let field = m.fields.get(&q.name).unwrap();
        let [near, far] = v.range.map(|r| r.clamp(0.0, 20.0));
        const STEPS: usize = 600;
        for ((dx, wx), (dy, wy)) in nodes.into_iter().flat_map(|a| nodes.map(|b| (a, b))) {
            let x = (pixel[0] as f64 + dx + 0.5 - 0.5 * SIZE.width as f64) / focal;
            let y = (pixel[1] as f64 + dy + 0.5 - 0.5 * SIZE.height as f64) / focal;
            for step in 0..STEPS {
                let depth = near + (far - near) * (step as f64 + 0.5) / STEPS as f64;
                let scale = if perspective { depth } else { 1.0 };
                let from_eye = each_axis(|k| x * scale * right[k] - y * scale * up[k] - depth * back[k]);
                let at: [f64; 3] = each_axis(|k| frame.position[k] + from_eye[k]);
                let direction = match q.component {
                    MapComponent::Scalar => [1.0, 0.0, 0.0],
                    MapComponent::Axis(k) => each_axis(|a| if a == k { 1.0 } else { 0.0 }),
                    MapComponent::LineOfSight if perspective => from_eye.map(|v| v / norm(from_eye)),
                    MapComponent::LineOfSight => back.map(|v| -v),
                };
                for i in 0..m.len() {
                    let d: [f64; 3] = each_axis(|k| at[k] - m.mean[k][i]);
                    let density = m.count[i] * (-0.5 * dot(d, inverses[i].apply(d))).exp()
                        / ((2.0 * std::f64::consts::PI).powf(1.5) * m.cov_of(i).det().sqrt());
                    let w = wx * wy * density;
                    let components = field.components();
                    let value = |k: usize| {
                        let bulk = if components == 3 { q.bulk[k] } else { 0.0 };
                        field.mean_at(k, i, d) - bulk
                    };
                    let mean: f64 = (0..components).map(|k| direction[k] * value(k)).sum();
                    let spread = match components {
                        1 => field.spread[0][i],
                        _ => {
                            let s = Sym3(std::array::from_fn(|k| field.spread[k][i]));
                            dot(direction, s.apply(direction))
                        }
                    };
                    let terms = match &q.by {
                        None => [1.0, mean, mean * mean + spread, field.value_at(0, i, d)],
                        Some(by) => {
                            let weight_field = m.fields.get(by).unwrap();
                            let r = m.correlation(&q.name, by).map_or(1.0, |r| r[i]);
                            let (weight, shared) =
                                (weight_field.value_at(0, i, d), r * (spread * weight_field.spread[0][i]).sqrt());
                            let value = field.value_at(0, i, d);
                            match weight_field.excess {
                                None => [
                                    weight,
                                    weight * mean + shared,
                                    weight * (mean * mean + spread) + 2.0 * mean * shared,
                                    value * (weight + shared),
                                ],
                                Some(_) => [
                                    weight,
                                    weight * (mean + shared),
                                    weight * ((mean + shared).powi(2) + spread),
                                    weight * value * shared.exp(),
                                ],
                            }
                        }
                    };
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += w * term);
                }
            }
        }
        let mean = sums[1] / sums[0];
        let dispersion = (sums[2] / sums[0] - mean * mean).sqrt();
        match field.excess {
            Some(_) => [sums[0], sums[3] / sums[0], dispersion / LN_10],
            None => [sums[0], mean, dispersion],
        }
    }

    /// The largest differences of mean and dispersion where there is mass, over the values' root mean square.
    fn worst(q: &FieldQuery, v: &DensityView) -> f64 {
        let m = model();
        let bounds = Bounds { min: [-5.0; 3], max: [5.0; 3] };
        let map = |dispersion: bool| {
            let q = FieldQuery { dispersion, ..q.clone() };
            field_map(&Scene::from_mixture(&m, bounds), &q, v, SIZE, &Context::SILENT).unwrap()
        };
        let (map, dispersions) = (map(false), map(true).values);
        let peak = map.density.data.iter().copied().fold(0.0, f32::max);
        let mut worst = 0.0f64;
        let mut seen = 0;
        for i in (0..SIZE.pixels()).step_by(61).filter(|&i| map.density.data[i] > 0.01 * peak) {
            let [_, mean, dispersion] = integrated(&m, q, v, [i % SIZE.width, i / SIZE.width]);
            let off = [map.values.data[i] - mean, dispersions.data[i] - dispersion];
            worst = off.iter().fold(worst, |w, v| w.max(v.abs() / mean.hypot(dispersion)));
            seen += 1;
        }
        assert!(seen > 20, "{seen}");
        worst
    }

    #[test]
    fn maps_are_integrals_along_the_line_of_sight() {
        let flat = Projection::Orthographic { height_world: 4.0 };
        for (name, component) in [
            ("scalar", MapComponent::Scalar),
            ("heat", MapComponent::Scalar),
            ("velocity", MapComponent::Axis(1)),
            ("velocity", MapComponent::LineOfSight),
        ] {
            let off = worst(&query(name, component), &view(flat, [0.0, 18.0]));
            assert!(off < 1e-4, "{name} {component:?}: {off}");
            let off = worst(&query(name, component), &view(flat, [8.7, 9.4]));
            assert!(off < 1e-4, "{name} {component:?}, a slab: {off}");
            let off = worst(&query(name, component), &view(Projection::Perspective { fov_deg: 26.0 }, [1.0, 18.0]));
            // Of second order in the angle that a Gaussian fills.
            assert!(off < 0.12, "{name} {component:?}, perspective: {off}");
        }
    }

    #[test]
    fn means_weighted_by_a_field_are_integrals_along_the_line_of_sight() {
        let flat = Projection::Orthographic { height_world: 4.0 };
        for (name, by) in
            [("scalar", "metals"), ("scalar", "warmth"), ("heat", "metals"), ("calm", "warmth"), ("metals", "metals")]
        {
            let weighed = FieldQuery { by: Some(by.into()), ..query(name, MapComponent::Scalar) };
            for range in [[0.0, 18.0], [8.7, 9.4]] {
                let off = worst(&weighed, &view(flat, range));
                assert!(off < 1e-4, "{name} by {by}, depths {range:?}: {off}");
            }
        }
        let refused = |name: &str, by: &str, message: &str| {
            let (m, bounds) = (model(), Bounds { min: [-5.0; 3], max: [5.0; 3] });
            let weighed = FieldQuery { by: Some(by.into()), ..query(name, MapComponent::Scalar) };
            let scene = Scene::from_mixture(&m, bounds);
            let map = field_map(&scene, &weighed, &view(flat, [0.0, 18.0]), SIZE, &Context::SILENT);
            assert!(map.unwrap_err().to_string().contains(message), "{name} {by}");
        };
        refused("metals", "scalar", "has negative values");
        refused("metals", "warmth", "no correlations of `metals` and `warmth`");
        refused("metals", "dust", "no field `dust` to weigh by");
    }

    #[test]
    fn threads_and_vectors_do_not_change_a_bit() {
        let (m, bounds) = (model(), Bounds { min: [-5.0; 3], max: [5.0; 3] });
        let flat = view(Projection::Orthographic { height_world: 4.0 }, [8.7, 9.4]);
        let weighed = FieldQuery { by: Some("metals".into()), ..query("scalar", MapComponent::Scalar) };
        for q in [query("heat", MapComponent::Scalar), query("velocity", MapComponent::LineOfSight), weighed] {
            let map = |context: &Context<'_>| -> Vec<u64> {
                let map = field_map(&Scene::from_mixture(&m, bounds), &q, &flat, SIZE, context).unwrap();
                map.values.data.iter().map(|v| v.to_bits()).collect()
            };
            let all = map(&Context::SILENT);
            assert!(all == parallel::with_threads(1, || map(&Context::SILENT)).unwrap(), "{}", q.name);
            assert!(all == map(&Context::scalar()), "{}", q.name);
        }
    }

    #[test]
    fn tails_are_empty_and_no_dispersion_exceeds_half_the_range() {
        let mut m = Mixture::new(false);
        let mut field = FieldMoments { range: vec![[0.0, 1.0]], ..FieldMoments::new(1) };
        m.push([0.0; 3], Sym3::scaled_identity(0.04), 100.0, 0.0);
        (field.mean[0], field.spread[0]) = (vec![0.5], vec![0.01]);
        field.slope[0] = [vec![10.0], vec![0.0], vec![0.0]];
        m.fields.set("scalar", field);
        let v = view(Projection::Orthographic { height_world: 4.0 }, [0.0, 18.0]);
        let scene = Scene::from_mixture(&m, Bounds { min: [-5.0; 3], max: [5.0; 3] });
        let map = field_map(&scene, &query("scalar", MapComponent::Scalar), &v, SIZE, &Context::SILENT).unwrap();
        let seen = map.values.data.iter().filter(|v| v.is_finite()).count();
        let reached = map.density.data.iter().filter(|w| **w > 0.0).count();
        assert!(seen > 100 && 10 * seen < 8 * reached, "{seen} {reached}");
        let dispersion = FieldQuery { dispersion: true, ..query("scalar", MapComponent::Scalar) };
        let map = field_map(&scene, &dispersion, &v, SIZE, &Context::SILENT).unwrap();
        assert!(map.values.data.iter().all(|d| d.is_nan() || *d <= 0.5));
    }

    #[test]
    fn there_is_no_mean_where_there_is_no_mass_and_no_map_without_the_field() {
        let m = model();
        let bounds = Bounds { min: [-5.0; 3], max: [5.0; 3] };
        let (scene, v) =
            (Scene::from_mixture(&m, bounds), view(Projection::Orthographic { height_world: 60.0 }, [0.0, 18.0]));
        let map = field_map(&scene, &query("scalar", MapComponent::Scalar), &v, SIZE, &Context::SILENT).unwrap();
        assert!(map.values.data[0].is_nan() && map.density.data[0] == 0.0);
        assert!(map.values.data.iter().any(|v| v.is_finite()));
        for (name, component) in [("none", MapComponent::Scalar), ("scalar", MapComponent::Axis(0))] {
            assert!(field_map(&scene, &query(name, component), &v, SIZE, &Context::SILENT).is_err(), "{name}");
        }
    }

    #[test]
    fn names_of_fields_are_read_and_others_refused() {
        use crate::model::{Quantity, QuantityKind};
        let quantity = |name: &str, kind| Quantity {
            name: name.into(),
            kind,
            unit: None,
            bytes: 4,
            by_mass: false,
            logarithmic: false,
            extensive: false,
        };
        let fields = [quantity("velocity", QuantityKind::Vector), quantity("T", QuantityKind::Scalar)];
        let parse = |text: &str| FieldQuery::new(text, &fields).map(|q| (q.name, q.component, q.dispersion));
        assert_eq!(parse("t").unwrap(), ("T".into(), MapComponent::Scalar, false));
        assert_eq!(parse("velocity.los").unwrap(), ("velocity".into(), MapComponent::LineOfSight, false));
        assert_eq!(parse("dispersion.x").unwrap(), ("velocity".into(), MapComponent::Axis(0), true));
        assert_eq!(parse("dispersion.velocity.z").unwrap(), ("velocity".into(), MapComponent::Axis(2), true));
        assert_eq!(parse("dispersion.T").unwrap(), ("T".into(), MapComponent::Scalar, true));
        for text in ["velocity", "T.x", "los", "dispersion", "dispersion.T.x", "velocity.w", ""] {
            assert!(parse(text).is_err(), "{text}");
        }
        let bare = parse("velocity").unwrap_err();
        assert!(bare.hint().to_string().contains("velocity.los"), "{}", bare.hint());
    }
}
