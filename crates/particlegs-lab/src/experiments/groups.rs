//! Groups of views: the published spirals at one distance, with radius and opacity given or drawn from the published
//! range.
//!
//! All groups have the same directions, and the same draws of radius and opacity: they differ only in the distance or
//! the factor.

use crate::lab::{Lab, ModelBuild, Style};
use crate::snapshot::Snapshot;
use crate::views::{ReferenceViews, Score, cache_key, mean_of_values};
pub(super) use crate::views::{masked, psnr, ssim};
use particlegs_core::Result;
use particlegs_core::camera::{View, base_distance, spiral};
use particlegs_core::math::{Purpose, Random};
use particlegs_core::model::Metadata;
use particlegs_core::picture::Size;

/// Smallest and largest factor of the default radius and opacity in training and scoring (paper, section IV-A).
pub(super) const RANGE: [f64; 2] = [0.25, 1.75];
/// The trained orbits, far to near.
pub(super) const TRAINED: [f64; 3] = [1.0, 0.7, 0.5];

#[derive(Clone, Debug, PartialEq)]
pub(super) struct ViewGroup {
    /// Prefix of the names of its views.
    pub name: String,
    /// Distance, in base distances.
    orbit: f64,
    /// Factors of the default radius and opacity; `None` = drawn in [`RANGE`], Beta(3, 3).
    factors: Option<[f64; 2]>,
}

impl ViewGroup {
    /// At a distance, with radius and opacity drawn.
    pub fn orbit(orbit: f64) -> ViewGroup {
        ViewGroup { name: format!("orbit-{orbit}"), orbit, factors: None }
    }

    /// At the mid orbit, with a factor of the default radius.
    pub fn radius(factor: f64) -> ViewGroup {
        ViewGroup { name: format!("radius-{factor}"), orbit: TRAINED[1], factors: Some([factor, 1.0]) }
    }

    /// At the mid orbit, with a factor of the default opacity.
    pub fn opacity(factor: f64) -> ViewGroup {
        ViewGroup { name: format!("opacity-{factor}"), orbit: TRAINED[1], factors: Some([1.0, factor]) }
    }
}

pub(super) fn in_range() -> Vec<ViewGroup> {
    TRAINED.map(ViewGroup::orbit).to_vec()
}

/// `frames` views of each group around a snapshot, named after the group (`orbit-0.7_00`). They depend only on the
/// seed.
pub(super) fn views(groups: &[ViewGroup], metadata: &Metadata, seed: u64, frames: usize) -> Vec<View> {
    let base = base_distance(&metadata.bounds, Size { width: 16, height: 9 });
    let turn = Random::from_purpose(Purpose::EvaluationTurn, seed, 0).bits();
    let in_group = |group: &ViewGroup| {
        let cameras = spiral(metadata.bounds.center(), group.orbit * base, frames, Some(turn));
        let view = |(i, camera)| {
            let mut draw = Random::from_purpose(Purpose::EvaluationLook, seed, i as u64);
            let mut drawn = || RANGE[0] + (RANGE[1] - RANGE[0]) * draw.beta33();
            let [radius, opacity] = group.factors.unwrap_or_else(|| [drawn(), drawn()]);
            View {
                name: format!("{}_{i:02}", group.name),
                camera,
                radius: radius * metadata.default_radius,
                opacity: (opacity * metadata.default_opacity).min(1.0),
            }
        };
        cameras.into_iter().enumerate().map(view).collect::<Vec<_>>()
    };
    groups.iter().flat_map(in_group).collect()
}

/// Scores of a model in the views of `truth`, cached.
pub(super) fn scores(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    truth: &ReferenceViews,
    build: &ModelBuild,
) -> Result<Vec<Score>> {
    let model = blake3::hash(&build.bytes).to_hex().to_string();
    lab.on_device.result("scores", &(&snapshot.hash, model, all_told(truth)), || truth.score_model(lab, &build.model))
}

/// Scores of the noise-free picture of all particles, which no model is expected to exceed, cached.
pub(super) fn noise_free(lab: &Lab<'_>, snapshot: &Snapshot, truth: &ReferenceViews) -> Result<Vec<Score>> {
    lab.on_device.result("scores", &(&snapshot.hash, "noise-free", all_told(truth)), || {
        let draw = lab.draws_particles(&snapshot.particles, truth.bounds, Style::NoiseFree)?;
        truth.score(|view| draw(view, truth.size))
    })
}

