//! A model as a user holds it: its file's bytes, and what they decode to.

use crate::camera::{DensityView, View, base_distance, spherical_camera};
use crate::metadata::{Certificate, LawKind, Metadata, Mixture};
use crate::{
    Context, Density, Error, Evaluation, Gray8, Particles, Plane, RecoverOptions, Result, Size, Snapshot, ToneStyle,
};
use particlegs_compress::Compression;
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::render::Scene;
use particlegs_core::{codec, model, render};
use particlegs_export::Cells;
use particlegs_files::input::{Source, name_of};
use particlegs_files::model_file;
use particlegs_files::output::write_bytes;
use particlegs_measure::score;
use particlegs_pictures::PictureSource;
use std::path::Path;

pub use particlegs_compress::Options as CompressOptions;

/// A mixture of Gaussians with its file.
#[derive(Clone)]
pub struct Model {
    bytes: Vec<u8>,
    decoded: model::Model,
}

/// Compresses a snapshot; the same snapshot, options and seed give the same bytes, whatever the threads. What a user should
/// know of the model goes to the context's [`crate::ProgressSink`] as messages that begin with `note: `.
///
/// # Errors
/// [`crate::Error::Input`] for particles that cannot be compressed; [`crate::Error::Argument`] for a target out of
/// range; [`crate::Error::Memory`]; [`crate::Error::Cancelled`]; those of reading.
pub fn compress(snapshot: &Snapshot, options: &CompressOptions, context: &Context<'_>) -> Result<Model> {
    let (particles, fields) = snapshot.particles_with(!options.fields.is_empty(), context)?;
    let mut options = options.clone();
    options.read.extend(snapshot.options());
    let made = Compression::plan(&particles, &fields, &options, context)?.run(&mut NoCheckpoints, context)?;
    made.notes.iter().for_each(|note| context.note(note));
    Ok(Model { bytes: made.bytes, decoded: made.model })
}

impl Model {
    /// Reads a model file; `-` is standard input.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Input`] for what is no model, or a damaged one.
    pub fn open(path: impl AsRef<Path>) -> Result<Model> {
        let name = name_of(path.as_ref());
        let source = Source::open(path.as_ref(), &Context::SILENT)?;
        Model::from_bytes(model_file::read_source(source, &name)?, &name)
    }

    /// Decodes a model file's bytes; errors name it `name`.
    ///
    /// # Errors
    /// [`crate::Error::Input`] for what is no model, or a damaged one.
    pub fn from_bytes(bytes: Vec<u8>, name: &str) -> Result<Model> {
        let decoded = codec::decode(&bytes, name)?;
        Ok(Model { bytes, decoded })
    }

    /// Writes the file, whole or not at all; `-` is standard output.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        write_bytes(path.as_ref(), &self.bytes)
    }

    /// The file's bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// What the file says: count, bounds, units, recipe.
    pub fn metadata(&self) -> &Metadata {
        &self.decoded.metadata
    }

    /// What was measured when the file was made; `None` where nothing was.
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

    /// The map along z that shows everything, each Gaussian once where the box repeats.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a size out of range, or a model without extent.
    pub fn whole_view(&self, size: Size) -> Result<DensityView> {
        render::whole_view("whole", &Scene::new(&self.decoded), self.metadata().cell, size)
    }

    /// What [`crate::pictures::render_models`] draws; pictures store the name of `path` as the model's.
    pub fn picture_source(&self, path: impl AsRef<Path>) -> PictureSource {
        PictureSource::new(path.as_ref(), &self.bytes, self.decoded.clone())
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
    /// As [`Model::render`]; [`crate::Error::Input`] for alpha-blend models, which have no density.
    pub fn density_map(&self, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane> {
        self.check_density()?;
        render::surface_density(&Scene::new(&self.decoded), view, size, context)
    }

    /// The density integrated over cells, `longest` of them along the longest edge.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for 0 cells or too many; [`crate::Error::Input`] for alpha-blend models;
    /// [`crate::Error::Memory`]; [`crate::Error::Cancelled`].
    pub fn density_grid(&self, longest: usize, context: &Context<'_>) -> Result<Density> {
        self.check_density()?;
        Density::new(&self.decoded, Cells::Along(longest), context)
    }

    /// Draws synthetic particles from it: as many as it stands for, or as the options say.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for no particles; [`crate::Error::Memory`]; [`crate::Error::Cancelled`].
    pub fn recover(&self, options: &RecoverOptions, context: &Context<'_>) -> Result<Particles> {
        options.draw(self.decoded.clone(), context)
    }

    /// Scores it against its snapshot in `views`.
    ///
    /// # Errors
    /// [`crate::Error::Input`] for a snapshot in other units; [`crate::Error::Argument`] for no views, or one out of
    /// range; those of reading and drawing.
    pub fn evaluate(
        &self,
        snapshot: &Snapshot,
        views: &[View],
        size: Size,
        context: &Context<'_>,
    ) -> Result<Evaluation> {
        score::evaluate(&self.decoded, &snapshot.particles(context)?, views, size, None, context)
    }

    /// Splats hold opacities, not masses.
    fn check_density(&self) -> Result<()> {
        match self.metadata().law {
            LawKind::OpticalDepth => Ok(()),
            LawKind::AlphaBlend => Err(Error::input("the model", "an alpha-blend model has no density")),
        }
    }

    /// The decoded model, for [`crate::stats::Subject::Model`].
    pub fn decoded(&self) -> &model::Model {
        &self.decoded
    }
}
