//! Centres of mass of a model's Gaussians in a box that may repeat.

use super::Domain;
use particlegs_core::Result;
use particlegs_core::math::{Sym3, dot, each_axis, norm};
use particlegs_core::model::{Mixture, Model};
use particlegs_core::space::Bounds;
use std::f64::consts::TAU;

/// Along an edge that repeats, mass has a centre where the mean of its phases is longer than this; that of an even
/// distribution is 0.
const LEAST_PHASE: f64 = 0.1;
/// Radii that steps lead away from where they begin at most: what lies further off is something else.
const REACH: f64 = 2.0;
/// Steps to a centre at most, and the share of the radius that the last one is shorter than.
const STEPS: usize = 200;
const SETTLED: f64 = 1e-6;

/// The middle of some mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassCenter {
    /// In the world, in the box along edges that repeat.
    pub place: [f64; 3],
    /// Edges that the mass fills from end to end: along them it has no centre, and the place is the box's middle.
    pub filled: [bool; 3],
}

/// The centre of the mass of a model's Gaussians, of those `layers` where any are named, and of those whose means are
/// `within` bounds where these are given. `None` where there are none. Along edges that repeat it is the place that the
/// mass lies evenly about by the shortest ways.
///
/// # Errors
/// [`particlegs_core::Error::Argument`]: the model has no such layer.
pub fn mass_center(
    domain: &Domain,
    model: &Model,
    layers: &[String],
    within: Option<&Bounds>,
) -> Result<Option<MassCenter>> {
    let which = if layers.is_empty() { vec![true; model.layers.len()] } else { model.which(layers)? };
    let chosen_layers = model.layers.iter().zip(which).filter(|l| l.1).map(|l| l.0);
    let gaussians = chosen_layers.flat_map(|l| l.content.iter().map(|b| (l.mass.unit_or_one(), &b.gaussians)));
    Ok(mass_center_of(domain, gaussians, within))
}

fn mass_center_of<'a>(
    domain: &Domain,
    gaussians: impl Iterator<Item = (f64, &'a Mixture)>,
    within: Option<&Bounds>,
) -> Option<MassCenter> {
    let is_in = |p: &[f64; 3]| within.is_none_or(|b| (0..3).all(|k| b.min[k] <= p[k] && p[k] < b.max[k]));
    let mut parts: Vec<([f64; 3], f64)> = Vec::new();
    for (unit, mixture) in gaussians {
        let points = (0..mixture.len()).map(|i| (mixture.mean_of(i), unit * mixture.mass_of(i)));
        parts.extend(points.filter(|(p, mass)| *mass > 0.0 && is_in(p)).map(|(p, mass)| (domain.local(p), mass)));
    }
    let mass: f64 = parts.iter().map(|p| p.1).sum();
    if parts.is_empty() || !mass.is_finite() {
        return None;
    }
    let (mut along, mut filled) = ([0.5; 3], [false; 3]);
    for a in 0..3 {
        let share = |p: &[f64; 3]| domain.along(p, a) / domain.length[a];
        if !domain.periodic[a] {
            along[a] = parts.iter().map(|(p, m)| m * share(p)).sum::<f64>() / mass;
            continue;
        }
        let (sine, cosine) = parts.iter().fold((0.0, 0.0), |(s, c), (p, m)| {
            let (sine, cosine) = libm::sincos(TAU * share(p));
            (s + m * sine, c + m * cosine)
        });
        filled[a] = libm::hypot(sine, cosine) < LEAST_PHASE * mass;
        if !filled[a] {
            along[a] = libm::atan2(sine, cosine) / TAU;
        }
    }
    // The mean phase is a start; steps lead to where the shortest ways of all mass cancel.
    let mut center = domain.turned(along);
    for _ in 0..STEPS {
        let mut step = [0.0; 3];
        for (p, m) in &parts {
            let d = domain.shortest_way(each_axis(|k| p[k] - center[k]));
            (0..3).for_each(|k| step[k] += m * d[k] / mass);
        }
        // Along an edge that mass fills, the ways cancel anywhere: the place stays.
        let free = each_axis(|a| if filled[a] { 0.0 } else { domain.along(&step, a) / domain.length[a] });
        let step = domain.turned(free);
        center = each_axis(|k| center[k] + step[k]);
        if norm(step) <= SETTLED * domain.shortest() {
            break;
        }
    }
    Some(MassCenter { place: domain.in_box(domain.world(center)), filled })
}

