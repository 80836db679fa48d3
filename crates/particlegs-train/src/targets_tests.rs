//! Targets are the same whether they are drawn, kept, or drawn again; parts are parts of the whole.

use super::config::{Config, Preset, Stage};
use super::learner::Crop;
use super::targets::Targets;
use crate::cameras::Views;
use crate::{Defaults, TrainingSubject};
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::Renderer;
use particlegs_core::splat::ToneStyle;
use particlegs_particles::Particles;
use particlegs_reference::Reference;

/// Particles as the renderer of references draws them.
pub(super) struct ParticleSubject<'a>(pub Reference<'a>);

impl Renderer for ParticleSubject<'_> {
    fn draw(&self, view: &View, size: Size, look: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        self.0.draw(view, size, look, context)
    }
    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        self.0.optical_depth(view, size, context)
    }
}

impl TrainingSubject for ParticleSubject<'_> {
    fn len(&self) -> usize {
        self.0.particles().len()
    }
    fn position(&self, i: usize) -> [f64; 3] {
        self.0.particles().position(i)
    }
    fn origin(&self) -> [f64; 3] {
        self.0.particles().origin
    }
    fn columns(&self, range: std::ops::Range<usize>) -> [Vec<f32>; 3] {
        self.0.particles().columns(range)
    }
    fn bounds(&self) -> particlegs_core::space::Bounds {
        *self.0.bounds()
    }
}

pub(super) fn cloud(n: u64) -> Particles {
    let mut columns = [Vec::new(), Vec::new(), Vec::new()];
    for i in 0..n {
        let mut r = particlegs_core::math::Random::new(5, 1, i);
        columns.iter_mut().for_each(|c| c.push((5.0 + r.normal()) as f32));
    }
    let [x, y, z] = columns;
    Particles::from_columns(x, y, z)
}

pub(super) fn defaults(particles: &Particles) -> Defaults {
    Defaults { bounds: particles.bounds(), radius: 0.1, opacity: 0.3, seed: 2, bytes: None, gaussians: None }
}

fn view(defaults: &Defaults) -> View {
    let cameras = Config::preset(Preset::Paper, LawKind::OpticalDepth).cameras;
    Views::new(&cameras, defaults, false).training[0].clone()
}

#[test]
fn kept_drawn_and_cut_targets_agree() {
    let particles = cloud(3000);
    let defaults = defaults(&particles);
    let reference = ParticleSubject(Reference::with_bounds(&particles, defaults.bounds));
    let folder = tempfile::tempdir().unwrap();
    let view = view(&defaults);
    let size = Size { width: 48, height: 32 };
    let part = Crop { full: size, corner: [7, 11], size: Size { width: 20, height: 16 } };
    for (look, oversample) in [(ToneStyle::Expected, 1), (ToneStyle::Expected, 2), (ToneStyle::Paraview, 2)] {
        let plain = Config::preset(Preset::Paper, LawKind::OpticalDepth).stages[0];
        let stage = Stage { size: [48, 32], oversample, ..plain };
        let mut cached_targets = Targets::new(&reference, look, &stage, folder.path(), 1 << 20);
        let mut uncached_targets = Targets::new(&reference, look, &stage, folder.path(), 0);
        let whole = cached_targets.get(3, &view, &Crop::whole(size), &Context::SILENT).unwrap();
        assert!(whole.data.iter().any(|v| *v > 0.05) && whole.data.iter().all(|v| (0.0..=1.0).contains(v)));
        let [first, again] = [0, 1].map(|_| uncached_targets.get(3, &view, &part, &Context::SILENT).unwrap());
        let from_file = cached_targets.get(3, &view, &part, &Context::SILENT).unwrap();
        assert_eq!(first.data, again.data);
        assert_eq!(first.data, from_file.data);
        let row = |y: usize| &whole.data[(11 + y) * 48 + 7..][..20];
        let cut: Vec<f32> = (0..16).flat_map(row).copied().collect();
        assert_eq!(cut, from_file.data, "{look:?} {oversample}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "scratch files have no names");
}

#[test]
fn a_scratch_folder_that_is_not_there_is_named() {
    let particles = cloud(100);
    let defaults = defaults(&particles);
    let reference = ParticleSubject(Reference::with_bounds(&particles, defaults.bounds));
    let stage = Stage { size: [16, 16], ..Config::preset(Preset::Paper, LawKind::OpticalDepth).stages[0] };
    let nowhere = std::path::Path::new("/nowhere/at/all");
    let mut targets = Targets::new(&reference, ToneStyle::Expected, &stage, nowhere, 1 << 20);
    let whole = Crop::whole(Size { width: 16, height: 16 });
    let error = targets.get(0, &view(&defaults), &whole, &Context::SILENT).unwrap_err();
    assert!(
        error.to_string().starts_with("/nowhere/at/all") && matches!(error, particlegs_core::Error::Io { .. }),
        "{error}"
    );
}
