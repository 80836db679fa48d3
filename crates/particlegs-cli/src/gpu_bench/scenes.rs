//! Scenes that are made of nothing but this program.

use particlegs::camera::{Camera, View, base_distance, spiral};
use particlegs::math::each_axis;
use particlegs::model::Mixture;
use particlegs::picture::Size;
use particlegs::render::bin::place;
use particlegs::render::lens::Lens;
use particlegs::render::project::slices::pieces;
use particlegs::render::raster::pyramid::levels;
use particlegs::space::Bounds;
use particlegs::{Result, codec, parallel};
use std::f64::consts::PI;

/// Models of the bundled sample, of 751 and of 668 Gaussians.
const SAMPLES: [&[u8]; 2] = [include_bytes!("../../assets/gpu-751.pgs"), include_bytes!("../../assets/gpu-668.pgs")];

/// A scene: a model of the sample, tiled.
pub struct Made {
    pub gaussians: Mixture,
    pub bounds: Bounds,
    pub particles: u64,
    pub radius: f64,
}

/// A sample's model, so many times along the axes, as if it were one snapshot.
pub fn tiled(sample: usize, tiles: [usize; 3]) -> Result<Made> {
    let model = codec::decode(SAMPLES[sample], "the sample")?;
    let m = &model.metadata;
    let side = m.cell.and_then(|c| c.lengths()).unwrap_or(m.bounds.extent());
    let mut gaussians = Mixture::default();
    for x in 0..tiles[0] {
        for y in 0..tiles[1] {
            for z in 0..tiles[2] {
                for own in model.blocks().map(|b| &b.gaussians) {
                    for i in 0..own.len() {
                        let (at, tile) = (own.mean_of(i), [x, y, z]);
                        let mean = each_axis(|k| at[k] + tile[k] as f64 * side[k]);
                        gaussians.push(mean, own.cov_of(i), own.count[i], own.count[i]);
                    }
                }
            }
        }
    }
    let max = each_axis(|k| m.bounds.max[k] + (tiles[k] - 1) as f64 * side[k]);
    let bounds = Bounds { min: m.bounds.min, max };
    let particles = m.count * tiles.iter().product::<usize>() as u64;
    Ok(Made { gaussians, bounds, particles, radius: bounds.default_radius(particles) })
}

/// Views from the far orbit: around it, or from one place with other radii and opacities.
pub fn views(made: &Made, size: Size, around: bool) -> Vec<View> {
    let cameras: Vec<Camera> = spiral(made.bounds.center(), base_distance(&made.bounds, size), 64, None);
    let view = |(i, camera): (usize, &Camera)| {
        let change = if around { 1.0 } else { 0.5 + i as f64 / 64.0 };
        let camera = if around { *camera } else { cameras[16] };
        View { name: "far".into(), camera, radius: made.radius * change, opacity: 0.05 * change }
    };
    cameras.iter().enumerate().map(view).collect()
}

/// What a picture is made of.
pub struct Work {
    /// Footprints that touch it: Gaussians, or their pieces.
    pub footprints: u64,
    /// Pixels that they add to, on whatever plane.
    pub additions: f64,
}

impl Work {
    /// Of a scene in a view, counted on the processor.
    ///
    /// # Errors
    /// [`particlegs::Error::Argument`] for a view out of range.
    pub fn of(made: &Made, view: &View, size: Size) -> Result<Work> {
        const RUN: usize = 4096;
        let (lens, levels, m) = (Lens::optical(view, size, &made.bounds)?, levels(size), &made.gaussians);
        let runs = parallel::map((0..m.len()).step_by(RUN), |start| {
            let mut own = Work { footprints: 0, additions: 0.0 };
            for g in (start..m.len().min(start + RUN)).filter_map(|i| lens.see(m, i, m.count[i])) {
                pieces(&lens, &g, |moments| {
                    let Some(placed) = place(&levels, &g.footprint(&lens, &moments)) else { return };
                    let s = placed.stroke;
                    own.footprints += 1;
                    own.additions += PI * f64::from(-s.end) / (f64::from(s.along) * f64::from(s.down)).sqrt();
                });
            }
            own
        });
        let sum =
            |a: Work, b: Work| Work { footprints: a.footprints + b.footprints, additions: a.additions + b.additions };
        Ok(runs.into_iter().fold(Work { footprints: 0, additions: 0.0 }, sum))
    }
}
