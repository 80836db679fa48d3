//! The pictures of a run: the published spirals on several orbits, cameras inside the bounds, and
//! radius and opacity drawn for each (docs/law/cameras.md).

use super::config::{Cameras, Config};
use particlegs_core::camera::{Camera, View, base_distance, spiral};
use particlegs_core::math::{Purpose, Random, each_axis};
use particlegs_core::picture::Size;
use particlegs_core::space::Bounds;

/// With the seed and the orbit's number, the seed of its turn.
const TURN: u64 = 0x7472_6169_6e00;

/// Internal cameras stand within this share of the bounds about their centre.
const INSIDE: f64 = 0.98;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Defaults {
    pub bounds: Bounds,
    /// Radius, world units.
    pub radius: f64,
    pub opacity: f64,
    pub seed: u64,
    /// Bytes that the coded Gaussians are to have, where known.
    pub bytes: Option<u64>,
    /// Gaussians at most where the configuration does not say; `None` = any number.
    pub gaussians: Option<u64>,
}

pub(crate) struct Views {
    /// On the orbits, for training.
    pub training: Vec<View>,
    /// Inside the bounds, for training.
    pub internal: Vec<View>,
    /// On the orbits, held out.
    pub held_out: Vec<View>,
}

impl Views {
    /// As many as `cameras` says on the orbits, shuffled, the first of them held out; as many again
    /// inside where `internal`.
    pub fn new(cameras: &Cameras, defaults: &Defaults, internal: bool) -> Views {
        // A fixed shape, so that all stages see the same cameras.
        let wide = Size { width: 16, height: 9 };
        let base = base_distance(&defaults.bounds, wide);
        let center = defaults.bounds.center();
        let orbits = cameras.orbits.len() as u64;
        let mut poses: Vec<Camera> = Vec::new();
        for (k, factor) in (0u64..).zip(&cameras.orbits) {
            let frames = (cameras.frames / orbits + u64::from(k < cameras.frames % orbits)) as usize;
            poses.extend(spiral(center, factor * base, frames, Some(defaults.seed ^ TURN ^ k)));
        }
        // Without a shuffle, the held-out views would all be on the first orbit.
        let mut draw = Random::from_purpose(Purpose::TrainingShuffle, defaults.seed, 0);
        for i in (1..poses.len()).rev() {
            poses.swap(i, (draw.uniform() * (i + 1) as f64) as usize);
        }
        let view = |i: usize, camera: Camera| sampled(cameras, defaults, i as u64, camera);
        let orbit: Vec<View> = poses.into_iter().enumerate().map(|(i, c)| view(i, c)).collect();
        // At least one view is for the score and one for training.
        let held = ((orbit.len() as f64 * cameras.held_out).ceil() as usize).clamp(1, orbit.len() - 1);
        let internal = if internal { cameras.frames as usize } else { 0 };
        Views {
            training: orbit[held..].to_vec(),
            internal: (0..internal).map(|i| view(orbit.len() + i, inside(defaults, i as u64))).collect(),
            held_out: orbit[..held].to_vec(),
        }
    }
}

impl Config {
    /// The views that a run of this configuration is scored on while it trains: on the orbits, held out.
    pub fn held_out_views(&self, defaults: &Defaults) -> Vec<View> {
        let mut views = Views::new(&self.cameras, defaults, false).held_out;
        views.truncate(self.evaluate_views as usize);
        views
    }
}

/// A camera inside the bounds that looks at their centre.
fn inside(defaults: &Defaults, index: u64) -> Camera {
    let mut draw = Random::from_purpose(Purpose::TrainingInside, defaults.seed, index);
    let (center, extent) = (defaults.bounds.center(), defaults.bounds.extent());
    let position = each_axis(|k| center[k] + INSIDE * (draw.uniform() - 0.5) * extent[k]);
    Camera::looking_at(center, position)
}

