//! Reference pictures: all particles in views from three orbits, drawn once and cached.

use crate::lab::{Lab, Style, or_made};
use crate::snapshot::Snapshot;
use particlegs_core::Result;
use particlegs_core::camera::{View, clipping_range};
use particlegs_core::model::{Metadata, Model};
use particlegs_core::picture::{Gray8, Scores, Size};
use particlegs_core::space::Bounds;
use particlegs_files::png::{read_png, write_png};
use particlegs_measure::score::evaluation_views;
use particlegs_particles::Particles;
use serde::{Deserialize, Serialize};

/// Views, each with ParaView's picture of all particles.
pub struct ReferenceViews {
    /// The views, with the clipping range of the particles.
    pub views: Vec<View>,
    pub size: Size,
    pub bounds: Bounds,
    /// One picture per view.
    pub pictures: Vec<Gray8>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    pub view: String,
    /// dB over all pixels; `None` if none differs.
    pub psnr: Option<f64>,
    /// dB over lit pixels; `None` if none differs.
    pub masked: Option<f64>,
    pub ssim: Option<f64>,
}

impl ReferenceViews {
    /// The views that models are scored on: `frames` per orbit, radius and opacity drawn from the published ranges
    /// (paper, section 5.1).
    pub fn new(lab: &Lab<'_>, snapshot: &Snapshot, metadata: &Metadata) -> Result<ReferenceViews> {
        let s = &lab.settings;
        ReferenceViews::in_views(lab, snapshot, evaluation_views(metadata, s.size, s.seed, s.frames))
    }

    pub fn in_views(lab: &Lab<'_>, snapshot: &Snapshot, views: Vec<View>) -> Result<ReferenceViews> {
        ReferenceViews::at_size(lab, snapshot, views, lab.settings.size)
    }

    pub fn at_size(lab: &Lab<'_>, snapshot: &Snapshot, mut views: Vec<View>, size: Size) -> Result<ReferenceViews> {
        let bounds = snapshot.particles.bounds();
        for view in &mut views {
            // Set here, so that decoded particles and models are clipped exactly as the truth is.
            let range = clipping_range(&bounds, &view.camera);
            view.camera.clipping_range.get_or_insert(range);
        }
        let mut draw = None;
        let picture = |view: &View| {
            let inputs = ("truth", &snapshot.hash, cache_key(view, size));
            kept_picture(lab, &inputs, || {
                or_made(&mut draw, || lab.draws_particles(&snapshot.particles, bounds, Style::Paraview))?(view, size)
            })
        };
        let pictures = views.iter().map(picture).collect::<Result<_>>()?;
        Ok(ReferenceViews { bounds, views, size, pictures })
    }

    /// Cache key of scores in these views.
    pub fn key(&self) -> String {
        let views: String = self.views.iter().map(|v| cache_key(v, self.size)).collect();
        blake3::hash(views.as_bytes()).to_hex()[..16].to_string()
    }

    /// Scores the picture that `draw` returns for each view.
    pub fn score(&self, mut draw: impl FnMut(&View) -> Result<Gray8>) -> Result<Vec<Score>> {
        let score_of = |(view, truth): (&View, &Gray8)| {
            let Scores { psnr, masked_psnr: masked, ssim } = Scores::new(&draw(view)?, truth);
            Ok(Score { view: view.name.clone(), psnr, masked, ssim })
        };
        self.views.iter().zip(&self.pictures).map(score_of).collect()
    }

    /// Scores other particles, drawn with a multiple of the radius.
    pub fn score_particles(&self, lab: &Lab<'_>, particles: &Particles, radius_factor: f64) -> Result<Vec<Score>> {
        let draw = lab.draws_particles(particles, self.bounds, Style::Paraview)?;
        self.score(|view| draw(&View { radius: view.radius * radius_factor, ..view.clone() }, self.size))
    }

    pub fn score_model(&self, lab: &Lab<'_>, model: &Model) -> Result<Vec<Score>> {
        let draw = lab.draws_model(model)?;
        self.score(|view| draw(view, self.size))
    }
}

pub fn cache_key(view: &View, size: Size) -> String {
    format!("{view:?} {size:?}")
}

