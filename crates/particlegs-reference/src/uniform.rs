//! The picture of particles spread evenly over a box: what any model must beat.

use particlegs_core::camera::{Projection, View, clipping_range};
use particlegs_core::math::each_axis;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::splat::opacity_integral;
use particlegs_core::{Result, parallel};
use particlegs_particles::Domain;

/// The noise-free optical depth of `count` particles spread evenly over a box, without fluctuations:
/// in each pixel their number density times the opacity integral of one of them, times the depth along
/// which the pixel's ray is inside. Splats widen towards the corners as everywhere; in perspective a
/// particle's size on the picture falls with depth as the pixel's cone grows, so no power of depth is
/// left. Views without a clipping range get that of the bounds.
pub fn uniform_box(domain: &Domain, count: f64, view: &View, size: Size) -> Result<Plane> {
    view.check(size)?;
    let frame = view.camera.frame()?;
    let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(&domain.bounds(), &view.camera));
    let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
    let scale = view.camera.focal_pixels(size).recip();
    // Extents one after the other, so that neither tiny nor huge boxes leave the range of f64.
    let tilt = domain.tilt.map_or(1.0, |t| t.volume());
    let spread = domain.length.iter().fold(count * opacity_integral(view.opacity) / tilt, |n, e| n / e);
    let weight = spread * view.radius * view.radius;
    let [right, up, back] = frame.axes;
    let half = [0.5 * size.width as f64 - 0.5, 0.5 * size.height as f64 - 0.5];
    let mut plane = Plane::zeros(size);
    parallel::for_each_chunk(&mut plane.data, size.width, |row, out| {
        let down = scale * (row as f64 - half[1]);
        for (column, out) in out.iter_mut().enumerate() {
            let across = scale * (column as f64 - half[0]);
            let aside: [f64; 3] = each_axis(|k| across * right[k] - down * up[k]);
            let forward = back.map(|v| -v);
            let (start, direction, growth) = if perspective {
                let growth = ((1.0 + across * across) * (1.0 + down * down)).sqrt();
                (frame.position, each_axis(|k| forward[k] + aside[k]), growth)
            } else {
                (each_axis(|k| frame.position[k] + aside[k]), forward, 1.0)
            };
            *out = (weight * growth * depth_inside(domain, start, direction, range)) as f32;
        }
    });
    Ok(plane)
}

/// The length of the depths in `range` that a ray has inside a box.
fn depth_inside(domain: &Domain, start: [f64; 3], direction: [f64; 3], range: [f64; 2]) -> f64 {
    let [mut near, mut far] = range;
    let along = |d: [f64; 3]| -> [f64; 3] { each_axis(|k| domain.along(&d, k)) };
    let (start, direction) = (along(each_axis(|k| start[k] - domain.min[k])), along(direction));
    for (k, length) in domain.length.into_iter().enumerate() {
        let (a, z) = (-start[k] / direction[k], (length - start[k]) / direction[k]);
        // A ray along the faces is between them everywhere or nowhere.
        if direction[k] == 0.0 {
            if start[k] < 0.0 || start[k] > length {
                return 0.0;
            }
            continue;
        }
        (near, far) = (near.max(a.min(z)), far.min(a.max(z)));
    }
    (far - near).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::{base_distance, spherical_camera};

    use crate::Reference;
    use particlegs_core::context::Context;
    use particlegs_core::space::Bounds;
    use particlegs_particles::testing::{gas, poisson, tilted_cells};

    /// Particles drawn evenly have this depth on average, in perspective and in parallel projection.
    #[test]
    fn the_uniform_box_is_the_mean_of_particles_drawn_evenly() {
        let particles = poisson(200_000, [4.0, 2.0, 3.0], 5);
        let bounds = Bounds { min: [0.0; 3], max: [4.0, 2.0, 3.0] };
        let size = Size { width: 96, height: 64 };
        let distance = 0.6 * base_distance(&bounds, size);
        let mut camera = spherical_camera(bounds.center(), 30.0, 20.0, distance);
        for parallel in [false, true] {
            if parallel {
                camera.projection = Projection::Orthographic { height_world: 4.0 };
            }
            let view = View { name: "v".into(), camera, radius: 0.03, opacity: 0.05 };
            let even = uniform_box(&Domain::new(&bounds, None), 200_000.0, &view, size).unwrap();
            let mut worst = 0.0f64;
            if parallel {
                // Every particle is in the picture: the sum over pixels is theirs.
                let pixels = view.radius_pixels(size).powi(2);
                let sum: f64 = even.data.iter().map(|&v| f64::from(v)).sum();
                worst = (sum / (200_000.0 * opacity_integral(0.05) * pixels) - 1.0).abs();
            } else {
                let drawn = Reference::new(&particles).optical_depth(&view, size, &Context::SILENT).unwrap();
                for (rows, from) in [(8, 12), (8, 28), (8, 44)] {
                    let sum = |p: &Plane| -> f64 {
                        (from..from + rows)
                            .flat_map(|r| (32..64).map(move |c| r * 96 + c))
                            .map(|i| f64::from(p.data[i]))
                            .sum()
                    };
                    worst = worst.max((sum(&drawn) / sum(&even) - 1.0).abs());
                }
            }
            assert!(worst < 0.03, "parallel {parallel}: off by {worst}");
        }
    }

    /// In a tilted cell every line of sight has the depth that its own even particles have.
    #[test]
    fn a_tilted_box_has_its_own_picture() {
        let cell = tilted_cells()[0];
        let particles = gas(100_000, &cell, 3);
        let domain = Domain::drawn(&particles.bounds(), Some(&cell));
        let size = Size { width: 48, height: 32 };
        let camera = spherical_camera(domain.bounds().center(), 30.0, 20.0, base_distance(&domain.bounds(), size));
        let view = View { name: "v".into(), camera, radius: 0.1, opacity: 0.05 };
        let even = uniform_box(&domain, 100_000.0, &view, size).unwrap();
        let drawn = Reference::new(&particles).optical_depth(&view, size, &Context::SILENT).unwrap();
        let difference: f64 = even.data.iter().zip(&drawn.data).map(|(a, b)| f64::from((a - b).abs())).sum();
        let all: f64 = even.data.iter().map(|v| f64::from(*v)).sum();
        assert!(difference < 0.1 * all, "{difference} of {all}");
    }
}
