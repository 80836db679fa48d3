//! Pictures at the radii and opacities that users take, and from close up, beside those that they are compared with.

use super::LookScores;
use super::evaluate::{ModelComparison, ViewProgress};
use super::scores::mean;
use super::views::{certificate_views, close_views};
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::{
    LookSummary, Metadata, PICTURE_OPACITIES, PICTURE_RADII, PICTURE_SETTINGS, PictureScore, PictureScores,
    PictureSetting, Pictures,
};
use particlegs_core::picture::{Scores, Size};
use particlegs_core::splat::ToneStyle;

/// Size of the pictures: a third of the certificate's, since large splats of millions of particles take their time.
const SIZE: Size = Size { width: 640, height: 360 };

/// One radius and opacity, in the model's own, from the orbits or from close up.
struct SceneSetting {
    radius: f64,
    opacity: f64,
    close: bool,
}

/// Radius by radius, opacity by opacity, then from close up.
fn settings() -> impl Iterator<Item = SceneSetting> {
    let orbits = PICTURE_RADII
        .into_iter()
        .flat_map(|radius| PICTURE_OPACITIES.map(|opacity| SceneSetting { radius, opacity, close: false }));
    orbits.chain([SceneSetting { radius: 1.0, opacity: 1.0, close: true }])
}

/// Scores the model of `comparison` at every setting.
pub(super) fn pictures(
    comparison: &ModelComparison<'_>,
    m: &Metadata,
    seed: u64,
    context: &Context<'_>,
) -> Result<Pictures> {
    let mut measurements = Vec::with_capacity(PICTURE_SETTINGS);
    for setting in settings() {
        measurements.push(setting.measure(comparison, m, seed, context)?);
    }
    let settings = std::array::from_fn(|i| measurements[i]);
    Ok(Pictures { width: SIZE.width as u16, height: SIZE.height as u16, settings })
}

impl SceneSetting {
    fn measure(
        &self,
        comparison: &ModelComparison<'_>,
        m: &Metadata,
        seed: u64,
        context: &Context<'_>,
    ) -> Result<PictureSetting> {
        let views = if self.close { close_views(m, SIZE, seed) } else { certificate_views(m, SIZE, seed) };
        let opacity = (self.opacity * m.default_opacity).min(1.0);
        let mut scores = [Vec::new(), Vec::new()];
        for view in views {
            let sink = ViewProgress { name: self.name(&view), inner: context.sink() };
            let context = context.with_sink(&sink);
            let view = View { radius: self.radius * m.default_radius, opacity, ..view };
            let view_pictures = comparison.draw(&view, SIZE, &context)?;
            context.begin("scores", 0);
            for (all, look) in scores.iter_mut().zip([ToneStyle::Paraview, ToneStyle::Expected]) {
                all.push(comparison.look(&view_pictures, look));
            }
            context.end();
        }
        let [paraview, expected] = scores.map(|s| over_views(&s));
        Ok(PictureSetting { radius: self.radius, opacity, close: self.close, paraview, expected })
    }

    /// The name of a view at this setting, which a user reads while waiting.
    fn name(&self, view: &View) -> String {
        format!("{} at {} default radii and {} default opacities:", view.name, self.radius, self.opacity)
    }
}

fn over_views(views: &[LookScores]) -> LookSummary {
    // A view without a value, identical or unlit, is not the worst one.
    let value = |s: &LookScores| s.model.masked_psnr.unwrap_or(f64::INFINITY);
    let worst = (0..views.len()).min_by(|&i, &j| value(&views[i]).total_cmp(&value(&views[j]))).unwrap_or(0);
    LookSummary { worst_view: worst as u8, mean: scores_of(views), worst: scores_of(&views[worst..=worst]) }
}

/// Means over some views.
pub(super) fn scores_of(views: &[LookScores]) -> PictureScores {
    let mean_score = |pick: fn(&LookScores) -> Scores| Some(score_of(views.iter().map(pick)));
    PictureScores {
        model: mean_score(|s| s.model),
        noise_free: mean_score(|s| s.noise_free),
        all_black: mean_score(|s| s.all_black),
        uniform_box: mean_score(|s| s.uniform_box),
        subset: views.iter().any(|s| s.subset.is_some()).then(|| score_of(views.iter().filter_map(|s| s.subset))),
    }
}

fn score_of(scores: impl Iterator<Item = Scores> + Clone) -> PictureScore {
    PictureScore {
        masked_psnr: mean(scores.clone().map(|s| s.masked_psnr)),
        ssim: mean(scores.map(|s| s.ssim)).unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(model: Option<f64>, subset: Option<f64>) -> LookScores {
        let scores_at = |v| Scores { psnr: v, masked_psnr: v, ssim: Some(0.5) };
        LookScores {
            model: scores_at(model),
            noise_free: scores_at(None),
            all_black: scores_at(Some(4.0)),
            uniform_box: scores_at(Some(11.0)),
            subset: subset.map(|v| scores_at(Some(v))),
            gap: scores_at(None),
            left_out: None,
            shot_noise: None,
        }
    }

    #[test]
    fn the_worst_view_stands_beside_the_mean() {
        let look = over_views(&[scores(Some(30.0), Some(24.0)), scores(Some(26.0), Some(25.0)), scores(None, None)]);
        assert_eq!((look.worst_view, look.worst.model.unwrap().masked_psnr), (1, Some(26.0)));
        assert_eq!(
            (look.mean.model.unwrap().masked_psnr, look.mean.noise_free.unwrap().masked_psnr),
            (Some(28.0), None)
        );
        assert_eq!(look.mean.subset.unwrap().masked_psnr, Some(24.5));
        assert_eq!((look.worst.subset.unwrap().masked_psnr, look.worst.uniform_box.unwrap().ssim), (Some(25.0), 0.5));
        assert_eq!(over_views(&[scores(None, None)]).worst.subset, None);
    }

    #[test]
    fn settings_are_all_pairs_and_close_up() {
        let all: Vec<_> = settings().map(|s| (s.radius, s.opacity, s.close)).collect();
        assert_eq!(all.len(), PICTURE_SETTINGS);
        assert_eq!((all[2], all[5], all[6]), ((1.0, 1.0, false), (6.0, 10.0, false), (1.0, 1.0, true)));
    }
}
