//! A model as a user holds it: its file's bytes, and what they decode to; compressed from a snapshot, or merged from
//! others.

use crate::camera::{DensityView, View, base_distance, spherical_camera};
use crate::input::{FrameChoice, ModelOrSeries};
use crate::metadata::{Certificate, Metadata, Mixture};
use crate::series::SeriesFrame;
use crate::{Context, Density, Gray8, Particles, Plane, RecoverOptions, Result, Size, Snapshot, Storage, ToneStyle};
use particlegs_compress::Compression;
use particlegs_compress::verify::StoredModel;
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::codec::{FileInfo, Merge};
use particlegs_core::model::{LawKind, Recipe, RecipeStep, Target};
use particlegs_core::render::{FieldQuery, Scene};
use particlegs_core::{codec, model, render};
use particlegs_export::Cells;
use particlegs_files::input::name_of;
use particlegs_files::model_file;
use particlegs_files::output::{Outputs, write_bytes};
use particlegs_measure::score::Assessment;
use particlegs_pictures::{PictureSource, ViewOptions, ViewSubject};
use std::borrow::Cow;
use std::fmt::{Debug, Formatter};
use std::path::{Path, PathBuf};

pub use particlegs_compress::Options as CompressOptions;

/// A mixture of Gaussians with its file.
#[derive(Clone)]
pub struct Model {
    name: String,
    bytes: Vec<u8>,
    decoded: model::Model,
    frame: Option<SeriesFrame>,
}

impl Debug for Model {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let [gaussians, particles] = [self.decoded.gaussians() as u64, self.metadata().count];
        let (name, bytes) = (&self.name, self.bytes.len());
        write!(f, "Model({name}: {gaussians} Gaussians for {particles} particles, {bytes} bytes)")
    }
}

/// Compresses a snapshot; the same snapshot, options and seed give the same bytes, whatever the threads. Notes for the
/// user on the model go to the context's [`crate::ProgressSink`] as messages that begin with `note: `.
///
/// # Errors
/// [`crate::Error::Input`] for particles that cannot be compressed; [`crate::Error::Argument`] for a target out of
/// range; [`crate::Error::Memory`]; [`crate::Error::Cancelled`]; those of reading.
pub fn compress(snapshot: &Snapshot, options: &CompressOptions, context: &Context<'_>) -> Result<Model> {
    options.check()?;
    let (particles, fields) = snapshot.read(!options.fields.is_empty(), &Storage::Memory, context)?;
    let mut options = options.clone();
    options.read.extend(snapshot.options());
    let compressed_model =
        Compression::plan(&particles, &fields, &options, context)?.run(&mut NoCheckpoints, context)?;
    compressed_model.notes.iter().for_each(|note| context.note(note));
    let certificate = compressed_model.model.certificate.as_ref();
    let unit = compressed_model.model.metadata.units.length_text();
    let differing = certificate.map_or_else(Vec::new, |c| c.differing_layers(&compressed_model.model.layers, unit));
    differing.iter().for_each(|note| context.note(note));
    let (bytes, decoded) = (compressed_model.bytes, compressed_model.model);
    Ok(Model { name: particles.meta.name.clone(), bytes, decoded, frame: None })
}

/// Refuses to replace a model of another recipe, before any work: the same recipe gives the same bytes.
pub(crate) fn check_recipe(out: &Path, recipe: &Recipe, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
    let existing = crate::input::read_model(out, &FrameChoice::Last, context)?;
    match codec::read_metadata(&existing, &out.display().to_string())?.recipe == *recipe {
        true => Ok(()),
        false => Err(outputs.refused(out)),
    }
}

impl Model {
    /// Reads a model file, or the last frame of a series; `-` is standard input.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Input`] for what is no model; [`crate::Error::Corrupt`].
    pub fn open(path: impl AsRef<Path>) -> Result<Model> {
        Model::open_frame(path, &FrameChoice::Last, &Context::SILENT)
    }

    /// Reads a model file, or a frame or moment of a series, coded as a model of its own.
    ///
    /// # Errors
    /// As [`Model::open`]; [`crate::Error::Input`] for a frame that there is not.
    pub fn open_frame(path: impl AsRef<Path>, frame: &FrameChoice, context: &Context<'_>) -> Result<Model> {
        match ModelOrSeries::open(path, context)? {
            ModelOrSeries::Model(model) => frame.check_model(&model.name).map(|()| *model),
            ModelOrSeries::Series(series) => series.model(frame, context),
        }
    }

    /// Decodes a model file's bytes; errors name it `name`.
    ///
    /// # Errors
    /// [`crate::Error::Input`] for what is no model; [`crate::Error::Corrupt`].
    pub fn from_bytes(bytes: Vec<u8>, name: &str) -> Result<Model> {
        Model::decode(bytes, name, &Context::SILENT)
    }