fn all_told(truth: &ReferenceViews) -> Vec<String> {
    truth.views.iter().map(|view| cache_key(view, truth.size)).collect()
}

/// Mean over groups of each group's mean over views.
pub(super) fn mean_over(scores: &[Score], groups: &[ViewGroup], pick: fn(&Score) -> Option<f64>) -> Option<f64> {
    let group_mean = |g: &ViewGroup| crate::views::mean_of(scores, &g.name, pick);
    let values: Option<Vec<f64>> = groups.iter().map(group_mean).collect();
    mean_of_values(&values?)
}

/// [`mean_over`] for several models; missing values are left out.
pub(super) fn means_over(all: &[Vec<Score>], groups: &[ViewGroup], pick: fn(&Score) -> Option<f64>) -> Vec<f64> {
    all.iter().filter_map(|scores| mean_over(scores, groups, pick)).collect()
}

pub(super) fn in_pixels(size: Size) -> String {
    format!("{} x {}", size.width, size.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_compress::{Options, Target, compress};
    use particlegs_core::checkpoint::NoCheckpoints;
    use particlegs_core::context::Context;
    use particlegs_core::model::CertificateLevel;
    use particlegs_particles::Particles;

    fn metadata() -> Metadata {
        let column = |k: u32| (0..500u32).map(|i| (i * (k + 7) % 97) as f32).collect::<Vec<f32>>();
        let particles = Particles::from_columns(column(1), column(2), column(3));
        let certificate = CertificateLevel::None;
        let options = Options { target: Target::Gaussians(5), certificate, ..Options::default() };
        compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT).unwrap().model.metadata
    }

    #[test]
    fn groups_differ_only_in_their_parameter() {
        let m = metadata();
        let (far, near) = (ViewGroup::orbit(1.3), ViewGroup::orbit(0.5));
        let all = views(&[far, near, ViewGroup::radius(2.0), ViewGroup::opacity(0.5)], &m, 42, 3);
        assert_eq!(all.len(), 12);
        let names: Vec<&str> = [0, 3, 6, 9].map(|i| all[i].name.as_str()).to_vec();
        assert_eq!(names, ["orbit-1.3_00", "orbit-0.5_00", "radius-2_00", "opacity-0.5_00"]);
        for i in 0..3 {
            let (far, near) = (&all[i], &all[i + 3]);
            assert_eq!((far.radius, far.opacity), (near.radius, near.opacity));
            assert!((far.camera.distance() / near.camera.distance() - 2.6).abs() < 1e-9);
            let toward = |v: &View| {
                let (c, d) = (&v.camera, v.camera.distance());
                [0, 1, 2].map(|k| (c.position[k] - c.focal_point[k]) / d)
            };
            assert!((0..3).all(|k| (toward(far)[k] - toward(near)[k]).abs() < 1e-9));
            let factor = far.radius / m.default_radius;
            assert!((RANGE[0]..=RANGE[1]).contains(&factor), "{factor}");
            assert_eq!((all[i + 6].radius, all[i + 6].opacity), (2.0 * m.default_radius, m.default_opacity));
            assert_eq!((all[i + 9].radius, all[i + 9].opacity), (m.default_radius, 0.5 * m.default_opacity));
        }
        assert_ne!(all[0].radius, all[1].radius);
        assert_eq!(
            all,
            views(
                &[ViewGroup::orbit(1.3), ViewGroup::orbit(0.5), ViewGroup::radius(2.0), ViewGroup::opacity(0.5)],
                &m,
                42,
                3
            )
        );
    }

    #[test]
    fn groups_have_equal_weight_for_any_number_of_views() {
        let score = |view: &str, v: f64| Score { view: view.into(), psnr: Some(v), masked: None, ssim: None };
        let scores = [score("orbit-1_00", 10.0), score("orbit-1_01", 20.0), score("orbit-0.7_00", 35.0)];
        let same = crate::views::IDENTICAL;
        let two = [ViewGroup::orbit(1.0), ViewGroup::orbit(0.7)];
        assert_eq!(mean_over(&scores, &two, psnr), Some(25.0));
        assert_eq!((mean_over(&scores, &two, masked), mean_over(&scores, &two, ssim)), (Some(same), None));
        assert_eq!(mean_over(&scores, &[ViewGroup::orbit(0.5)], psnr), None);
    }
}
