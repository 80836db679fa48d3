//! A model against its snapshot over views, in every look, with the floors and rivals beside each score.

use super::ViewTruth;
use super::scores::{Evaluation, LookScores, ViewScores, gap};
use super::subset::{RandomSubset, SubsetView};
use super::views::orbit_of;
use particlegs_core::camera::{View, clipping_range};
use particlegs_core::context::{Context, ProgressEvent, ProgressSink};
use particlegs_core::model::Model;
use particlegs_core::picture::{Gray8, Plane, Scores, Size, decibels, is_lit, ssim};
use particlegs_core::render::{Renderer, Scene};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use particlegs_particles::{Domain, Particles};
use particlegs_reference::{Reference, uniform_box};
use particlegs_train::Accelerator;

/// Scores `model` against `particles` in `views`, drawn at `size`. Views without a clipping range
/// get the particles' own, the same for the model and the truth. A view is of the orbit that its name begins
/// with (`far_00`). `device` draws model and particles; `None` = the CPU.
pub fn evaluate(
    model: &Model,
    particles: &Particles,
    views: &[View],
    size: Size,
    device: Option<&dyn Accelerator>,
    context: &Context<'_>,
) -> Result<Evaluation> {
    let (meta, to) = (&particles.meta, model.metadata.unit_system());
    if meta.unit_system().conversion_of(&meta.name, &to)?.0.length != 1.0 {
        return Err(Error::input(&meta.name, "its unit of length differs from the model's: convert it first"));
    }
    particles.check_files()?;
    let truth = Reference::new(particles);
    let mut comparison = ModelComparison::new(model, &truth, None);
    if let Some(device) = device {
        let scene = device.scene(&comparison.scene)?;
        comparison.on_device = Some([device.particles(truth.input(), context)?, scene]);
    }
    comparison.evaluate(views, size, context)
}

/// Says which view a phase belongs to.
pub(super) struct ViewProgress<'a> {
    pub name: String,
    pub inner: &'a dyn ProgressSink,
}

impl ProgressSink for ViewProgress<'_> {
    fn event(&self, event: ProgressEvent<'_>) {
        match event {
            ProgressEvent::Begin { phase, total } => {
                self.inner.event(ProgressEvent::Begin { phase: &format!("{} {phase}", self.name), total });
            }
            other => self.inner.event(other),
        }
    }

    fn message(&self, text: &str) {
        self.inner.message(text);
    }
}

/// The view with a clipping range, the bounds' where it has none.
pub(super) fn clipped(view: &View, bounds: &Bounds) -> View {
    let mut view = view.clone();
    let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(bounds, &view.camera));
    view.camera.clipping_range = Some(range);
    view
}

/// A model beside its snapshot.
pub(super) struct ModelComparison<'a> {
    scene: Scene<'a>,
    truth: &'a Reference<'a>,
    /// The particles spread evenly over this are what the least of models draws: the periodic box where they fill it,
    /// else their bounds.
    even: Domain,
    /// The particles' own rival, and whether it is drawn in all looks.
    subset: Option<(&'a RandomSubset, bool)>,
    /// Snapshot and model on a device that draws them; `None` = the CPU does.
    on_device: Option<[Box<dyn Renderer + 'a>; 2]>,
}

impl<'a> ModelComparison<'a> {
    /// A model beside the snapshot that `truth` draws; with a subset of its particles where that is to be scored, in
    /// all looks or in `expected` alone.
    pub fn new(model: &'a Model, truth: &'a Reference<'a>, subset: Option<(&'a RandomSubset, bool)>) -> Self {
        let even = Domain::drawn(truth.bounds(), truth.particles().meta.cell.as_ref());
        ModelComparison { scene: Scene::new(model), truth, even, subset, on_device: None }
    }

    /// Scores of all looks in `views`.
    pub fn evaluate(&self, views: &[View], size: Size, context: &Context<'_>) -> Result<Evaluation> {
        if views.is_empty() {
            return Err(Error::argument("there are no views to score"));
        }
        views.iter().try_for_each(|v| v.check(size))?;
        let mut scored = Vec::with_capacity(views.len());
        for (number, view) in views.iter().enumerate() {
            let name = format!("{} ({}/{})", view.name, number + 1, views.len());
            let sink = ViewProgress { name, inner: context.sink() };
            let context = context.with_sink(&sink);
            let pictures = self.draw(view, size, &context)?;
            context.begin("scores", 0);
            scored.push(self.scores(view, &pictures));
            context.end();
        }
        Ok(Evaluation::from_views(scored))
    }

    /// Draws a view of all that is compared.
    pub fn draw(&self, view: &View, size: Size, context: &Context<'_>) -> Result<ViewPictures> {
        // One range for all that is drawn: the model's Gaussians reach beyond the particles that the range is of.
        let view = clipped(view, self.truth.bounds());
        let [truth, model]: [&dyn Renderer; 2] = match &self.on_device {
            Some([truth, model]) => [&**truth, &**model],
            None => [self.truth, &self.scene],
        };
        let truth = ViewTruth::draw(truth, &view, size, context)?;
        let subset = self.subset.map(|(s, whole)| s.draw(self.truth, &view, size, whole, context)).transpose()?;
        context.begin("model", 0);
        let tau = model.optical_depth(&view, size, context)?;
        let even = uniform_box(&self.even, self.truth.particles().len() as f64, &view, size)?;
        context.end();
        Ok(ViewPictures { truth, tau, even, subset })
    }

    pub fn look(&self, pictures: &ViewPictures, look: ToneStyle) -> LookScores {
        pictures.scores(look, &self.scene.tone(&pictures.tau, look, &pictures.truth.tones))
    }

    fn scores(&self, view: &View, pictures: &ViewPictures) -> ViewScores {
        let no_fxaa = self.scene.tone(&pictures.tau, ToneStyle::ParaviewNoFxaa, &pictures.truth.tones);
        let target = pictures.truth.picture(ToneStyle::ParaviewNoFxaa);
        ViewScores {
            name: view.name.clone(),
            orbit: orbit_of(view),
            radius: view.radius,
            opacity: view.opacity,
            paraview: self.look(pictures, ToneStyle::Paraview),
            paraview_no_fxaa: LookScores {
                shot_noise: Some(shot_noise(&pictures.tau, view.opacity, &no_fxaa, target)),
                ..pictures.scores(ToneStyle::ParaviewNoFxaa, &no_fxaa)
            },
            expected: self.look(pictures, ToneStyle::Expected),
        }
    }
}

