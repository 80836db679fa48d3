//! ParaView's pictures of all particles against particlegs' own.

use super::*;
use crate::tests::device;
use particlegs::particles::{Column, Particles, Positions};
use particlegs::progress::Silent;
use particlegs::reference;
use particlegs_core::camera::{Camera, Projection, clipping_range};
use particlegs_core::math::Random;
use particlegs_core::splat::Look;

const SIZE: Size = Size { width: 320, height: 180 };

/// Particles in a cube of side 2: half evenly spread, half in a clump.
fn columns(n: usize) -> [Vec<f32>; 3] {
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

fn view(position: [f64; 3], radius: f64, opacity: f64) -> View {
    let camera = Camera {
        position,
        focal_point: [0.0; 3],
        view_up: [0.0, 1.0, 0.0],
        projection: Projection::Perspective { fov_deg: 30.0 },
        clipping_range: None,
    };
    View { name: "v".into(), camera, radius, opacity }
}

fn particles(columns: &[Vec<f32>; 3]) -> Particles {
    let meta = Particles::from_columns(vec![], vec![], vec![]).meta;
    Particles::new(Positions::Columns(columns.clone().map(Column::owned)), [0.0; 3], meta)
}

fn points(device: &Device, columns: &[Vec<f32>; 3], pieces: usize) -> Vec<Points> {
    let n = columns[0].len();
    let each = n.div_ceil(pieces);
    let piece = |k: usize| columns.each_ref().map(|c| &c[k * each..n.min((k + 1) * each)]);
    (0..pieces).map(|k| Points::upload(device, piece(k)).unwrap()).collect()
}

const FAR: [f64; 3] = [1.0, 2.0, 6.0];
const NEAR: [f64; 3] = [0.3, 0.2, 0.9];

#[test]
fn kernels_agree_with_their_twins() {
    let Some(device) = device() else { return };
    let there = Paraview::new(&device).unwrap();
    let columns = columns(4000);
    let particles = particles(&columns);
    let own = reference::Reference::new(&particles);
    let canvas = there.canvas(SIZE).unwrap();
    let pieces = points(&device, &columns, 1);
    for (position, radius, opacity) in [
        (FAR, 0.002, 0.05),
        (FAR, 0.02, 0.05),
        (FAR, 0.02, 1.0),
        (FAR, 0.1, 0.3),
        (FAR, 0.1, 0.005),
        (NEAR, 0.01, 0.05),
        (NEAR, 0.05, 0.2),
    ] {
        let view = view(position, radius, opacity);
        let range = clipping_range(own.bounds(), &view.camera);
        for (fxaa, look) in [(false, Look::ParaviewNoFxaa), (true, Look::Paraview)] {
            let a = there.shot(&canvas, &view, [0.0; 3], range).unwrap().draw(&pieces, fxaa).unwrap();
            let b = own.draw(&view, SIZE, look, &Silent).unwrap();
            let apart: Vec<u8> = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).collect();
            let lit = b.data.iter().filter(|v| **v > 0).count();
            let (worst, differ) = (apart.iter().max().unwrap(), apart.iter().filter(|d| **d > 0).count());
            println!("{position:?} r {radius} a {opacity} {}: {differ} of {lit} differ, worst {worst}", look.name());
            assert!(*worst == 0, "{position:?} radius {radius} opacity {opacity}: largest {worst}, {differ}");
        }
    }
}
