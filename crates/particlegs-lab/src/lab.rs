//! Shared parts of experiments: cached results, other compressors, and models by their recipe.

use crate::Baseline;
use crate::external::External;
use crate::settings::Settings;
use crate::snapshot::Snapshot;
use crate::store::ResultStore;
use particlegs_compress::{CompressedModel, Options, Target, compress};
#[cfg(doc)]
use particlegs_core::Error;
use particlegs_core::camera::View;
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::model::{CertificateLevel, Model};
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::render::{Renderer, Scene};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Result, codec};
use particlegs_fit::{Effort, recover};
use particlegs_particles::{Particles, RawForm};
use particlegs_reference::Reference;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Draws pictures of one object as ParaView would, antialiased, by view and size.
pub type Draw<'a> = Box<dyn Fn(&View, Size) -> Result<Gray8> + 'a>;

/// The picture that is drawn of all particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// ParaView's own picture, with shot noise.
    Paraview,
    /// Its mean, without shot noise.
    NoiseFree,
}

/// The environment of experiments.
pub struct Lab<'a> {
    pub settings: Settings,
    pub store: ResultStore,
    /// Results that depend on the device: pictures, their scores, trained models.
    pub on_device: ResultStore,
    /// The GPU to measure, with kernels that can be timed.
    #[cfg(feature = "gpu")]
    pub gpu: Option<crate::gpu::TimedDevice>,
    /// Other compressors: the built-in ones, and those of the user's Python.
    pub baselines: Vec<Box<dyn Baseline>>,
    pub context: &'a Context<'a>,
}

/// Settings that a model is made by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelSettings {
    pub target: Target,
    pub effort: Effort,
    /// Number of blocks, each fitted on its own.
    pub blocks: u32,
    pub seed: u64,
}

impl ModelSettings {
    /// A file of raw bytes / `ratio`, with the default fit.
    pub fn ratio(ratio: f64, seed: u64) -> ModelSettings {
        ModelSettings { target: Target::Ratio(ratio), effort: Effort::Default, blocks: 1, seed }
    }

    /// Turns a ratio into bytes, so that a ratio and its size are one model, fitted once.
    fn in_bytes(&self, snapshot: &Snapshot) -> ModelSettings {
        let bytes = self.target.bytes(snapshot.position_bytes());
        ModelSettings { target: bytes.map_or(self.target, Target::Size), ..self.clone() }
    }

    pub fn options(&self) -> Options {
        Options {
            target: self.target,
            effort: self.effort,
            blocks: Some(self.blocks),
            seed: self.seed,
            certificate: CertificateLevel::None,
            ..Options::default()
        }
    }
}

pub struct ModelBuild {
    pub bytes: Vec<u8>,
    /// The decoded file.
    pub model: Model,
    /// Wall-clock time of the compression.
    pub seconds: f64,
}

impl<'a> Lab<'a> {
    /// Caches results in an existing folder.
    pub fn new(settings: Settings, folder: &Path, context: &'a Context<'a>) -> Result<Self> {
        let external = settings.python.as_deref().map(External::start).transpose()?;
        let baselines = crate::baselines(external.as_ref());
        let store = ResultStore::new(folder);
        let on_device = store.by(settings.device_name());
        Ok(Lab {
            settings,
            store,
            on_device,
            #[cfg(feature = "gpu")]
            gpu: None,
            baselines,
            context,
        })
    }

    /// Note on the compressors that need a Python, if none was named.
    pub fn left_out(&self) -> Option<String> {
        let words = "SZ3 and ZFP were not measured: they need a Python with their libraries.";
        self.settings.python.is_none().then(|| words.into())
    }

    /// The model of a snapshot by a recipe, from the cache if possible.
    pub fn model(&self, snapshot: &Snapshot, recipe: &ModelSettings) -> Result<ModelBuild> {
        let recipe = recipe.in_bytes(snapshot);
        self.made(&(&snapshot.hash, &recipe), || {
            compress(&snapshot.particles, &recipe.options(), &mut NoCheckpoints, self.context)
        })
    }

    /// Draws as many particles from a model as it was made from.
    pub fn drawn(&self, model: Model, method: recover::Method, seed: u64) -> Result<Particles> {
        let form = RawForm::Columns;
        let options = recover::Options { particles: None, method, scale: 1.0, seed, form, model_name: String::new() };
        options.draw(model, self.context)
    }

