//! Haloes as files.

use crate::{Context, Result};
use particlegs_figure::FileKind;
use particlegs_files::output::kinds::{CSV, HDF5, PDF, PNG, SVG};
use particlegs_files::output::{Outputs, ending};
use particlegs_formats::{is_hdf5, write_haloes};
use particlegs_measure::haloes::HaloReport;
use std::path::{Path, PathBuf};

/// Files that haloes are written to.
#[derive(Clone, Copy, Debug)]
pub struct HaloFiles<'a> {
    /// The catalogue: `NAME.csv` or `NAME.hdf5`.
    pub catalogue: &'a Path,
    /// Mass functions: tables `NAME.csv`, plots `NAME.png`, `.svg` or `.pdf`.
    pub mass_functions: &'a [PathBuf],
}

impl HaloFiles<'_> {
    /// Declares the files before the work.
    ///
    /// # Errors
    /// [`crate::Error::Output`] for an ending that means another type of file, and a file that is kept.
    pub fn declare(&self, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
        outputs.writes(self.catalogue, if is_hdf5(self.catalogue)? { &HDF5 } else { &CSV }, context)?;
        self.mass_functions.iter().try_for_each(|path| {
            ending(path, &["csv", "png", "svg", "pdf"])?;
            let kind = match FileKind::from_path(path) {
                Some(FileKind::Png) => &PNG,
                Some(FileKind::Svg) => &SVG,
                Some(FileKind::Pdf) => &PDF,
                None => &CSV,
            };
            outputs.writes(path, kind, context).map(drop)
        })
    }

    /// Writes them, each whole or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a plot without a halo that has a mass; [`crate::Error::Io`].
    pub fn write(&self, report: &HaloReport) -> Result<()> {
        write_haloes(&report.catalogue, self.catalogue)?;
        self.mass_functions.iter().try_for_each(|path| report.write_mass_function(path))
    }
}
