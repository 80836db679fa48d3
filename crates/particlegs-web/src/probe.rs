//! What is under the pointer, and how much is in a sphere.

use particlegs_core::camera::Camera;
use particlegs_core::math::{GaussianInSphere, Rules, Sym3, each_axis};
use particlegs_core::model::{Mixture, Model};
use particlegs_core::picture::Size;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::{CameraGaussian, project};
use serde::Serialize;

/// What is seen at a pixel: the Gaussian that adds most to it, and the point of the line of sight where that Gaussian
/// is densest.
#[derive(Serialize)]
pub(crate) struct ProbeHit {
    /// World units; in an image of the box, where that image is.
    position: [f64; 3],
    /// The same in the box itself.
    in_box: [f64; 3],
    /// Its number in the file, all layers counted on.
    pub(crate) gaussian: usize,
    layer: String,
    /// Particles that it stands for, and their mass where it is known.
    count: f64,
    mass: Option<f64>,
    /// Deviations along its principal axes, world units.
    deviations: [f64; 3],
    /// Of the whole model at the position: particles and mass a world unit cubed.
    number_density: f64,
    density: Option<f64>,
}

/// A depth that nobody sees, at whatever opacity.
const UNSEEN: f64 = 1e-6;

/// What a sphere holds.
#[derive(Serialize)]
pub(crate) struct SphereContents {
    /// Particles, and their mass where it is known.
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

/// A covariance that has an inverse, of at least the width `least`.
fn invertible(cov: Sym3, least: f64) -> Option<Sym3> {
    let widened = cov.add(&Sym3::scaled_identity(least * least + 1e-9 * cov.trace()));
    widened.inverse()
}

impl ProbeHit {
    /// Says which Gaussian of the whole model it is, of which it may be a part.
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

/// What the picture shows at `pixel`, of the box and its images, each with its lens and shift; `None` where it is empty.
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
    let [number_density, density] = densities(model, shown, in_box);
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
    })
}

/// Particles and mass a world unit cubed at a point.
fn densities(model: &Model, shown: &dyn Fn(usize) -> bool, at: [f64; 3]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (_, p) in places(model, shown) {
        let (mean, cov) = (p.m.mean_of(p.i), p.m.cov_of(p.i));
        let offset = each_axis(|k| at[k] - mean[k]);
        let square: f64 = offset.iter().map(|v| v * v).sum();
        if square > 60.0 * cov.trace() {
            continue;
        }
        let Some(inverse) = invertible(cov, 0.0) else { continue };
        let peak = inverse.det().max(0.0).sqrt() / (2.0 * std::f64::consts::PI).sqrt().powi(3);
        let value = peak * (-0.5 * inverse.quadratic(offset)).exp();
        sums[0] += p.m.count[p.i] * value;
        sums[1] += p.unit * p.m.mass_of(p.i) * value;
    }
    sums
}

/// What lies within `radius` of `center`, world units.
pub(crate) fn held(model: &Model, shown: &dyn Fn(usize) -> bool, center: [f64; 3], radius: f64) -> SphereContents {
    let rules = Rules::new();
    let longest = model.metadata.bounds.extent().into_iter().fold(0.0, f64::max);
    let widths = [1e-9 * longest, f64::MAX];
    let (mut count, mut mass) = (0.0, 0.0);
    for (_, p) in places(model, shown) {
        let lump = GaussianInSphere::new(p.m.mean_of(p.i), &p.m.cov_of(p.i), 1.0, widths);
        let mut share = [0.0];
        lump.add_within(each_axis(|k| center[k] - lump.mean[k]), &[radius], &rules, &mut share);
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
