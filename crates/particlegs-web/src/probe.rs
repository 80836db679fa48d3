//! The Gaussian under the pointer, and the contents of a sphere.

use particlegs_core::camera::Camera;
use particlegs_core::math::{GaussianInSphere, Rules, Sym3, dot, each_axis, norm};
use particlegs_core::model::{Mixture, Model, Quantity, QuantityKind};
use particlegs_core::picture::Size;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::{CameraGaussian, project};
use serde::Serialize;

/// The Gaussian that adds most to a pixel, and the point on the line of sight where it is densest.
#[derive(Serialize)]
pub(crate) struct ProbeHit {
    /// World units; may be in a periodic image of the box.
    position: [f64; 3],
    /// The same point in the box itself.
    in_box: [f64; 3],
    /// Its index in the file, counted over all layers.
    pub(crate) gaussian: usize,
    layer: String,
    /// Number of its particles, and their mass if known.
    count: f64,
    mass: Option<f64>,
    /// Standard deviations along its principal axes, world units.
    deviations: [f64; 3],
    /// Densities of the whole model at the position, per world unit cubed.
    number_density: f64,
    density: Option<f64>,
    /// The model's fields at the position.
    fields: Vec<FieldAtPlace>,
}

/// A field at a place (docs/law/fields.md): of a scalar one number, of a vector x, y, z and along the line of sight; of a
/// sum, such as a charge, how much there is in a unit of volume, without a dispersion.
#[derive(Serialize)]
struct FieldAtPlace {
    name: String,
    /// Empty where there is no mass that has the field.
    mean: Vec<f64>,
    dispersion: Vec<f64>,
}

/// An optical depth that is invisible at any opacity.
const UNSEEN: f64 = 1e-6;

/// The contents of a sphere.
#[derive(Serialize)]
pub(crate) struct SphereContents {
    /// Number of particles, and their mass if known.
    count: f64,
    mass: Option<f64>,
}

/// A Gaussian of a model.
struct GaussianRef<'a> {
    layer: usize,
    unit: f64,
    m: &'a Mixture,
    i: usize,
}

fn places<'a>(model: &'a Model, shown: &'a dyn Fn(usize) -> bool) -> impl Iterator<Item = (usize, GaussianRef<'a>)> {
    let all = model.layers.iter().enumerate().flat_map(|(layer, l)| {
        let unit = l.mass.unit_or_one();
        l.content
            .iter()
            .flat_map(move |b| (0..b.gaussians.len()).map(move |i| GaussianRef { layer, unit, m: &b.gaussians, i }))
    });
    all.enumerate().filter(|(_, p)| shown(p.layer))
}

/// The inverse of a covariance that is widened by `least`.
fn invertible(cov: Sym3, least: f64) -> Option<Sym3> {
    let widened = cov.add(&Sym3::scaled_identity(least * least + 1e-9 * cov.trace()));
    widened.inverse()
}

impl ProbeHit {
    /// Sets the data of the whole Gaussian, if the hit is a clipped part of it.
    pub(crate) fn number_in(&mut self, whole: &Model, number: usize) {
        self.gaussian = number;
        if let Some((_, p)) = places(whole, &|_| true).nth(number) {
            self.count = p.m.count[p.i];
            self.mass = self.mass.map(|_| p.unit * p.m.mass_of(p.i));
            self.deviations = deviations(&p.m.cov_of(p.i));
        }
    }
}

fn deviations(cov: &Sym3) -> [f64; 3] {
    cov.eigen().values.map(|v| v.max(0.0).sqrt())
}

/// Finds what the picture shows at `pixel`; `images` are the lens and shift of the box and its periodic images.
pub(crate) fn seen(
    model: &Model,
    shown: &dyn Fn(usize) -> bool,
    (camera, images, size): (&Camera, &[(Lens, [f64; 3])], Size),
    pixel: [f64; 2],
) -> Option<ProbeHit> {
    let mut best = (0.0, 0, [0.0; 3]);
    let mut footprints = Vec::new();
    for (number, p) in places(model, shown) {
        for (lens, shift) in images {
            let Some(g) = CameraGaussian::from_mixture(lens, p.m, p.i, p.m.count[p.i]) else { continue };
            footprints.clear();
            project(lens, &[g], &mut footprints);
            let adds: f64 = footprints.iter().map(|f| f.at(pixel)).sum();
            if adds > best.0 {
                best = (adds, number, *shift);
            }
        }
    }
    let (adds, number, shift) = best;
    if adds < UNSEEN {
        return None;
    }
    let (_, p) = places(model, shown).find(|(n, _)| *n == number)?;
    let (eye, along) = camera.ray(pixel, size).ok()?;
    let from = each_axis(|k| eye[k] - shift[k]);
    let (mean, cov) = (p.m.mean_of(p.i), p.m.cov_of(p.i));
    let inverse = invertible(cov, model.metadata.default_radius)?;
    let to = inverse.apply(each_axis(|k| mean[k] - from[k]));
    let t = (0..3).map(|k| along[k] * to[k]).sum::<f64>() / inverse.quadratic(along);
    let in_box = each_axis(|k| from[k] + t * along[k]);
    let near = weights(model, shown, in_box);
    let number_density = near.iter().fold(0.0, |sum, (p, value)| sum + p.m.count[p.i] * value);
    let density = near.iter().fold(0.0, |sum, (p, value)| sum + p.unit * p.m.mass_of(p.i) * value);
    let sight = along.map(|v| v / norm(along));
    let known = model.has_masses();
    Some(ProbeHit {
        position: each_axis(|k| in_box[k] + shift[k]),
        in_box,
        gaussian: number,
        layer: model.layers[p.layer].name.clone(),
        count: p.m.count[p.i],
        mass: known.then(|| p.unit * p.m.mass_of(p.i)),
        deviations: deviations(&cov),
        number_density,
        density: known.then_some(density),
        fields: model.metadata.fields.iter().map(|q| field(q, &near, in_box, sight)).collect(),
    })
}

