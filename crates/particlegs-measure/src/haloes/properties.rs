//! Properties of a halo's particles beside the masses of its spheres.

use super::sphere::{HaloShape, RadialParticles, concentration, dispersion_of, mean_of};
use crate::stats::ParticleFields;

/// A column that is measured of particles within R200m.
pub struct HaloProperty {
    pub name: &'static str,
    pub description: &'static str,
    pub kind: HaloPropertyKind,
    /// Particles within R200m that it takes.
    pub least: usize,
}

/// The unit of a property.
#[derive(Clone, Copy, PartialEq)]
pub enum HaloPropertyKind {
    /// That of velocities.
    Velocity,
    /// km/s, of masses and radii: needs their units.
    Circular,
    /// The unit of length, where circular velocities are known.
    Length,
    Number,
}

const fn property(name: &'static str, kind: HaloPropertyKind, least: usize, description: &'static str) -> HaloProperty {
    HaloProperty { name, description, kind, least }
}

/// All of them.
pub const PROPERTIES: [HaloProperty; 12] = [
    property("vx", HaloPropertyKind::Velocity, 100, "mean velocity within R200m, along x"),
    property("vy", HaloPropertyKind::Velocity, 100, "mean velocity within R200m, along y"),
    property("vz", HaloPropertyKind::Velocity, 100, "mean velocity within R200m, along z"),
    property("vrms", HaloPropertyKind::Velocity, 300, "velocity dispersion in three dimensions within R200m"),
    property("b_to_a", HaloPropertyKind::Number, 300, "ratio of the second to the longest axis (Allgood et al. 2006)"),
    property("c_to_a", HaloPropertyKind::Number, 300, "ratio of the shortest to the longest axis"),
    property("a_x", HaloPropertyKind::Number, 300, "direction of the longest axis, along x"),
    property("a_y", HaloPropertyKind::Number, 300, "direction of the longest axis, along y"),
    property("a_z", HaloPropertyKind::Number, 300, "direction of the longest axis, along z"),
    property("vmax", HaloPropertyKind::Circular, 300, "largest circular velocity outside three softening lengths"),
    property("rvmax", HaloPropertyKind::Length, 300, "radius of the largest circular velocity"),
    property(
        "c200c",
        HaloPropertyKind::Number,
        1000,
        "concentration of the likeliest NFW profile, R200c / scale radius",
    ),
];

/// A value for each of [`PROPERTIES`]; NaN where there is none. Circular velocities are the largest mass over radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereProperties(pub [f64; PROPERTIES.len()]);

impl SphereProperties {
    /// Of particles about a centre: circular velocities and profiles from the radius `inner` on, all up to `outer`,
    /// R200m; `critical` = R200c. Those properties are measured for which `count` particles are enough.
    pub fn new(
        particles: &RadialParticles,
        velocities: Option<&ParticleFields>,
        [inner, outer]: [f64; 2],
        critical: Option<f64>,
        count: usize,
    ) -> Self {
        let inside = &particles.particles[..particles.count_within(outer)];
        let enough = |i: usize| count >= PROPERTIES[i].least;
        let mut all = [f64::NAN; PROPERTIES.len()];
        if let Some(v) = velocities.filter(|_| enough(0)) {
            let velocity_of = |i: u32| v.of(i as usize);
            let mean = mean_of(inside, velocity_of);
            all[..3].copy_from_slice(&mean);
            if enough(3) {
                all[3] = dispersion_of(inside, mean, velocity_of);
            }
        }
        if let Some(shape) = enough(4).then(|| HaloShape::new(inside, outer)).flatten() {
            all[4..6].copy_from_slice(&[shape.b_to_a, shape.c_to_a]);
            all[6..9].copy_from_slice(&shape.axis);
        }
        if let Some(steepest) = enough(9).then(|| particles.steepest(inner, outer)).flatten() {
            all[9..11].copy_from_slice(&steepest);
        }
        if let Some(radius) = critical.filter(|_| enough(11)) {
            all[11] = concentration(particles, inner, radius).unwrap_or(f64::NAN);
        }
        SphereProperties(all)
    }

    /// Standard errors from values that each lack one part of the particles, times `scale`.
    pub fn jackknife<const N: usize>(parts: &[SphereProperties; N], scale: f64) -> Self {
        let n = N as f64;
        let error = |k: usize| {
            let mean = parts.iter().map(|p| p.0[k]).sum::<f64>() / n;
            let square = parts.iter().map(|p| (p.0[k] - mean) * (p.0[k] - mean)).sum::<f64>();
            scale * ((n - 1.0) / n * square).sqrt()
        };
        SphereProperties(std::array::from_fn(error))
    }
}
