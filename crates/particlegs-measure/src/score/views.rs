//! Seeded views: the three orbits, each spiral turned by a rotation of its own, so that training,
//! held-out, evaluation and certificate views share no pose (docs/law/cameras.md, docs/law/scores.md).

use particlegs_core::camera::{Camera, ORBITS, View, base_distance, clipping_range, spiral};
use particlegs_core::math::{Purpose, Random};
use particlegs_core::model::{Metadata, OrbitMetrics, ViewMetrics};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};
use std::f64::consts::PI;

/// Picture size of certificates.
pub(super) const SIZE: Size = Size { width: 1920, height: 1080 };
/// Radius and opacity of the published views, in default radii and as such: lowest and highest.
const RADIUS_RANGE: [f64; 2] = [0.25, 1.75];
const OPACITY_RANGE: [f64; 2] = [0.0125, 0.0875];
/// Distance of a view from close up, in base distances: most of the particles are beside the camera or behind it.
const CLOSE: f64 = 0.15;

/// Seeds of the turns and of the sampled radii and opacities, one pair a role.
const EVALUATION: [Purpose; 2] = [Purpose::EvaluationTurn, Purpose::EvaluationLook];
const HELD_OUT: [Purpose; 2] = [Purpose::HeldOutTurn, Purpose::HeldOutLook];

/// The views that models are scored on, for pictures of `size`: `frames` an orbit, named after it (`far_00`),
/// radius in [0.25, 1.75] of the model's default and opacity in [0.0125, 0.0875], each Beta(3, 3). Same seed,
/// same views.
pub fn evaluation_views(model: &Metadata, size: Size, seed: u64, frames: usize) -> Vec<View> {
    sampled(model, size, seed, frames, EVALUATION)
}

/// The views that choose between models while one is made; none of them is an evaluation view.
pub fn held_out_views(model: &Metadata, size: Size, seed: u64, frames: usize) -> Vec<View> {
    sampled(model, size, seed, frames, HELD_OUT)
}

/// The certificate's: one an orbit, at the default radius and opacity.
pub fn certificate_views(model: &Metadata, size: Size, seed: u64) -> Vec<View> {
    orbits(model, size, 1, |orbit| Random::from_purpose(Purpose::CertificateTurn, seed, orbit), |_| default_look(model))
}

/// Pixels that a particle may cover in a certificate's picture, and all of them together whatever the number.
const COVERED: f64 = 2e3;
/// The same for all particles together.
const COVERED_BY_ALL: f64 = 3e8;

/// Refuses to measure pictures of particles so large that each covers much of a picture: it would take hours.
pub fn check_radius(m: &Metadata, seed: u64) -> Result<()> {
    let size = SIZE;
    // A splat ends at three radii.
    let covered = |view: &View| (9.0 * PI * view.radius_pixels(size).powi(2)).min(size.pixels() as f64);
    let most = certificate_views(m, size, seed).iter().map(covered).fold(0.0, f64::max);
    if most * m.count as f64 <= COVERED_BY_ALL.max(COVERED * m.count as f64) {
        return Ok(());
    }
    let message = format!(
        "at a particle radius of {}, each of {} particles would cover {most:.0} pixels of the certificate's pictures",
        m.default_radius, m.count
    );
    Err(Error::input_with(&m.source, message, "use a smaller radius, or no certificate"))
}

/// The certificate's from close up: three, as near as the reference pictures' `inside`.
pub fn close_views(model: &Metadata, size: Size, seed: u64) -> Vec<View> {
    let turn = Some(Random::from_purpose(Purpose::CertificateTurn, seed, ORBITS.len() as u64).bits());
    let distance = CLOSE * base_distance(&model.bounds, size);
    let cameras = spiral(model.bounds.center(), distance, ORBITS.len(), turn);
    let view = |(i, camera): (usize, Camera)| {
        let clipping_range = Some(clipping_range(&model.bounds, &camera));
        let (radius, opacity) = default_look(model);
        View { name: format!("close_{i:02}"), camera: Camera { clipping_range, ..camera }, radius, opacity }
    };
    cameras.into_iter().enumerate().map(view).collect()
}

fn default_look(model: &Metadata) -> (f64, f64) {
    (model.default_radius, model.default_opacity)
}

