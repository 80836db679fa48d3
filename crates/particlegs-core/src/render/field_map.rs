//! Maps of a field: its weighted mean along each line of sight, and its dispersion about that (docs/law/fields.md).

use super::bin::{SMALL, lattice_sum};
use super::field_query::{FieldComponent, FieldQuery};
use super::lens::Lens;
use super::project::{CameraGaussian, Footprint, slices};
use super::scene::Scene;
use super::surface::{all_tails, moved, reach};
use crate::camera::DensityView;
use crate::context::Context;
use crate::math::{Sym3, dot, each_axis, norm};
use crate::model::{FieldMoments, Mixture};
use crate::picture::{Plane, Size};
use crate::{Error, Result, parallel};
use std::borrow::Cow;

/// Footprints end at these many deviations, squared: 2e-5 of the mass lies beyond.
const CUT: f64 = 22.0;
/// Rows that one task draws.
const BAND: usize = 16;

/// A field on the picture plane. Values are NaN where there is no mass.
#[derive(Clone, Debug)]
pub struct FieldMap {
    /// Mean weighted by surface density, in the field's unit.
    pub mean: Plane,
    /// Root mean square of what single particles differ from the mean.
    pub dispersion: Plane,
    /// The surface density that weighs, of the parts that have the field.
    pub density: Plane,
}

impl FieldMap {
    /// What a query asks for: the dispersion or the mean.
    pub fn wanted(&self, query: &FieldQuery) -> &Plane {
        if query.dispersion { &self.dispersion } else { &self.mean }
    }
}

/// Maps a field of a scene. Parts without it add nothing; an error where none has it. Masses weigh where particles have
/// weights or masses of their own, else numbers of particles.
pub fn field_map(
    scene: &Scene,
    query: &FieldQuery,
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
) -> Result<FieldMap> {
    let all: Vec<(&Mixture, f64)> =
        scene.parts.iter().copied().filter(|(m, _)| m.fields.get(&query.name).is_some()).collect();
    let range = range(&all, query)?;
    let reference = overall_mean(&all, query);
    let scene = Scene { parts: all, shifts: scene.shifts.clone(), ..*scene };
    let cell = view.centered_cell();
    let parts: Vec<Cow<'_, Mixture>> =
        scene.parts.iter().map(|(m, _)| cell.as_ref().map_or(Cow::Borrowed(*m), |c| moved(m, c))).collect();
    let parts = parts.iter().zip(&scene.parts).map(|(m, (_, mass))| (&**m, *mass)).collect();
    let scene = Scene { parts, shifts: scene.shifts.clone(), ..scene };
    let mut sums: Option<[Plane; 3]> = None;
    let mut folded = Vec::with_capacity(3);
    for k in 0..3 {
        let tails = |cell: &_| all_tails(&scene, view.camera.focal_point, cell);
        folded.push(view.wrapped(size, tails, |view, size| {
            let sums = match &mut sums {
                Some(sums) => sums,
                none => none.insert(drawn(&scene, query, reference, view, size, context)?),
            };
            Ok(std::mem::replace(&mut sums[k], Plane::zeros(Size { width: 0, height: 0 })))
        })?);
    }
    let [density, mut mean, mut dispersion] = <[Plane; 3]>::try_from(folded).expect("three planes");
    for ((&w, m), d) in density.data.iter().zip(&mut mean.data).zip(&mut dispersion.data) {
        let (w, own) = (f64::from(w), f64::from(*m) / f64::from(w));
        *d = (f64::from(*d) / w - own * own).max(0.0).sqrt() as f32;
        *m = (reference + own).clamp(range[0], range[1]) as f32;
        if w <= 0.0 {
            (*m, *d) = (f32::NAN, f32::NAN);
        }
    }
    Ok(FieldMap { mean, dispersion, density })
}

/// The least and largest value that the number can have.
fn range(parts: &[(&Mixture, f64)], query: &FieldQuery) -> Result<[f64; 2]> {
    let FieldQuery { name, component, bulk, .. } = query;
    let fields: Vec<&FieldMoments> = parts.iter().filter_map(|(m, _)| m.fields.get(name)).collect();
    let Some(first) = fields.first() else { return Err(Error::argument(format!("the model has no field `{name}`"))) };
    let wanted = if *component == FieldComponent::Scalar { 1 } else { 3 };
    if first.components() != wanted {
        let kind = if first.components() == 1 { "a scalar" } else { "a vector" };
        return Err(Error::argument(format!("field `{name}` is {kind}: it has no such component")));
    }
    let of = |k: usize, shift: f64| {
        let ends = fields.iter().map(|f| f.range[k]);
        ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [a, b]| [lo.min(a - shift), hi.max(b - shift)])
    };
    Ok(match component {
        FieldComponent::Scalar => of(0, 0.0),
        FieldComponent::Axis(k) => of(*k, bulk[*k]),
        FieldComponent::LineOfSight => {
            let farthest: [f64; 3] = each_axis(|k| of(k, bulk[k]).map(f64::abs).into_iter().fold(0.0, f64::max));
            [-norm(farthest), norm(farthest)]
        }
    })
}