pub(super) struct ViewPictures {
    truth: ViewTruth,
    tau: Plane,
    even: Plane,
    subset: Option<SubsetView>,
}

impl ViewPictures {
    fn scores(&self, look: ToneStyle, model: &Gray8) -> LookScores {
        let target = self.truth.picture(look);
        let scores_of = |picture: &Gray8| Scores::new(picture, target);
        let noise_free = match look {
            // The target itself.
            ToneStyle::Expected => Scores { psnr: None, masked_psnr: None, ssim: ssim(target, target) },
            _ => scores_of(&self.truth.noise_free(look)),
        };
        let model = scores_of(model);
        LookScores {
            model,
            noise_free,
            all_black: scores_of(&Gray8::black(target.size)),
            uniform_box: scores_of(&self.truth.tones.of(&self.even, look)),
            subset: self.subset.as_ref().and_then(|s| s.picture(look)).map(scores_of),
            gap: gap(noise_free, model),
            left_out: None,
            shot_noise: None,
        }
    }
}

/// The score of a perfect smooth model against one shot, dB over the lit pixels: particles at random with the model's
/// density give a pixel the variance exp(-2 tau) (exp(a tau / 2) - 1) where splats are smaller than a pixel
/// (docs/law/scores.md). An estimate: a model that codes clumps passes it.
pub fn shot_noise(tau: &Plane, opacity: f64, drawn: &Gray8, target: &Gray8) -> Option<f64> {
    let (mut sum, mut pixels) = (0.0, 0u64);
    for ((&tau, &a), &b) in tau.data.iter().zip(&drawn.data).zip(&target.data) {
        if is_lit(a, b) {
            let tau = f64::from(tau);
            sum += libm::exp(-2.0 * tau) * libm::expm1(0.5 * opacity * tau);
            pixels += 1;
        }
    }
    if pixels == 0 { None } else { decibels(sum / pixels as f64) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// docs/law/scores.md, "Shot noise".
    #[test]
    fn shot_noise_has_the_published_values() {
        let size = Size { width: 9, height: 7 };
        let lit = Gray8 { size, data: vec![100; size.pixels()] };
        for (tau, expected) in [(0.05, 29.5), (0.1, 26.9), (0.2, 24.7), (0.5, 23.4), (1.0, 24.7), (2.0, 30.3)] {
            let plane = Plane { size, data: vec![tau; size.pixels()] };
            let db = shot_noise(&plane, 0.05, &lit, &lit).unwrap();
            assert!((db - expected).abs() < 0.06, "{tau}: {db}");
        }
        assert_eq!(shot_noise(&Plane::zeros(size), 0.05, &Gray8::black(size), &Gray8::black(size)), None);
    }
}
