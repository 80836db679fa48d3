//! Pictures, figures and films as files: of models and of all particles, with colours, fields, layers and panels.
//!
//! ```
//! use particlegs::pictures::{
//!     Colormap, Outputs, PictureOptions, PictureStyle, RenderOptions, ViewOptions, render_models,
//! };
//! use particlegs::{CompressOptions, Context, SavePng, Size, Snapshot, compress};
//!
//! # let folder = tempfile::tempdir().unwrap();
//! let (context, size) = (Context::default(), Size { width: 64, height: 64 });
//! let snapshot = Snapshot::from_columns([0.5, 1.0, 2.5], [0.0, 1.0, 0.0], [1.0, 1.5, 1.0])?;
//! let model = compress(&snapshot, &CompressOptions::gaussians(1), &context)?;
//!
//! // A density map in one call, or in other colours.
//! let map = model.density_map(&model.whole_view(size)?, size, &context)?;
//! map.save_png(folder.path().join("map.png"))?;
//! map.colored(Colormap::Viridis, None).save_png(folder.path().join("viridis.png"))?;
//!
//! // A figure with a colour bar and a scale bar.
//! let pictures = PictureOptions {
//!     output: Some(folder.path().join("density.pdf")),
//!     style: Some(PictureStyle::Density),
//!     view: ViewOptions { orthographic: true, size: Some(size), ..ViewOptions::default() },
//!     ..PictureOptions::default()
//! };
//! let options = RenderOptions { pictures, ..RenderOptions::default() };
//! let drawn = render_models(vec![model.picture_source()], &options, &Outputs::default(), &context)?;
//! assert!(drawn.range.is_none() && folder.path().join("density.pdf").is_file());
//! # Ok::<(), particlegs::Error>(())
//! ```

use crate::{Context, Gray8, Model, Plane, Result, Snapshot, Storage};
use particlegs_core::picture::Rgb8;
use particlegs_figure::FigureImage;
use particlegs_figure::png_file::{PngMetadata, coded};
use particlegs_files::output::write_bytes;
use particlegs_files::png::write_png;
use particlegs_pictures::certificate;
use std::path::{Path, PathBuf};

pub use particlegs_core::picture::{Colormap, ValueScale};
pub use particlegs_figure::{BarPlacement, PaperColour};
pub use particlegs_files::output::Outputs;
pub use particlegs_pictures::{
    FieldOptions, FigureAxes, FigureOptions, FilmLength, FilmOptions, FolderComparison, HaloNumber, PictureCenter,
    PictureOptions, PictureReport, PictureSource, PictureStyle, RenderOptions, ViewFit, ViewOptions, ViewSubject,
    compare as compare_pictures, render_models, render_series,
};

/// Draws all particles of a snapshot into pictures.
///
/// # Errors
/// [`crate::Error::Argument`] for options that are out of range or exclude one another; [`crate::Error::Output`] and
/// [`crate::Error::Io`] where pictures cannot be written; [`crate::Error::Memory`]; [`crate::Error::Cancelled`]; those of
/// reading.
pub fn render_snapshot(
    snapshot: &Snapshot,
    options: &PictureOptions,
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<PictureReport> {
    options.check()?;
    let (particles, fields) = snapshot.read(options.field.name.is_some(), &Storage::Memory, context)?;
    particlegs_pictures::render_particles(&particles, &fields, &snapshot.name(), options, outputs, context)
}

/// Draws `comparison.png`, all particles, the model and its error side by side, and `density.png` into a folder, which
/// is made where it is missing; gives their paths.
///
/// # Errors
/// As [`render_snapshot`].
pub fn certificate_pictures(
    folder: impl AsRef<Path>,
    model: &Model,
    snapshot: &Snapshot,
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<Vec<PathBuf>> {
    certificate::declare(folder.as_ref(), outputs, context)?;
    certificate::write(folder.as_ref(), model.decoded(), &snapshot.particles(context)?, context)
}

/// Writes a picture as PNG, whole or not at all.
pub trait SavePng {
    /// Writes it to `path`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()>;
}

impl SavePng for Gray8 {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        write_png(path.as_ref(), self.size, &self.data)
    }
}

impl SavePng for Rgb8 {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        let image = FigureImage::Color(self.clone());
        write_bytes(path.as_ref(), &coded(&image, &PngMetadata::default())?)
    }
}

/// A density in the default colours; [`Plane::colored`] has others.
impl SavePng for Plane {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        self.colored(Colormap::default(), None).save_png(path)
    }
}
