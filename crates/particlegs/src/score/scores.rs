//! The numbers of an evaluation, in the form that `--json` writes.

use super::mean;
use crate::picture::{Gray8, Scores};
use serde::Serialize;

/// The score of a picture that is not the model's: what stands beside the model's own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Floor {
    /// dB over all pixels; `None` where identical.
    pub psnr: Option<f64>,
    /// dB over lit pixels; `None` where identical or none is lit.
    pub masked_psnr: Option<f64>,
    /// Structural similarity.
    pub ssim: Option<f64>,
}

impl Floor {
    pub(super) fn of(picture: &Gray8, target: &Gray8) -> Self {
        let s = Scores::of(picture, target);
        Floor { psnr: s.psnr, masked_psnr: s.masked_psnr, ssim: s.ssim }
    }

    fn mean<'a>(all: impl Iterator<Item = &'a Floor> + Clone) -> Self {
        Floor {
            psnr: mean(all.clone().map(|f| f.psnr)),
            masked_psnr: mean(all.clone().map(|f| f.masked_psnr)),
            ssim: mean(all.map(|f| f.ssim)),
        }
    }
}

/// Noise-free score minus the model's, dB; `None` where either has no value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Over all pixels.
    pub psnr: Option<f64>,
    /// Over lit pixels.
    pub masked_psnr: Option<f64>,
}

impl Gap {
    pub(super) fn between(noise_free: &Floor, model: &Scores) -> Self {
        let difference = |a: Option<f64>, b: Option<f64>| Some(a? - b?);
        Gap {
            psnr: difference(noise_free.psnr, model.psnr),
            masked_psnr: difference(noise_free.masked_psnr, model.masked_psnr),
        }
    }
}

/// The model's scores in one look, and what stands beside them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LookScores {
    /// dB over all pixels; `None` where identical.
    pub psnr: Option<f64>,
    /// dB over lit pixels; `None` where identical or none is lit.
    pub masked_psnr: Option<f64>,
    /// Structural similarity; `None` for pictures smaller than its window.
    pub ssim: Option<f64>,
    /// The noise-free picture of all particles in this look.
    pub noise_free: Floor,
    /// An empty picture.
    pub all_black: Floor,
    /// The noise-free picture of as many particles spread evenly over the box
    /// ([`crate::reference::uniform_box`]).
    pub uniform_box: Floor,
    /// Noise-free minus model.
    pub gap: Gap,
    /// In a mean: views without a masked PSNR, which it leaves out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<usize>,
}

impl LookScores {
    fn mean<'a>(all: impl Iterator<Item = &'a LookScores> + Clone) -> Self {
        LookScores {
            psnr: mean(all.clone().map(|s| s.psnr)),
            masked_psnr: mean(all.clone().map(|s| s.masked_psnr)),
            ssim: mean(all.clone().map(|s| s.ssim)),
            noise_free: Floor::mean(all.clone().map(|s| &s.noise_free)),
            all_black: Floor::mean(all.clone().map(|s| &s.all_black)),
            uniform_box: Floor::mean(all.clone().map(|s| &s.uniform_box)),
            gap: Gap {
                psnr: mean(all.clone().map(|s| s.gap.psnr)),
                masked_psnr: mean(all.clone().map(|s| s.gap.masked_psnr)),
            },
            left_out: Some(all.filter(|s| s.masked_psnr.is_none()).count()),
        }
    }
}

/// [`LookScores`] against `paraview-no-fxaa`, with the shot-noise floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoFxaaScores {
    /// The scores.
    #[serde(flatten)]
    pub scores: LookScores,
    /// Masked PSNR of a perfect smooth model, dB; an estimate.
    pub shot_noise: Option<f64>,
}

/// One view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewScores {
    /// The view's name.
    pub name: String,
    /// Its orbit.
    pub orbit: String,
    /// Particle radius, world units.
    pub radius: f64,
    /// Opacity.
    pub opacity: f64,
    /// Against `paraview`.
    pub paraview: LookScores,
    /// Against `paraview-no-fxaa`.
    pub paraview_no_fxaa: NoFxaaScores,
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
    pub paraview_no_fxaa: NoFxaaScores,
    /// Against `expected`.
    pub expected: LookScores,
}

