//! Results as files: CSV tables, Markdown pages and one self-contained HTML page.

mod csv;
mod html;
mod markdown;
pub(crate) mod provenance;
mod text;

pub use csv::csv;
pub use html::html;
pub use markdown::markdown;
pub use provenance::Provenance;
pub use text::text;

use crate::experiments::Experiment;
use crate::results::ExperimentResults;

/// An experiment that was run.
pub struct ReportSection {
    pub experiment: &'static Experiment,
    /// Results, or why there are none.
    pub found: Result<ExperimentResults, String>,
}
