//! The numbers of an evaluation, in the form that `--json` writes.

use particlegs_core::picture::Scores;
use serde::{Serialize, Serializer};

/// The model's scores in one look, and what stands beside them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LookScores {
    /// The model's picture.
    #[serde(flatten)]
    pub model: Scores,
    /// The noise-free picture of all particles in this look.
    pub noise_free: Scores,
    /// An empty picture.
    pub all_black: Scores,
    /// The noise-free picture of as many particles spread evenly over the box (docs/law/depth.md).
    pub uniform_box: Scores,
    /// The scaled random subset of the same bytes, where a certificate has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subset: Option<Scores>,
    /// Noise-free minus model; `None` where either has no value.
    #[serde(serialize_with = "decibels_alone")]
    pub gap: Scores,
    /// In a mean: views without a masked PSNR, which it leaves out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<usize>,
    /// Against `paraview-no-fxaa` alone: masked PSNR of a perfect smooth model, dB, an estimate; `None` within
    /// where nothing is lit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shot_noise: Option<Option<f64>>,
}

/// The gap of one picture's scores to another's.
pub(super) fn gap(noise_free: Scores, model: Scores) -> Scores {
    let difference = |pick: fn(&Scores) -> Option<f64>| Some(pick(&noise_free)? - pick(&model)?);
    Scores { psnr: difference(|s| s.psnr), masked_psnr: difference(|s| s.masked_psnr), ssim: difference(|s| s.ssim) }
}

/// A gap is written without its SSIM.
fn decibels_alone<S: Serializer>(gap: &Scores, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map([("psnr", gap.psnr), ("masked_psnr", gap.masked_psnr)])
}

/// The mean of the values there are, in order; `None` where there is none.
pub(super) fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (sum, count) = values.flatten().fold((0.0, 0u32), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn mean_scores(all: impl Iterator<Item = Scores> + Clone) -> Scores {
    Scores {
        psnr: mean(all.clone().map(|s| s.psnr)),
        masked_psnr: mean(all.clone().map(|s| s.masked_psnr)),
        ssim: mean(all.map(|s| s.ssim)),
    }
}

impl LookScores {
    fn mean<'a>(all: impl Iterator<Item = &'a LookScores> + Clone) -> Self {
        let mean_of = |pick: fn(&LookScores) -> Scores| mean_scores(all.clone().map(pick));
        LookScores {
            model: mean_of(|s| s.model),
            noise_free: mean_of(|s| s.noise_free),
            all_black: mean_of(|s| s.all_black),
            uniform_box: mean_of(|s| s.uniform_box),
            subset: all.clone().any(|s| s.subset.is_some()).then(|| mean_scores(all.clone().filter_map(|s| s.subset))),
            gap: mean_of(|s| s.gap),
            left_out: Some(all.clone().filter(|s| s.model.masked_psnr.is_none()).count()),
            shot_noise: all.clone().any(|s| s.shot_noise.is_some()).then(|| mean(all.filter_map(|s| s.shot_noise))),
        }
    }
}

/// One view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewScores {
    /// The view's name.
    pub name: String,
    /// The view's orbit: `far`, `mid`, `near` or `other`.
    pub orbit: &'static str,
    /// Particle radius, world units.
    pub radius: f64,
    /// Opacity.
    pub opacity: f64,
    /// Against `paraview`.
    pub paraview: LookScores,
    /// Against `paraview-no-fxaa`.
    pub paraview_no_fxaa: LookScores,
    /// Against `expected`, whose noise-free picture is itself (no value).
    pub expected: LookScores,
}

/// Means over views: of the decibels, never the decibels of the mean error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanViewScores {
    /// Number of views.
    pub views: usize,
    /// Against `paraview`.
    pub paraview: LookScores,
    /// Against `paraview-no-fxaa`.
    pub paraview_no_fxaa: LookScores,
    /// Against `expected`.
    pub expected: LookScores,
}

impl MeanViewScores {
    fn from_views<'a>(views: impl Iterator<Item = &'a ViewScores> + Clone) -> Self {
        MeanViewScores {
            views: views.clone().count(),
            paraview: LookScores::mean(views.clone().map(|v| &v.paraview)),
            paraview_no_fxaa: LookScores::mean(views.clone().map(|v| &v.paraview_no_fxaa)),
            expected: LookScores::mean(views.map(|v| &v.expected)),
        }
    }
}