    /// [`Model::from_bytes`] that can be cancelled.
    ///
    /// # Errors
    /// As [`Model::from_bytes`]; [`crate::Error::Cancelled`].
    pub fn decode(bytes: Vec<u8>, name: &str, context: &Context<'_>) -> Result<Model> {
        let decoded = codec::decode_with(&bytes, name, context)?;
        Ok(Model { name: name.into(), bytes, decoded, frame: None })
    }

    /// The model of a frame of a series, with the certificate that the series has for it.
    pub(crate) fn of_frame(bytes: Vec<u8>, name: String, frame: SeriesFrame, context: &Context<'_>) -> Result<Model> {
        let mut model = Model::decode(bytes, &name, context)?;
        // A frame that is coded anew comes without one.
        model.decoded.certificate = frame.lock().series().certificate(frame.number)?;
        Ok(Model { frame: Some(frame), ..model })
    }

    /// The path that it was read from, or the name of its snapshot.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The name of its file, without folders.
    pub fn file_name(&self) -> String {
        Path::new(&self.name).file_name().map_or_else(|| self.name.clone(), |n| n.to_string_lossy().into_owned())
    }

    /// Writes the file, whole or not at all; `-` is standard output.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Argument`] for a name that means another kind of file.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        model_file::check_name(path.as_ref())?;
        write_bytes(path.as_ref(), &self.bytes)
    }

    /// Merges Gaussians in pairs, the least visible merges first, down to a ratio, a size or a number of Gaussians.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for another target, a larger model than this, and alpha-blend models;
    /// [`crate::Error::Cancelled`].
    pub fn simplify(&self, target: Target, context: &Context<'_>) -> Result<Model> {
        self.info()?.left_out().iter().for_each(|note| context.note(note));
        let bytes = particlegs_compress::simplify(self.decoded.clone(), self.bytes.len() as u64, target, context)?;
        Model::decode(bytes, &self.name, context)
    }

    /// [`Model::simplify`] into a file. The model that was made so before is replaced by itself.
    ///
    /// # Errors
    /// As [`Model::simplify`]; [`crate::Error::Output`] for a file that may not be replaced.
    pub fn simplify_into(&self, out: &Path, target: Target, outputs: &Outputs, context: &Context<'_>) -> Result<Model> {
        if outputs.declare_model(out, context)? {
            let recipe = self.metadata().recipe.clone().then(RecipeStep::Simplify(target));
            check_recipe(out, &recipe, outputs, context)?;
        }
        let model = self.simplify(target, context)?;
        context.check()?;
        outputs.write_model(out, model.bytes(), context)?;
        Ok(model)
    }

    /// The model as its file or its series has it.
    pub(crate) fn stored(&self, context: &Context<'_>) -> Result<StoredModel> {
        match &self.frame {
            Some(frame) => StoredModel::of_frame(&mut frame.lock(), frame.number, context),
            None => StoredModel::new(self.decoded.clone(), &self.bytes, &self.name),
        }
    }

    /// The same blocks with another certificate, or none.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`].
    pub fn with_certificate(&self, certificate: Option<&Certificate>) -> Result<Model> {
        let layers = codec::coded_layers(&self.bytes, &self.name)?;
        let network = self.decoded.vizmapper().map(|v| &**v);
        let metadata = codec::read_metadata(&self.bytes, &self.name)?;
        Model::from_bytes(codec::assemble_with(&metadata, network, certificate, layers)?, &self.name)
    }

    /// The index of the file: its layers and blocks.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`].
    pub fn info(&self) -> Result<FileInfo> {
        codec::read_info(&self.bytes, &self.name)
    }

    /// The file's bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Metadata of the file: count, bounds, units, recipe.
    pub fn metadata(&self) -> &Metadata {
        &self.decoded.metadata
    }

    /// Measurements from when the file was made; `None` if there are none.
    pub fn certificate(&self) -> Option<&Certificate> {
        self.decoded.certificate.as_ref()
    }

    /// The Gaussians, block by block, each with the name of its layer.
    pub fn gaussians(&self) -> impl Iterator<Item = (&str, &Mixture)> {
        self.decoded.layers.iter().flat_map(|l| l.content.iter().map(|block| (l.name.as_str(), &block.gaussians)))
    }

    /// A perspective view that shows everything, from `azimuth` and `elevation` degrees, at the radius and opacity that
    /// the file states.
    pub fn orbit(&self, azimuth: f64, elevation: f64, size: Size) -> View {
        let m = self.metadata();
        let camera = spherical_camera(m.bounds.center(), azimuth, elevation, base_distance(&m.bounds, size));
        View { name: "orbit".into(), camera, radius: m.default_radius, opacity: m.default_opacity }
    }

    /// The view that the options say, at the radius and opacity that the file states unless they name others.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a number out of its range, and a view that shows nothing.
    pub fn view(&self, options: &ViewOptions) -> Result<View> {
        options.view(&ViewSubject::of_model(&self.decoded, false))
    }

    /// The map along z that shows everything, each Gaussian once where the box repeats.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a size out of range, or a model without extent.
    pub fn whole_view(&self, size: Size) -> Result<DensityView> {
        render::whole_view("whole", &Scene::new(&self.decoded), self.metadata().cell, size)
    }

    /// The model as [`crate::pictures::render_models`] takes it.
    pub fn picture_source(&self) -> PictureSource {
        PictureSource::new(self.name().as_ref(), &self.bytes, self.decoded.clone())
    }

    /// Draws it as ParaView draws the particles.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a view out of range; [`crate::Error::Memory`]; [`crate::Error::Cancelled`].
    pub fn render(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Gray8> {
        self.render_as(ToneStyle::Paraview, view, size, context)
    }

    /// Draws it in another style, such as without the smoothing of edges.
    ///
    /// # Errors
    /// As [`Model::render`].
    pub fn render_as(&self, style: ToneStyle, view: &View, size: Size, context: &Context<'_>) -> Result<Gray8> {
        render::draw(&Scene::new(&self.decoded), view, size, style, context)
    }

    /// Mass, or number where there are no masses, per area in each pixel, in the model's units.
    ///
    /// # Errors
    /// As [`Model::render`]; [`crate::Error::Argument`] for alpha-blend models, which have no density, and where only some
    /// layers have masses.
    pub fn density_map(&self, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane> {
        self.decoded.check_density(|_| true)?;
        render::surface_density(&Scene::new(&self.decoded), view, size, context)
    }

    /// The mean of a field along the line of sight of each pixel, in its unit; NaN where there is no mass. `field` is a
    /// scalar's name such as `temperature`, a component of a vector such as `velocity.los`, or `dispersion.` and a
    /// name.
    ///
    /// # Errors
    /// As [`Model::density_map`]; [`crate::Error::Argument`] for a field that the model lacks.
    pub fn field_map(&self, field: &str, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane<f64>> {
        let query = FieldQuery::new(field, &self.metadata().fields)?;
        Ok(render::field_map(&Scene::new(&self.decoded), &query, view, size, context)?.values)
    }

    /// The uses that it is good for by its certificate: a word and a reason for each.
    pub fn verdict(&self) -> Vec<Assessment> {
        Assessment::verdict(self.certificate(), self.metadata())
    }

    /// The density integrated over cells, `longest` of them along the longest edge.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for 0 cells or too many, and as [`Model::density_map`];
    /// [`crate::Error::Memory`]; [`crate::Error::Cancelled`].
    pub fn density_grid(&self, longest: usize, context: &Context<'_>) -> Result<Density> {
        Density::new(&self.decoded, Cells::Along(longest), context)
    }

    /// Draws synthetic particles from it: as many as it stands for, or as the options say.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for no particles; [`crate::Error::Memory`]; [`crate::Error::Cancelled`].
    pub fn recover(&self, options: &RecoverOptions, context: &Context<'_>) -> Result<Particles> {
        options.draw(self.decoded.clone(), context)
    }

    /// The decoded model, without its file.
    pub fn into_decoded(self) -> model::Model {
        self.decoded
    }

    /// The decoded model, for [`crate::stats::Subject::Model`].
    pub fn decoded(&self) -> &model::Model {
        &self.decoded
    }
}

/// Merges models, which keep all fields that each of them has, or those of these names.
///
/// # Errors
/// [`crate::Error::Input`] for models that do not belong together; [`crate::Error::Cancelled`].
pub fn merge(parts: &[&Model], fields: Option<Vec<String>>, context: &Context<'_>) -> Result<Model> {
    let name = parts.first().map_or("merged", |part| part.name());
    let bytes = merge_parts(parts.iter().map(|part| Ok((part.bytes().into(), part.name().into()))), fields, context)?;
    Model::decode(bytes, name, context)
}

/// Merges model files, one after the other read and not decoded, to the bytes of one.
///
/// # Errors
/// As [`merge`]; those of reading.
pub fn merge_files(parts: &[PathBuf], fields: Option<Vec<String>>, context: &Context<'_>) -> Result<Vec<u8>> {
    let read =
        |path: &PathBuf| Ok((crate::input::read_model(path, &Default::default(), context)?.into(), name_of(path)));
    merge_parts(parts.iter().map(read), fields, context)
}

fn merge_parts<'a>(
    parts: impl ExactSizeIterator<Item = Result<(Cow<'a, [u8]>, String)>>,
    fields: Option<Vec<String>>,
    context: &Context<'_>,
) -> Result<Vec<u8>> {
    let (mut merge, count) = (fields.map_or_else(Merge::default, Merge::with_fields), parts.len());
    context.begin("merging", count as u64);
    for part in parts {
        context.check()?;
        let (bytes, name) = part?;
        merge.add(&bytes, &name, context)?;
        context.advance(1);
    }
    context.end();
    let bytes = merge.finish()?;
    let info = codec::read_info(&bytes, "the merged model")?;
    if info.metadata.law == LawKind::AlphaBlend && count > 1 {
        context.note(match info.vizmapper {
            Some(_) => {
                "the VizMapper is that of the part with the first block, as published; it was trained on that part only"
            }
            None => "the part with the first block has no VizMapper, so the merged file has none",
        });
    }
    Ok(bytes)
}