/// The Gaussians that reach a point, and their normal densities there, per world unit cubed.
fn weights<'a>(model: &'a Model, shown: &'a dyn Fn(usize) -> bool, at: [f64; 3]) -> Vec<(GaussianRef<'a>, f64)> {
    let near = places(model, shown).filter_map(|(_, p)| {
        let (mean, cov) = (p.m.mean_of(p.i), p.m.cov_of(p.i));
        let offset = each_axis(|k| at[k] - mean[k]);
        let square: f64 = offset.iter().map(|v| v * v).sum();
        // There the density is below exp(-30) of its peak in any direction, as no variance is above the trace.
        if square > 60.0 * cov.trace() {
            return None;
        }
        let inverse = invertible(cov, 0.0)?;
        let peak = inverse.det().max(0.0).sqrt() / (2.0 * std::f64::consts::PI).sqrt().powi(3);
        Some((p, peak * (-0.5 * inverse.quadratic(offset)).exp()))
    });
    near.collect()
}

/// A field at a point: `near` are the Gaussians and their normal densities there.
fn field(q: &Quantity, near: &[(GaussianRef<'_>, f64)], at: [f64; 3], sight: [f64; 3]) -> FieldAtPlace {
    let directions: &[[f64; 3]] = match q.kind {
        QuantityKind::Vector => &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], sight],
        _ => &[[1.0, 0.0, 0.0]],
    };
    let (mut total, mut sums, mut values) = (0.0, vec![[0.0; 2]; directions.len()], 0.0);
    for (p, value) in near {
        let Some(field) = p.m.fields.get(&q.name) else { continue };
        let unit = if q.extensive { 1.0 } else { p.unit };
        let weight = unit * p.m.mass_of(p.i) * value;
        let from_mean = each_axis(|a| at[a] - p.m.mean[a][p.i]);
        let component_means =
            each_axis(|k| if k < field.components() { field.mean_at(k, p.i, from_mean) } else { 0.0 });
        values += weight * field.value_at(0, p.i, from_mean);
        let spread = Sym3(std::array::from_fn(|c| field.spread.get(c).map_or(0.0, |s| s[p.i])));
        total += weight;
        for (direction, [sum, squares]) in directions.iter().zip(&mut sums) {
            let mean = dot(*direction, component_means);
            *sum += weight * mean;
            *squares += weight * (mean * mean + spread.quadratic(*direction));
        }
    }
    let known = if total > 0.0 { sums } else { Vec::new() };
    let mean: Vec<f64> = known.iter().map(|[sum, _]| sum / total).collect();
    let unit = if q.logarithmic { std::f64::consts::LN_10 } else { 1.0 };
    let dispersion = |([_, squares], m): (&[f64; 2], &f64)| (squares / total - m * m).max(0.0).sqrt() / unit;
    let dispersion: Vec<f64> = known.iter().zip(&mean).map(dispersion).collect();
    let name = q.name.clone();
    match (q.extensive, q.logarithmic && total > 0.0) {
        (true, _) => FieldAtPlace { name, mean: mean.iter().map(|m| total * m).collect(), dispersion: Vec::new() },
        (_, true) => FieldAtPlace { name, mean: vec![values / total], dispersion },
        _ => FieldAtPlace { name, mean, dispersion },
    }
}

/// The contents of the sphere of `radius` about `center`, world units.
pub(crate) fn held(model: &Model, shown: &dyn Fn(usize) -> bool, center: [f64; 3], radius: f64) -> SphereContents {
    let rules = Rules::new();
    let longest = model.metadata.bounds.extent().into_iter().fold(0.0, f64::max);
    let widths = [1e-9 * longest, f64::MAX];
    let (mut count, mut mass) = (0.0, 0.0);
    for (_, p) in places(model, shown) {
        let gaussian = GaussianInSphere::new(p.m.mean_of(p.i), &p.m.cov_of(p.i), 1.0, widths);
        let mut share = [0.0];
        gaussian.add_within(each_axis(|k| center[k] - gaussian.mean[k]), &[radius], &rules, &mut share);
        count += p.m.count[p.i] * share[0];
        mass += p.unit * p.m.mass_of(p.i) * share[0];
    }
    SphereContents { count, mass: model.has_masses().then_some(mass) }
}

/// Mean of Gaussian `index` of all layers, and its largest deviation.
pub(crate) fn gaussian(model: &Model, index: usize) -> Option<([f64; 3], f64)> {
    let (_, p) = places(model, &|_| true).nth(index)?;
    Some((p.m.mean_of(p.i), p.m.cov_of(p.i).eigen().values[0].max(0.0).sqrt()))
}