    /// Draws particles with these bounds (world units) on the chosen device.
    pub fn draws_particles<'b>(&'b self, particles: &'b Particles, bounds: Bounds, style: Style) -> Result<Draw<'b>> {
        let reference = Reference::with_bounds(particles, bounds);
        let renderer: Box<dyn Renderer + 'b> = match &self.settings.device {
            Some(device) => device.particles(reference.input(), self.context)?,
            None => Box::new(reference),
        };
        Ok(Box::new(move |view, size| match style {
            Style::Paraview => renderer.draw(view, size, ToneStyle::Paraview, self.context),
            Style::NoiseFree => renderer.response(view, size, ToneStyle::Paraview, self.context),
        }))
    }

    /// Draws a model on the chosen device.
    pub fn draws_model<'b>(&'b self, model: &'b Model) -> Result<Draw<'b>> {
        let scene = Scene::new(model);
        let renderer: Box<dyn Renderer + 'b> = match &self.settings.device {
            Some(device) => device.scene(&scene)?,
            None => Box::new(scene),
        };
        Ok(Box::new(move |view, size| renderer.draw(view, size, ToneStyle::Paraview, self.context)))
    }

    /// Caches a model that a recipe gave in `seconds`, unless one is cached.
    pub fn keep(&self, snapshot: &Snapshot, recipe: &ModelSettings, done: CompressedModel, seconds: f64) -> Result<()> {
        let inputs = (&snapshot.hash, recipe.in_bytes(snapshot));
        self.store.bytes("model", &inputs, "pgs", || Ok(done.bytes))?;
        self.store.result("model-seconds", &inputs, || Ok(seconds))?;
        Ok(())
    }

    /// A model made by `work`, cached by its inputs.
    pub fn made(&self, inputs: &impl Serialize, make: impl FnOnce() -> Result<CompressedModel>) -> Result<ModelBuild> {
        self.kept_model(&self.store, inputs, || timed(make))
    }

    /// [`Lab::made`] on the chosen device, with work that reports its own seconds, including earlier runs.
    pub fn made_on_device(
        &self,
        inputs: &impl Serialize,
        make: impl FnOnce() -> Result<(CompressedModel, f64)>,
    ) -> Result<ModelBuild> {
        self.kept_model(&self.on_device, inputs, make)
    }

    fn kept_model(
        &self,
        store: &ResultStore,
        inputs: &impl Serialize,
        make: impl FnOnce() -> Result<(CompressedModel, f64)>,
    ) -> Result<ModelBuild> {
        let seconds = std::cell::Cell::new(0.0);
        let bytes = store.bytes("model", inputs, "pgs", || {
            let (done, took) = make()?;
            seconds.set(took);
            Ok(done.bytes)
        })?;
        // If the model was cached, so are its seconds, and `make` was not called.
        let seconds = store.result("model-seconds", inputs, || Ok(seconds.get()))?;
        let model = codec::decode_with(&bytes, "the model", self.context)?;
        Ok(ModelBuild { bytes, model, seconds })
    }
}

/// The value, made at the first call.
pub fn or_made<T>(slot: &mut Option<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    let value = match slot.take() {
        Some(value) => value,
        None => make()?,
    };
    Ok(slot.insert(value))
}

/// The result of work, and its wall-clock seconds.
pub fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, f64)> {
    let start = std::time::Instant::now();
    let done = work()?;
    Ok((done, start.elapsed().as_secs_f64()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A model of a ratio is the cached one for its bytes as well.
    #[test]
    fn a_ratio_and_its_size_are_one_model() {
        let (snapshot, folder) = (crate::testing::snapshot(), tempfile::tempdir().unwrap());
        let lab = Lab::new(Settings::new(true, "".into()), folder.path(), &particlegs_core::context::Context::SILENT)
            .unwrap();
        let bytes = lab.model(&snapshot, &ModelSettings::ratio(10.0, 1)).unwrap().bytes;
        let files = || std::fs::read_dir(folder.path()).unwrap().count();
        let file_count = files();
        let size = ModelSettings { target: Target::Size(3600), ..ModelSettings::ratio(10.0, 1) };
        assert_eq!((lab.model(&snapshot, &size).unwrap().bytes, files()), (bytes, file_count));
    }
}