/// A view with radius and opacity drawn for it.
fn sampled(cameras: &Cameras, defaults: &Defaults, index: u64, camera: Camera) -> View {
    let mut draw = Random::from_purpose(Purpose::TrainingDraw, defaults.seed, index);
    let mut between = |[low, high]: [f64; 2]| low + (high - low) * draw.beta33();
    let (radius, opacity) = (between(cameras.radius), between(cameras.opacity));
    let radius = if draw.uniform() < cameras.wide {
        cameras.radius[1] * (cameras.wide_radius / cameras.radius[1]).powf(draw.uniform())
    } else {
        radius
    };
    View {
        name: format!("training {index}"),
        camera,
        radius: radius * defaults.radius,
        opacity: (opacity * defaults.opacity).min(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, Preset};
    use particlegs_core::model::LawKind;

    #[test]
    fn views_are_as_many_as_asked_for_and_share_no_pose() {
        let bounds = Bounds { min: [0.0; 3], max: [1.0, 2.0, 3.0] };
        let defaults = Defaults { bounds, radius: 0.01, opacity: 0.05, seed: 3, bytes: None, gaussians: None };
        let cameras = Config::preset(Preset::Paper, LawKind::AlphaBlend).cameras;
        let views = Views::new(&cameras, &defaults, true);
        assert_eq!((views.training.len(), views.held_out.len(), views.internal.len()), (320, 80, 400));
        for v in views.training.iter().chain(&views.internal).chain(&views.held_out) {
            v.check(Size { width: 64, height: 36 }).unwrap();
            assert!((0.0025..=0.0175).contains(&v.radius) && (0.0125..=0.0875).contains(&v.opacity));
        }
        let config = Config { evaluate_views: 5, ..Config::preset(Preset::Paper, LawKind::AlphaBlend) };
        assert_eq!(config.held_out_views(&defaults), views.held_out[..5]);
        let held = &views.held_out[0].camera.position;
        assert!(views.training.iter().all(|v| v.camera.position != *held));
    }

    #[test]
    fn draws_follow_the_seed_and_stay_where_they_are_to() {
        let bounds = Bounds { min: [-1.0, 2.0, 3.0], max: [1.0, 4.0, 4.0] };
        let defaults = Defaults { bounds, radius: 0.01, opacity: 0.05, seed: 3, bytes: None, gaussians: None };
        let plain = Config::preset(Preset::Fast, LawKind::OpticalDepth).cameras;
        let cameras = Cameras { frames: 2000, wide: 0.25, wide_radius: 7.0, ..plain };
        let [a, b] = [0, 0].map(|_| Views::new(&cameras, &defaults, true));
        assert_eq!(a.training, b.training);
        let other = Views::new(&cameras, &Defaults { seed: 4, ..defaults }, true);
        assert_ne!(a.training, other.training);
        for v in &a.internal {
            let inside = (0..3).all(|k| (bounds.min[k]..=bounds.max[k]).contains(&v.camera.position[k]));
            assert!(inside && v.camera.focal_point == bounds.center(), "{v:?}");
        }
        let wide = a.training.iter().filter(|v| v.radius > 1.75 * defaults.radius).count() as f64;
        assert!((wide / a.training.len() as f64 - 0.25).abs() < 0.04, "{wide}");
        assert!(a.training.iter().all(|v| v.radius <= 7.0 * defaults.radius + 1e-12));
        // Beta(3, 3) has the mean in the middle.
        let mean = a.training.iter().map(|v| v.opacity).sum::<f64>() / a.training.len() as f64;
        assert!((mean / defaults.opacity - 1.0).abs() < 0.05, "{mean}");
        assert!(Views::new(&cameras, &defaults, false).internal.is_empty());
    }

    #[test]
    fn two_pictures_are_one_to_train_and_one_to_test() {
        let bounds = Bounds { min: [0.0; 3], max: [1.0; 3] };
        let defaults = Defaults { bounds, radius: 0.01, opacity: 0.9, seed: 1, bytes: None, gaussians: None };
        let plain = Config::preset(Preset::Fast, LawKind::OpticalDepth).cameras;
        for held_out in [0.0, 0.99] {
            let views = Views::new(&Cameras { frames: 2, held_out, ..plain.clone() }, &defaults, false);
            assert_eq!((views.training.len(), views.held_out.len()), (1, 1));
            views.training[0].check(Size { width: 64, height: 36 }).unwrap();
            views.held_out[0].check(Size { width: 64, height: 36 }).unwrap();
        }
    }
}
