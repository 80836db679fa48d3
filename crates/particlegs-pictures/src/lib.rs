//! Pictures, figures and films of models and particles, and comparisons of pictures.
//!
//! [`render_models`], [`render_series`] and [`render_particles`] draw views into files, as their options say, and give a
//! record of what was drawn; [`compare`] scores pictures and raw values; [`certificate`] has the pictures beside a
//! certificate. Outputs are declared to the caller's [`particlegs_files::output::Outputs`] before the work, notes go to its
//! context. Nothing here prints.

pub mod certificate;
mod comparison;
mod density_file;
mod field_choice;
mod figure_options;
mod film;
mod film_options;
mod finish;
mod frames;
mod gif;
mod layers;
mod models;
mod options;
mod panels;
mod particles;
mod picture_out;
mod provenance;
mod run;
mod series_film;
mod subject;
mod view_content;
mod view_options;

pub use comparison::{
    DensityFileComparison, FolderComparison, MeanDensityScores, MeanScores, PictureComparison, compare,
};
pub use field_choice::FieldOptions;
pub use figure_options::{FigureAxes, FigureOptions};
pub use film_options::{FilmLength, FilmOptions};
pub use models::{PictureSource, render_models, render_series};
pub use options::{PictureOptions, PictureStyle, RenderOptions};
pub use particles::render_particles;
pub use provenance::{PictureProvenance, PictureUnits, SourceFile};
pub use run::{PictureReport, RenderedView};
pub use series_film::HaloNumber;
pub use subject::ViewSubject;
pub use view_options::{PictureCenter, ViewFit, ViewOptions};