/// A model's scores over views.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Every view, in the order given.
    pub views: Vec<ViewScores>,
    /// Means by orbit, in the order of the published ones, `other` last; an orbit without views is left out.
    #[serde(serialize_with = "by_name")]
    pub by_orbit: Vec<(&'static str, MeanViewScores)>,
    /// Mean over all views.
    pub mean: MeanViewScores,
}

fn by_name<S: Serializer>(all: &[(&'static str, MeanViewScores)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(all.iter().copied())
}

impl Evaluation {
    pub(super) fn from_views(views: Vec<ViewScores>) -> Self {
        let of_orbit = |orbit| {
            let orbit_views = views.iter().filter(move |v| v.orbit == orbit);
            orbit_views.clone().next().map(|_| (orbit, MeanViewScores::from_views(orbit_views)))
        };
        let by_orbit = ["far", "mid", "near", "other"].into_iter().filter_map(of_orbit).collect();
        let mean = MeanViewScores::from_views(views.iter());
        Evaluation { views, by_orbit, mean }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(masked: Option<f64>) -> LookScores {
        let floor = |v| Scores { psnr: v, masked_psnr: v, ssim: v };
        let model = Scores { psnr: masked, masked_psnr: masked, ssim: Some(0.5) };
        LookScores {
            model,
            noise_free: floor(Some(40.0)),
            all_black: floor(Some(10.0)),
            uniform_box: floor(Some(12.0)),
            subset: None,
            gap: gap(floor(Some(40.0)), model),
            left_out: None,
            shot_noise: None,
        }
    }

    fn view(orbit: &'static str, masked: Option<f64>) -> ViewScores {
        ViewScores {
            name: format!("{orbit}_00"),
            orbit,
            radius: 0.1,
            opacity: 0.05,
            paraview: look(masked),
            paraview_no_fxaa: LookScores { shot_noise: Some(Some(30.0)), ..look(masked) },
            expected: look(masked),
        }
    }

    #[test]
    fn means_are_of_decibels_and_count_what_they_leave_out() {
        let e = Evaluation::from_views(vec![view("far", Some(30.0)), view("far", Some(32.0)), view("near", None)]);
        let [(_, far), (_, near)] = e.by_orbit[..] else { panic!("{e:?}") };
        assert_eq!((far.paraview.model.masked_psnr, far.paraview.gap.masked_psnr), (Some(31.0), Some(9.0)));
        assert_eq!((far.paraview.shot_noise, far.paraview_no_fxaa.shot_noise), (None, Some(Some(30.0))));
        let near = near.paraview;
        assert_eq!((near.model.masked_psnr, near.left_out, near.noise_free.psnr), (None, Some(1), Some(40.0)));
        assert_eq!(
            (e.mean.views, e.mean.expected.model.masked_psnr, e.mean.expected.left_out),
            (3, Some(31.0), Some(1))
        );
        assert_eq!(e.by_orbit.iter().map(|o| o.0).collect::<Vec<_>>(), ["far", "near"]);
    }

    #[test]
    fn json_has_the_agreed_keys() {
        let e =
            serde_json::to_value(Evaluation::from_views(vec![view("far", Some(30.0)), view("near", None)])).unwrap();
        for place in [&e["views"][0], &e["by_orbit"]["far"], &e["mean"]] {
            for style in ["paraview", "paraview_no_fxaa", "expected"] {
                let s = &place[style];
                assert!(s["psnr"].is_number() && s["masked_psnr"].is_number() && s["ssim"].is_number());
                assert!(s["noise_free"]["masked_psnr"].is_number() && s["all_black"]["psnr"].is_number());
                assert!(s["uniform_box"]["masked_psnr"].is_number());
                assert_eq!(s.get("shot_noise").is_some(), style == "paraview_no_fxaa");
            }
        }
        assert!(e["views"][1]["paraview"]["psnr"].is_null());
        assert_eq!((e["views"][0]["name"].as_str(), e["views"][0]["orbit"].as_str()), (Some("far_00"), Some("far")));
        assert!(e["by_orbit"].get("mid").is_none());
    }
}