/// What is subtracted before squares are added up: the mean of all, so that dispersions keep their digits.
fn overall_mean(parts: &[(&Mixture, f64)], query: &FieldQuery) -> f64 {
    let column = match query.component {
        FieldComponent::Scalar => 0,
        FieldComponent::Axis(k) => k,
        FieldComponent::LineOfSight => return 0.0,
    };
    let (mut sum, mut total) = (0.0, 0.0);
    for (m, unit) in parts {
        let Some(field) = m.fields.get(&query.name) else { continue };
        for i in 0..m.len() {
            let w = unit * m.mass_of(i);
            (sum, total) = (sum + w * field.mean[column][i], total + w);
        }
    }
    let bulk = if query.component == FieldComponent::Scalar { 0.0 } else { query.bulk[column] };
    if total > 0.0 { sum / total - bulk } else { 0.0 }
}

/// A footprint with what the field is on it.
struct FieldFootprint {
    footprint: Footprint,
    /// The mean at its centre, and how it changes per pixel.
    value: f64,
    tilt: [f64; 2],
    /// Variance about that.
    variance: f64,
}

/// Planes of weight, weight times value and weight times value squared.
fn drawn(
    scene: &Scene,
    query: &FieldQuery,
    reference: f64,
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
) -> Result<[Plane; 3]> {
    context.require_memory("a map of a field", 40 * size.pixels() as u64)?;
    let mut footprints = Vec::new();
    for own in view.copies(size, &scene.bounds, reach(scene))? {
        for shift in &scene.shifts {
            let lens = Lens::density(view, size, each_axis(|k| own[k] + shift[k]))?;
            for &(m, unit) in &scene.parts {
                let Some(field) = m.fields.get(&query.name) else { continue };
                let part = FieldProjection { lens, mixture: m, field, unit, query, reference };
                let found = parallel::map_range(m.len(), |i| {
                    let mut found = Vec::new();
                    part.project(i, &mut found);
                    found.retain(|f| touches(&f.footprint, size));
                    found
                });
                context.check()?;
                footprints.extend(found.into_iter().flatten());
            }
        }
    }
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); size.height.div_ceil(BAND)];
    for (number, f) in footprints.iter().enumerate() {
        let (at, half) = (f64::from(f.footprint.mean[1]), (CUT * f64::from(f.footprint.down)).sqrt());
        let last = bands.len() - 1;
        let row = |y: f64| (y.max(0.0) as usize / BAND).min(last);
        for band in &mut bands[row(at - half)..=row(at + half)] {
            band.push(number as u32);
        }
    }
    let rows = parallel::try_map(bands.iter().enumerate(), |(band, own)| {
        context.check()?;
        let rows = BAND.min(size.height - band * BAND);
        let mut sums = vec![[0.0f64; 3]; rows * size.width];
        for &f in own {
            draw(&footprints[f as usize], band * BAND, size.width, &mut sums);
        }
        Ok::<_, Error>(sums)
    })?;
    Ok([0, 1, 2].map(|k| Plane { size, data: rows.iter().flatten().map(|v| v[k] as f32).collect() }))
}

fn touches(f: &Footprint, size: Size) -> bool {
    let [xx, _, yy] = f.cov();
    let inside = |at: f32, variance: f64, pixels: usize| {
        let (at, reach) = (f64::from(at), (CUT * variance).sqrt());
        at + reach >= 0.0 && at - reach <= pixels as f64 - 1.0
    };
    f.sum > 0.0
        && f.across > 0.0
        && f.down > 0.0
        && inside(f.mean[0], xx, size.width)
        && inside(f.mean[1], yy, size.height)
}

/// What the Gaussians of one part are projected by.
struct FieldProjection<'a> {
    lens: Lens,
    mixture: &'a Mixture,
    field: &'a FieldMoments,
    /// Mass of a particle of weight 1.
    unit: f64,
    query: &'a FieldQuery,
    /// What is subtracted from values.
    reference: f64,
}

/// The number that is mapped, at one Gaussian: mean, variance, slope in world units.
struct FieldNumber {
    mean: f64,
    variance: f64,
    slope: [f64; 3],
}