impl MeanViewScores {
    fn of(views: &[&ViewScores]) -> Self {
        MeanViewScores {
            views: views.len(),
            paraview: LookScores::mean(views.iter().map(|v| &v.paraview)),
            paraview_no_fxaa: NoFxaaScores {
                scores: LookScores::mean(views.iter().map(|v| &v.paraview_no_fxaa.scores)),
                shot_noise: mean(views.iter().map(|v| v.paraview_no_fxaa.shot_noise)),
            },
            expected: LookScores::mean(views.iter().map(|v| &v.expected)),
        }
    }
}

/// Means by orbit, in the order of the published ones; an orbit without views is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ByOrbit {
    /// The base distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub far: Option<MeanViewScores>,
    /// 0.7 of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mid: Option<MeanViewScores>,
    /// Half of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near: Option<MeanViewScores>,
    /// Views of no orbit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other: Option<MeanViewScores>,
}

impl ByOrbit {
    /// The orbits that have views, with their names.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &MeanViewScores)> {
        [("far", &self.far), ("mid", &self.mid), ("near", &self.near), ("other", &self.other)]
            .into_iter()
            .filter_map(|(name, m)| Some((name, m.as_ref()?)))
    }
}

/// A model's scores over views.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Every view, in the order given.
    pub views: Vec<ViewScores>,
    /// Means by orbit.
    pub by_orbit: ByOrbit,
    /// Mean over all views.
    pub mean: MeanViewScores,
}

impl Evaluation {
    pub(super) fn of(views: Vec<ViewScores>) -> Self {
        let of_orbit = |orbit: &str| {
            let own: Vec<&ViewScores> = views.iter().filter(|v| v.orbit == orbit).collect();
            (!own.is_empty()).then(|| MeanViewScores::of(&own))
        };
        let by_orbit =
            ByOrbit { far: of_orbit("far"), mid: of_orbit("mid"), near: of_orbit("near"), other: of_orbit("other") };
        let mean = MeanViewScores::of(&views.iter().collect::<Vec<_>>());
        Evaluation { views, by_orbit, mean }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(masked: Option<f64>) -> LookScores {
        let floor = |v| Floor { psnr: v, masked_psnr: v, ssim: v };
        let scores = Scores { psnr: masked, masked_psnr: masked, ssim: Some(0.5) };
        LookScores {
            psnr: masked,
            masked_psnr: masked,
            ssim: Some(0.5),
            noise_free: floor(Some(40.0)),
            all_black: floor(Some(10.0)),
            uniform_box: floor(Some(12.0)),
            gap: Gap::between(&floor(Some(40.0)), &scores),
            left_out: None,
        }
    }

    fn view(orbit: &str, masked: Option<f64>) -> ViewScores {
        ViewScores {
            name: format!("{orbit}_00"),
            orbit: orbit.into(),
            radius: 0.1,
            opacity: 0.05,
            paraview: look(masked),
            paraview_no_fxaa: NoFxaaScores { scores: look(masked), shot_noise: Some(30.0) },
            expected: look(masked),
        }
    }

    #[test]
    fn means_are_of_decibels_and_count_what_they_leave_out() {
        let e = Evaluation::of(vec![view("far", Some(30.0)), view("far", Some(32.0)), view("near", None)]);
        assert_eq!(e.by_orbit.far.unwrap().paraview.masked_psnr, Some(31.0));
        assert_eq!(e.by_orbit.far.unwrap().paraview.gap.masked_psnr, Some(9.0));
        let near = e.by_orbit.near.unwrap().paraview;
        assert_eq!((near.masked_psnr, near.left_out, near.noise_free.psnr), (None, Some(1), Some(40.0)));
        assert_eq!((e.mean.views, e.mean.expected.masked_psnr, e.mean.expected.left_out), (3, Some(31.0), Some(1)));
        assert_eq!(e.by_orbit.iter().map(|o| o.0).collect::<Vec<_>>(), ["far", "near"]);
    }

    #[test]
    fn json_has_the_agreed_keys() {
        let e = serde_json::to_value(Evaluation::of(vec![view("far", Some(30.0)), view("near", None)])).unwrap();
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
