//! What was found, as files: tables of values, pages of Markdown, one page of HTML that needs nothing else.

mod csv;
mod html;
mod markdown;
mod provenance;
mod text;

pub use csv::csv;
pub use html::html;
pub use markdown::markdown;
pub use provenance::Provenance;
pub(crate) use provenance::line_of;
pub use text::text;

use crate::experiments::Experiment;
use crate::results::ExperimentResults;

/// An experiment that was done.
pub struct Section {
    pub experiment: &'static Experiment,
    /// What it found, or why it did not.
    pub found: Result<ExperimentResults, String>,
}