/// The orbit that a view is of by its name, which begins with it and `_`; else `other`.
pub fn orbit_of(view: &View) -> &'static str {
    let prefix = view.name.split('_').next().unwrap_or("");
    ORBITS.iter().find(|o| o.name == prefix).map_or("other", |o| o.name)
}

/// Size, seed and scores of a certificate's pictures.
pub(super) fn view_metrics(seed: u64, orbits: [OrbitMetrics; 3]) -> ViewMetrics {
    ViewMetrics { width: SIZE.width as u16, height: SIZE.height as u16, seed, orbits }
}

fn sampled(model: &Metadata, size: Size, seed: u64, frames: usize, [turn, look]: [Purpose; 2]) -> Vec<View> {
    let within = |range: [f64; 2], share: f64| range[0] + (range[1] - range[0]) * share;
    let turn = |orbit| Random::from_purpose(turn, seed, orbit);
    orbits(model, size, frames, turn, |number| {
        let mut random = Random::from_purpose(look, seed, number);
        let radius = model.default_radius * within(RADIUS_RANGE, random.beta33());
        (radius, within(OPACITY_RANGE, random.beta33()))
    })
}

/// `frames` views of each orbit, which `turn` turns; `look` gives radius and opacity of the view of that number.
fn orbits(
    model: &Metadata,
    size: Size,
    frames: usize,
    turn: impl Fn(u64) -> Random,
    look: impl Fn(u64) -> (f64, f64),
) -> Vec<View> {
    let (bounds, base) = (&model.bounds, base_distance(&model.bounds, size));
    let mut views = Vec::with_capacity(ORBITS.len() * frames);
    for (k, orbit) in ORBITS.iter().enumerate() {
        let turned = Some(turn(k as u64).bits());
        for (i, mut camera) in spiral(bounds.center(), base * orbit.factor, frames, turned).into_iter().enumerate() {
            camera.clipping_range = Some(clipping_range(bounds, &camera));
            let (radius, opacity) = look((k * frames + i) as u64);
            views.push(View { name: format!("{}_{i:02}", orbit.name), camera, radius, opacity });
        }
    }
    views
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_particles::testing::model_of;

    #[test]
    fn roles_share_no_pose_and_seeds_repeat() {
        let m = Metadata { default_radius: 0.016, ..model_of(&[], [50.0; 3]).metadata };
        let evaluation = |seed| evaluation_views(&m, SIZE, seed, 8);
        let close = close_views(&m, SIZE, 42);
        let sets = [evaluation(42), held_out_views(&m, SIZE, 42, 8), certificate_views(&m, SIZE, 42), close];
        for v in sets.iter().flatten() {
            v.check(SIZE).unwrap();
            assert!((0.25..=1.75).contains(&(v.radius / 0.016)));
            assert!((0.0125..=0.0875).contains(&v.opacity));
        }
        assert_eq!(sets.each_ref().map(Vec::len), [24, 24, 3, 3]);
        let mut poses: Vec<[u64; 3]> = sets.iter().flatten().map(|v| v.camera.position.map(f64::to_bits)).collect();
        poses.sort_unstable();
        poses.dedup();
        assert_eq!(poses.len(), 54);
        assert_eq!(sets[0], evaluation(42));
        assert_ne!(sets[0], evaluation(43));
        assert_eq!((sets[0][0].name.as_str(), sets[0][23].name.as_str()), ("far_00", "near_07"));
    }

    #[test]
    fn radii_that_would_take_hours_are_refused() {
        let m = |count, default_radius| Metadata { count, default_radius, ..model_of(&[], [50.0; 3]).metadata };
        assert!(
            [m(1 << 21, 0.016), m(1 << 21, 0.2), m(3000, 1.0), m(100, 1e9)].iter().all(|m| check_radius(m, 42).is_ok())
        );
        assert!([m(1 << 21, 10.0), m(3000, 1e9)].iter().all(|m| check_radius(m, 42).is_err()));
    }

    #[test]
    fn views_name_their_orbits() {
        let mut view = certificate_views(&model_of(&[], [50.0; 3]).metadata, SIZE, 42).remove(0);
        for (name, orbit) in [("near_02", "near"), ("large_radius", "other"), ("farther", "other")] {
            view.name = name.into();
            assert_eq!(orbit_of(&view), orbit);
        }
    }
}