/// The centre of the mass about a place, found by steps from there: each to the mean of the mass in a sphere of a
/// radius with a soft edge, a normal weight with as much spread as the sphere has. `None` where they lead away further
/// than twice the radius.
pub fn mass_center_near(domain: &Domain, model: &Model, place: [f64; 3], radius: f64) -> Option<[f64; 3]> {
    let square = 0.2 * radius * radius;
    let window = Sym3::scaled_identity(square);
    let mut parts: Vec<([f64; 3], Sym3, f64)> = Vec::new();
    for (unit, mixture) in super::subject::mixtures(model) {
        for i in 0..mixture.len() {
            // A Gaussian times the window is a Gaussian: its mass and mean follow from the sum of covariances.
            let spread = mixture.cov_of(i).add(&window);
            let (inverse, det) = (spread.inverse()?, spread.det());
            parts.push((domain.local(mixture.mean_of(i)), inverse, unit * mixture.mass_of(i) / det.sqrt()));
        }
    }
    let from = domain.local(place);
    let mut center = from;
    for _ in 0..STEPS {
        let (mut mass, mut step) = (0.0, [0.0; 3]);
        for (p, inverse, weight) in &parts {
            let d = domain.shortest_way(each_axis(|k| p[k] - center[k]));
            let pull = inverse.apply(d);
            let window_mass = weight * libm::exp(-0.5 * dot(d, pull));
            mass += window_mass;
            (0..3).for_each(|k| step[k] += window_mass * square * pull[k]);
        }
        if !(mass > 0.0 && mass.is_finite()) {
            return None;
        }
        let step = step.map(|v| v / mass);
        center = domain.local(domain.world(each_axis(|k| center[k] + step[k])));
        if norm(domain.shortest_way(each_axis(|k| center[k] - from[k]))) > REACH * radius {
            return None;
        }
        if norm(step) <= SETTLED * radius {
            break;
        }
    }
    Some(domain.in_box(domain.world(center)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_particles::testing::model_of;

    fn near(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|k| (a[k] - b[k]).abs() < 1e-3)
    }

    #[test]
    fn mass_across_a_face_has_its_centre_there() {
        let domain = Domain::upright([0.0; 3], [10.0; 3], [true, true, false]);
        let small = Sym3::scaled_identity(0.01);
        let clump = |x: f64, mass: f64| ([x, 5.0, 2.0], small, mass);
        let model = model_of(&[clump(9.0, 3.0), clump(0.5, 3.0), clump(9.9, 2.0)], [10.0; 3]);
        let center = mass_center(&domain, &model, &[], None).unwrap().unwrap();
        // (3 (-1) + 3 (0.5) + 2 (-0.1)) / 8 = -0.2125
        assert!(near(center.place, [9.7875, 5.0, 2.0]) && center.filled == [false; 3], "{center:?}");
        let region = Bounds { min: [8.0, 0.0, 0.0], max: [10.0; 3] };
        let of_region = mass_center(&domain, &model, &[], Some(&region)).unwrap().unwrap();
        assert!(near(of_region.place, [9.36, 5.0, 2.0]), "{of_region:?}");
        let nothing = Bounds { min: [2.0; 3], max: [3.0; 3] };
        assert_eq!(mass_center(&domain, &model, &[], Some(&nothing)).unwrap(), None);
    }

    #[test]
    fn mass_that_fills_the_box_has_no_centre_along_it() {
        let domain = Domain::upright([-5.0; 3], [10.0; 3], [true; 3]);
        let row = (0..20).map(|i| ([-5.0 + 0.5 * f64::from(i), 1.0, -2.0], Sym3::scaled_identity(0.1), 4.0));
        let center = mass_center(&domain, &model_of(&row.collect::<Vec<_>>(), [10.0; 3]), &[], None).unwrap().unwrap();
        assert!(near(center.place, [0.0, 1.0, -2.0]) && center.filled == [true, false, false], "{center:?}");
    }

    #[test]
    fn steps_lead_to_the_clump_nearby_and_not_to_a_heavier_one() {
        let domain = Domain::upright([0.0; 3], [20.0; 3], [true; 3]);
        let halo = |x: f64, mass: f64| ([x, 10.0, 10.0], Sym3::scaled_identity(0.09), mass);
        let background = ([10.0; 3], Sym3::scaled_identity(40.0), 500.0);
        let model = model_of(&[halo(0.2, 100.0), halo(6.0, 1000.0), background], [20.0; 3]);
        let center = mass_center_near(&domain, &model, [19.7, 10.3, 9.8], 1.0).unwrap();
        assert!((center[0] - 0.2).abs() < 0.02 && (center[1] - 10.0).abs() < 0.02, "{center:?}");
        let lone = model_of(&[halo(0.2, 100.0)], [20.0; 3]);
        assert_eq!(mass_center_near(&domain, &lone, [10.0; 3], 0.1), None);
    }
}
