//! Helpers that tests of kernels share.

use crate::{AdapterChoice, Checks, Device};
use particlegs_core::camera::{Camera, View};
use particlegs_core::math::{Random, Sym3};
use particlegs_core::picture::{Plane, Size};
use particlegs_particles::{Column, Particles, Positions};
use std::sync::Arc;

/// The first adapter, with all checks on.
pub fn device() -> Arc<Device> {
    Arc::new(Device::open(AdapterChoice::Number(0), Checks::On).unwrap_or_else(|e| panic!("{e}")))
}

/// A view of the origin from a place.
pub fn view(position: [f64; 3], [radius, opacity]: [f64; 2]) -> View {
    View { name: "v".into(), camera: Camera::looking_at([0.0; 3], position), radius, opacity }
}

/// A Gaussian about the middle of a cube of side 2: round, flat or long, every seventh without extent.
pub fn gaussian(r: &mut Random, i: u64, spread: f64) -> ([f64; 3], Sym3) {
    let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
    let base = spread * (0.1 + r.uniform());
    let mut cov = Sym3::default();
    for s in [base, base * r.uniform(), base * r.uniform() * r.uniform()] {
        let v = [0; 3].map(|_| r.normal());
        cov = cov.add(&Sym3::outer(v.map(|x| x * s / 1.7)));
    }
    (mean, if i.is_multiple_of(7) { Sym3::default() } else { cov })
}

/// A picture of something else, with some noise.
pub fn target(size: Size) -> Plane {
    let mut r = Random::new(77, 1, 0);
    let data = (0..size.pixels()).map(|p| {
        let (x, y) = (p % size.width, p / size.width);
        let smooth = 0.3 + 0.2 * (x as f64 / 11.0).sin() * (y as f64 / 7.0).cos();
        (smooth + 0.05 * r.normal()).clamp(0.0, 1.0) as f32
    });
    Plane { size, data: data.collect() }
}

/// Particles in forty clumps.
pub fn clumps() -> Particles {
    let column = |k: u32| -> Vec<f32> {
        let at = |i: u64| {
            let (mut particle_random, mut clump_random) = (Random::new(5, k, i), Random::new(6, k, i % 40));
            (clump_random.uniform() + 0.03 * particle_random.normal()).clamp(0.0, 1.0) as f32
        };
        (0..20_000).map(at).collect()
    };
    Particles::from_columns(column(1), column(2), column(3))
}

/// Particles in a cube of side 2: half evenly spread, half in a clump.
pub fn columns(n: usize) -> [Vec<f32>; 3] {
    let mut r = Random::new(5, 1, 0);
    let mut all = [vec![], vec![], vec![]];
    for i in 0..n {
        for column in &mut all {
            let v = if i % 2 == 0 { 2.0 * r.uniform() - 1.0 } else { 0.1 * r.normal() };
            column.push(v as f32);
        }
    }
    all
}

/// Those in columns, about the middle.
pub fn particles(columns: &[Vec<f32>; 3]) -> Particles {
    let meta = Particles::from_columns(vec![], vec![], vec![]).meta;
    Particles::new(Positions::Columns(columns.clone().map(Column::owned)), [0.0; 3], meta)
}