impl FieldProjection<'_> {
    /// The footprints of Gaussian `i`, of all its pieces along depth.
    fn project(&self, i: usize, out: &mut Vec<FieldFootprint>) {
        let (lens, m) = (&self.lens, self.mixture);
        let Some(g) = CameraGaussian::from_mixture(lens, m, i, self.unit * m.mass_of(i)) else { return };
        let number = self.number(i);
        // Per unit of the camera's axes.
        let slope = lens.axes.map(|axis| dot(axis, number.slope) / dot(axis, axis));
        let ([x, y, depth], along, rest) = (g.mean.map(f64::from), g.slope.map(f64::from), g.rest());
        slices::pieces(lens, &g, |piece| {
            let footprint = g.footprint(lens, &piece);
            // The piece as a Gaussian in the camera's axes.
            let (at, depths) = match lens.perspective {
                true => (1.0 / piece.mean, piece.variance / (piece.mean * piece.mean * piece.mean * piece.mean)),
                false => (piece.mean, piece.variance),
            };
            let offset = at - depth;
            let cov = Sym3([
                rest[0] + along[0] * along[0] * depths,
                rest[1] + along[0] * along[1] * depths,
                along[0] * depths,
                rest[2] + along[1] * along[1] * depths,
                along[1] * depths,
                depths,
            ]);
            let with = cov.apply(slope);
            let seen = match lens.perspective {
                true => {
                    let [u, v] = [(x + along[0] * offset) / at, (y + along[1] * offset) / at];
                    [with[0] - u * with[2], with[1] - v * with[2]].map(|c| c * lens.focal / at)
                }
                false => [with[0] * lens.focal, with[1] * lens.focal],
            };
            let [xx, xy, yy] = footprint.cov();
            let det = f64::from(footprint.across) * yy;
            let tilt = [(yy * seen[0] - xy * seen[1]) / det, (xx * seen[1] - xy * seen[0]) / det];
            let explained = tilt[0] * seen[0] + tilt[1] * seen[1];
            let value = number.mean - self.reference + dot(slope, [along[0] * offset, along[1] * offset, offset]);
            let variance = (number.variance + dot(slope, with) - explained).max(0.0);
            out.push(FieldFootprint { footprint, value, tilt, variance });
        });
    }

    fn number(&self, i: usize) -> FieldNumber {
        let FieldProjection { lens, field, query, .. } = self;
        let direction = match query.component {
            FieldComponent::Scalar => {
                let slope = each_axis(|a| field.slope[0][a][i]);
                return FieldNumber { mean: field.mean[0][i], variance: field.spread[0][i], slope };
            }
            FieldComponent::Axis(k) => each_axis(|a| if a == k { 1.0 } else { 0.0 }),
            FieldComponent::LineOfSight => {
                let mean = self.mixture.mean_of(i);
                let away = match lens.perspective {
                    true => each_axis(|k| mean[k] - lens.position[k]),
                    false => lens.axes[2],
                };
                let length = norm(away).max(f64::MIN_POSITIVE);
                away.map(|v| v / length)
            }
        };
        let spread = Sym3(std::array::from_fn(|k| field.spread[k][i]));
        FieldNumber {
            mean: dot(direction, each_axis(|k| field.mean[k][i] - query.bulk[k])),
            variance: dot(direction, spread.apply(direction)),
            slope: each_axis(|a| dot(direction, each_axis(|k| field.slope[k][a][i]))),
        }
    }
}

/// Adds a footprint to the rows from `first` on.
fn draw(f: &FieldFootprint, first: usize, width: usize, sums: &mut [[f64; 3]]) {
    let Footprint { mean, .. } = f.footprint;
    let [at_x, at_y] = mean.map(f64::from);
    let [down, lean, across, sum] =
        [f.footprint.down, f.footprint.lean, f.footprint.across, f.footprint.sum].map(f64::from);
    let [xx, _, yy] = f.footprint.cov();
    let mut peak = sum / (2.0 * std::f64::consts::PI * (down * across).sqrt());
    if across * down / (xx + yy) < SMALL {
        peak /= lattice_sum([at_x, at_y], f.footprint.cov());
    }
    for (row, pixels) in sums.chunks_exact_mut(width).enumerate() {
        let dy = (first + row) as f64 - at_y;
        let left = CUT - dy * dy / down;
        if left < 0.0 {
            continue;
        }
        let (center, half) = (at_x + lean * dy, (left * across).sqrt());
        let from = (center - half).ceil().max(0.0);
        let to = (center + half).floor().min(width as f64 - 1.0);
        if to < from {
            continue;
        }
        // Values of a Gaussian one pixel apart: their quotients' quotient is constant.
        let aside = from - center;
        let mut weight = peak * libm::exp(-0.5 * (dy * dy / down + aside * aside / across));
        let mut quotient = libm::exp(-(aside + 0.5) / across);
        let change = libm::exp(-1.0 / across);
        let mut value = f.value + f.tilt[0] * (from - at_x) + f.tilt[1] * dy;
        for pixel in &mut pixels[from as usize..=to as usize] {
            pixel[0] += weight;
            pixel[1] += weight * value;
            pixel[2] += weight * (value * value + f.variance);
            weight *= quotient;
            quotient *= change;
            value += f.tilt[0];
        }
    }
}
