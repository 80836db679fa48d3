//! A comparison as it is written: tables, plots and JSON.

use super::compare::show;
use super::presentation::Presentation;
use super::{Statistics, StatsOptions, StatsSide, compare};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_figure::FileKind;
use particlegs_files::output::{Outputs, write_json};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Statistics of two inputs, with their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatsReport {
    /// The truth's name.
    pub truth: String,
    /// The other's name.
    pub other: String,
    /// Unit of length of the truth, as text.
    pub length_unit: Option<String>,
    /// Version of the program.
    pub tool_version: &'static str,
    /// The statistics.
    #[serde(flatten)]
    pub statistics: Statistics,
}

impl StatsReport {
    /// Compares `other` with `truth`, each with its name, as [`compare`] does. Notes also go to the context.
    ///
    /// # Errors
    /// Those of [`compare`].
    pub fn new(
        truth: (StatsSide<'_>, &str),
        other: (StatsSide<'_>, &str),
        options: &StatsOptions,
        context: &Context<'_>,
    ) -> Result<StatsReport> {
        let statistics = compare(truth.0, other.0, options, context)?;
        statistics.notes.iter().for_each(|note| context.note(note));
        Ok(StatsReport {
            truth: truth.1.into(),
            other: other.1.into(),
            length_unit: truth.0.subject.unit_system().units.length_text().map(String::from),
            tool_version: env!("CARGO_PKG_VERSION"),
            statistics,
        })
    }

    /// Writes `stats.json`, a CSV table of each measure, pictures of the density, and plots of each kind into a folder,
    /// all or none. Lengths are in the unit of length.
    ///
    /// # Errors
    /// [`particlegs_core::Error::Output`] for a file that is there and was not made by this function;
    /// [`particlegs_core::Error::Io`].
    pub fn write(
        &self,
        folder: &Path,
        plots: &[FileKind],
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<Vec<PathBuf>> {
        let fill = |folder: &Path| {
            self.presentation().write(folder, plots)?;
            write_json(&folder.join("stats.json"), self)
        };
        outputs.write_set(folder, fill, context)
    }

    /// The most important figures, a line each.
    pub fn text(&self) -> String {
        self.presentation().text
    }

    fn presentation(&self) -> Presentation {
        let s = &self.statistics;
        let side =
            |side: usize| format!("{}{} particles", if s.model[side] { "model of " } else { "" }, s.particles[side]);
        let first = format!("truth {}, other {}", side(0), side(1));
        let mut presentation = Presentation::new(self.length_unit.as_deref(), first);
        show(s, &mut presentation);
        presentation
    }
}