/// A cached picture; drawn if it is missing.
pub fn kept_picture(lab: &Lab<'_>, inputs: &impl Serialize, draw: impl FnOnce() -> Result<Gray8>) -> Result<Gray8> {
    let path = lab.on_device.path("picture", inputs, "png");
    if path.exists() {
        return read_png(&path);
    }
    let picture = draw()?;
    write_png(&path, picture.size, &picture.data)?;
    Ok(picture)
}

/// The orbit of a view, by its name.
pub fn orbit(view: &str) -> &str {
    view.split('_').next().unwrap_or(view)
}

/// Decibels of a picture that equals the truth.
pub const IDENTICAL: f64 = f64::INFINITY;

pub fn masked(s: &Score) -> Option<f64> {
    Some(s.masked.unwrap_or(IDENTICAL))
}

pub fn psnr(s: &Score) -> Option<f64> {
    Some(s.psnr.unwrap_or(IDENTICAL))
}

pub fn ssim(s: &Score) -> Option<f64> {
    s.ssim
}

/// [`mean_of_values`] over views; orbits have equal numbers of views. `None` if a view has no value.
pub fn mean(scores: &[Score], pick: fn(&Score) -> Option<f64>) -> Option<f64> {
    mean_of_values(&scores.iter().map(pick).collect::<Option<Vec<f64>>>()?)
}

/// The mean over the views of one orbit.
pub fn mean_of(scores: &[Score], orbit_name: &str, pick: fn(&Score) -> Option<f64>) -> Option<f64> {
    let orbit_scores: Vec<Score> = scores.iter().filter(|s| orbit(&s.view) == orbit_name).cloned().collect();
    mean(&orbit_scores, pick)
}

/// Mean of the finite values, [`IDENTICAL`] if none is finite, `None` without values: one identical picture must not
/// make the mean infinite.
pub fn mean_of_values(values: &[f64]) -> Option<f64> {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    match (values.len(), finite.len()) {
        (0, _) => None,
        (_, 0) => Some(IDENTICAL),
        (_, n) => Some(finite.iter().sum::<f64>() / n as f64),
    }
}

/// Note on pictures that equal the truth in all lit pixels, if there are any.
pub fn identical_note<'a>(all: impl IntoIterator<Item = (String, &'a [Score])>) -> Option<String> {
    let mut counts: Vec<(String, usize, usize)> = Vec::new();
    for (name, scores) in all {
        let same = scores.iter().filter(|s| s.masked.is_none()).count();
        match counts.last_mut().filter(|last| last.0 == name) {
            Some((_, sum, total)) => (*sum, *total) = (*sum + same, *total + scores.len()),
            None => counts.push((name, same, scores.len())),
        }
    }
    let some = counts.into_iter().filter(|(_, same, _)| *same > 0);
    let said: Vec<String> = some.map(|(name, same, total)| format!("{name} ({same} of {total})")).collect();
    (!said.is_empty()).then(|| {
        format!(
            "In pictures of {}, no lit pixel differs from the truth, so they have no decibels. Means are over the \
             other pictures; if there are none, tables show `identical`, and plots show a point at their top edge.",
            said.join("; ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(view: &str, masked: Option<f64>) -> Score {
        Score { view: view.into(), psnr: masked, masked, ssim: None }
    }

    /// A picture that is the truth does not drop out silently, and does not hide what the others score.
    #[test]
    fn identical_pictures_are_noted_and_left_out_of_means() {
        let some = [score("far_00", Some(40.0)), score("far_01", None), score("near_00", Some(44.0))];
        let all = [score("far_00", None), score("near_00", None)];
        assert_eq!((mean(&some, masked), mean(&all, masked)), (Some(42.0), Some(IDENTICAL)));
        assert_eq!((mean_of(&some, "near", psnr), mean_of(&some, "mid", psnr)), (Some(44.0), None));
        // What has no structural similarity has none, identical or not.
        assert_eq!(mean(&all, ssim), None);
        // Seeds of one thing are told together.
        let named = [("a", &some[..]), ("a", &some[..1]), ("b", &some[..1]), ("c", &all[..])];
        let note = identical_note(named.map(|(name, scores)| (name.to_string(), scores))).unwrap();
        assert!(note.contains("pictures of a (1 of 4); c (2 of 2), "), "{note}");
        assert_eq!(identical_note([("b".into(), &some[..1])]), None);
    }
}
