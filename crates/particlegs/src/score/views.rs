//! Seeded views: the three orbits, each spiral turned by a rotation of its own, so that training,
//! held-out, evaluation and certificate views share no pose (docs/law/cameras.md, docs/law/scores.md).

use crate::camera::{ORBITS, View, ViewSet, base_distance, clipping_range, spiral};
use crate::math::{Purpose, Random};
use crate::picture::Size;
use crate::space::Bounds;

/// Radius and opacity of the published views, in default radii and as such: lowest and highest.
const RADIUS_RANGE: [f64; 2] = [0.25, 1.75];
const OPACITY_RANGE: [f64; 2] = [0.0125, 0.0875];

/// Seeds of the turns and of the sampled radii and opacities, one pair a role.
const EVALUATION: [Purpose; 2] = [Purpose::EvaluationTurn, Purpose::EvaluationLook];
const HELD_OUT: [Purpose; 2] = [Purpose::HeldOutTurn, Purpose::HeldOutLook];

/// What seeded views are made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewSeed<'a> {
    /// Bounds of the particles.
    pub bounds: &'a Bounds,
    /// Default radius, world units.
    pub default_radius: f64,
    /// Picture size; the base distance follows its aspect where it is taller than wide.
    pub size: Size,
    /// Same seed, same views.
    pub seed: u64,
}

/// A view and the orbit that it belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct EvalView {
    /// Camera, radius and opacity.
    pub view: View,
    /// `far`, `mid`, `near` or `other`.
    pub orbit: String,
}

/// The views that models are scored on: `frames` an orbit, radius in [0.25, 1.75] default radii
/// and opacity in [0.0125, 0.0875], each Beta(3, 3).
pub fn evaluation_views(of: &ViewSeed, frames: usize) -> Vec<EvalView> {
    sampled(of, frames, EVALUATION)
}

/// The views that choose between models while one is made; none of them is an evaluation view.
pub fn held_out_views(of: &ViewSeed, frames: usize) -> Vec<EvalView> {
    sampled(of, frames, HELD_OUT)
}

/// The certificate's: one an orbit, at the default radius and `opacity`.
pub fn certificate_views(of: &ViewSeed, opacity: f64) -> Vec<EvalView> {
    orbits(of, 1, Purpose::CertificateTurn, |_| (of.default_radius, opacity))
}

/// The views of a file; the orbit is the name's part before `_` where it is one of the three.
pub fn views_of_file(set: &ViewSet) -> Vec<EvalView> {
    set.views
        .iter()
        .map(|view| {
            let prefix = view.name.split('_').next().unwrap_or("");
            let orbit = ORBITS.iter().find(|o| o.name == prefix).map_or("other", |o| o.name);
            EvalView { view: view.clone(), orbit: orbit.to_string() }
        })
        .collect()
}

fn sampled(of: &ViewSeed, frames: usize, purpose: [Purpose; 2]) -> Vec<EvalView> {
    let within = |range: [f64; 2], share: f64| range[0] + (range[1] - range[0]) * share;
    orbits(of, frames, purpose[0], |number| {
        let mut random = Random::of(purpose[1], of.seed, number);
        let radius = of.default_radius * within(RADIUS_RANGE, random.beta33());
        (radius, within(OPACITY_RANGE, random.beta33()))
    })
}

/// `frames` views of each orbit; `look` gives radius and opacity of the view of that number.
fn orbits(of: &ViewSeed, frames: usize, purpose: Purpose, look: impl Fn(u64) -> (f64, f64)) -> Vec<EvalView> {
    let base = base_distance(of.bounds, of.size);
    let mut views = Vec::with_capacity(ORBITS.len() * frames);
    for (k, orbit) in ORBITS.iter().enumerate() {
        let turn = Random::of(purpose, of.seed, k as u64).bits();
        for (i, mut camera) in
            spiral(of.bounds.center(), base * orbit.factor, frames, Some(turn)).into_iter().enumerate()
        {
            camera.clipping_range = Some(clipping_range(of.bounds, &camera));
            let (radius, opacity) = look((k * frames + i) as u64);
            let view = View { name: format!("{}_{i:02}", orbit.name), camera, radius, opacity };
            views.push(EvalView { view, orbit: orbit.name.to_string() });
        }
    }
    views
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size { width: 1920, height: 1080 };

    #[test]
    fn roles_share_no_pose_and_seeds_repeat() {
        let bounds = Bounds { min: [0.0; 3], max: [50.0; 3] };
        let of = ViewSeed { bounds: &bounds, default_radius: 0.016, size: SIZE, seed: 42 };
        let sets = [evaluation_views(&of, 8), held_out_views(&of, 8), certificate_views(&of, 0.05)];
        for v in sets.iter().flatten() {
            v.view.check(SIZE).unwrap();
            assert!((0.25..=1.75).contains(&(v.view.radius / 0.016)));
            assert!((0.0125..=0.0875).contains(&v.view.opacity));
        }
        assert_eq!(sets.each_ref().map(Vec::len), [24, 24, 3]);
        let mut poses: Vec<[u64; 3]> =
            sets.iter().flatten().map(|v| v.view.camera.position.map(f64::to_bits)).collect();
        poses.sort_unstable();
        poses.dedup();
        assert_eq!(poses.len(), 51);
        assert_eq!(sets[0], evaluation_views(&of, 8));
        assert_ne!(sets[0], evaluation_views(&ViewSeed { seed: 43, ..of }, 8));
        assert_eq!((sets[0][0].view.name.as_str(), sets[0][23].view.name.as_str()), ("far_00", "near_07"));
    }

    #[test]
    fn files_name_their_orbits() {
        let bounds = Bounds { min: [0.0; 3], max: [50.0; 3] };
        let of = ViewSeed { bounds: &bounds, default_radius: 0.016, size: SIZE, seed: 42 };
        let mut view = certificate_views(&of, 0.05).remove(0).view;
        let orbit = |name: &str, view: &mut View| {
            view.name = name.into();
            views_of_file(&ViewSet { size: SIZE, views: vec![view.clone()] })[0].orbit.clone()
        };
        assert_eq!(orbit("near_02", &mut view), "near");
        assert_eq!(orbit("large_radius", &mut view), "other");
        assert_eq!(orbit("farther", &mut view), "other");
    }
}
