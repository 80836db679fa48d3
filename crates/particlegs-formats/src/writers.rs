//! The formats that snapshots are written in.

use crate::fields::OutField;
use particlegs_core::context::Context;
use particlegs_core::model::Cosmology;
use particlegs_core::{Error, Result};
use particlegs_files::output;
use particlegs_particles::{RawForm, SelectedParticles};
use std::path::Path;

/// A format that is written.
pub struct Writer {
    /// Name for `--to`.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// File endings that choose it, without the dot.
    pub endings: &'static [&'static str],
    /// Its capabilities beside positions and masses.
    holds: WriterCapabilities,
    /// The fields that it holds of what is kept, of each layer or of all.
    fields: fn(&SelectedParticles<'_>) -> Vec<Vec<OutField>>,
    /// Whether it writes a folder instead of a file.
    pub folder: bool,
    pub(crate) write: fn(&SelectedParticles<'_>, &Path, &Context<'_>) -> Result<u64>,
}

/// The metadata that a format holds beside positions and masses.
struct WriterCapabilities {
    cell: bool,
    units: bool,
    cosmology: bool,
    time: bool,
    step: bool,
}

/// The first is for names without a known ending.
static WRITERS: &[Writer] = &[
    Writer {
        name: "raw",
        title: "a folder with float32 columns and meta.json",
        endings: &[],
        holds: WriterCapabilities { cell: true, units: true, cosmology: true, time: true, step: true },
        fields: |_| Vec::new(),
        folder: true,
        write: |particles, out, context| particles.write_raw(out, RawForm::Columns, context),
    },
    Writer {
        name: "npy",
        title: "NumPy array of shape (N, 3)",
        endings: &["npy"],
        holds: WriterCapabilities { cell: false, units: false, cosmology: false, time: false, step: false },
        fields: |_| Vec::new(),
        folder: false,
        write: |particles, out, context| particles.write_raw(out, RawForm::Npy, context),
    },
    Writer {
        name: "hdf5",
        title: "HDF5 in the layout of Gadget-4",
        endings: &["hdf5", "h5"],
        holds: WriterCapabilities { cell: true, units: true, cosmology: true, time: true, step: false },
        fields: crate::hdf5::fields,
        folder: false,
        write: crate::hdf5::write,
    },
    Writer {
        name: "vtp",
        title: "VTK PolyData (VTP)",
        endings: &["vtp"],
        holds: WriterCapabilities { cell: false, units: false, cosmology: false, time: true, step: false },
        fields: crate::vtk_xml::common,
        folder: false,
        write: crate::vtk_xml::write,
    },
    Writer {
        name: "lammps",
        title: "LAMMPS text dump",
        endings: &["dump", "lammpstrj"],
        holds: WriterCapabilities { cell: true, units: false, cosmology: false, time: true, step: true },
        fields: crate::lammps::write::common,
        folder: false,
        write: crate::lammps::write::write,
    },
];

impl Writer {
    /// All of them; the first is for names without a known ending.
    pub fn all() -> &'static [Writer] {
        WRITERS
    }

    /// The writer of that name, or else the one that the output's ending means: a name without a known
    /// ending means raw columns.
    pub fn for_output(out: &Path, name: Option<&str>) -> Result<&'static Writer> {
        let refused = |message: String| {
            let writers: Vec<String> = WRITERS.iter().map(Writer::describe).collect();
            Err(Error::argument_with(message, format!("possible formats: {}", writers.join("; "))))
        };
        let endings: Vec<&str> = WRITERS.iter().flat_map(|w| w.endings).copied().collect();
        let meant = match output::ending(out, &endings) {
            Ok(ending) => ending.and_then(|e| WRITERS.iter().find(|w| w.endings.contains(&e))),
            Err(Error::Argument { what: message, .. }) => return refused(message),
            Err(other) => return Err(other),
        };
        let Some(name) = name else { return Ok(meant.unwrap_or(&WRITERS[0])) };
        let Some(writer) = WRITERS.iter().find(|w| w.name == name) else {
            return refused(format!("unknown output format `{name}`"));
        };
        match meant {
            Some(meant) if meant.name != name => {
                let (out, title) = (out.display(), meant.title);
                refused(format!("{out}: the ending means {title}, but format {name} was requested"))
            }
            _ => Ok(writer),
        }
    }

    /// Writes the particles to `out`, whole or not at all; gives the bytes written.
    pub fn write(&self, particles: &SelectedParticles<'_>, out: &Path, context: &Context<'_>) -> Result<u64> {
        (self.write)(particles, out, context)
    }

    /// The metadata and fields that a file of the particles leaves out, in words; none where it holds all.
    pub fn left_out(&self, particles: &SelectedParticles<'_>) -> Option<String> {
        let (meta, holds) = (particles.meta(), &self.holds);
        let written = (self.fields)(particles);
        let is_written = |name: &String| written.iter().flatten().any(|f| f.sources.contains(name));
        let mut all: Vec<String> = meta.fields.iter().filter(|name| !is_written(name)).cloned().collect();
        let (units, cosmology) = (&meta.units, meta.cosmology != Cosmology::default());
        for (is_lost, content) in [
            (meta.cell.is_some() && !holds.cell, "the periodic box"),
            ((units.length.is_some() || units.mass.is_some()) && !holds.units, "units"),
            (cosmology && !holds.cosmology, "the cosmology"),
            (meta.epoch.scale_factor.is_some() && !holds.cosmology, "the scale factor"),
            (meta.epoch.time.is_some() && !holds.time, "the time"),
            (meta.epoch.step.is_some() && !holds.step, "the time step"),
        ] {
            all.extend(is_lost.then(|| content.to_string()));
        }
        (!all.is_empty()).then(|| format!("{} cannot store: {}", self.title, all.join(", ")))
    }

    /// For lists: `hdf5 (.hdf5, .h5)`.
    fn describe(&self) -> String {
        let endings: Vec<String> = self.endings.iter().map(|e| format!(".{e}")).collect();
        let endings = if endings.is_empty() { "a folder".into() } else { endings.join(", ") };
        format!("{} ({endings})", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_means_what_it_says_or_is_refused() {
        let to = |out: &str, name: Option<&str>| Writer::for_output(Path::new(out), name).map(|w| w.name);
        let chosen = [
            ("x", None, "raw"),
            ("run.1", None, "raw"),
            ("snap_099.v2", None, "raw"),
            ("a.npy.raw", None, "raw"),
            ("a.npy/", None, "raw"),
            ("x.npy", None, "npy"),
            ("x.NPY", Some("npy"), "npy"),
            ("x", Some("npy"), "npy"),
            ("x.h5", None, "hdf5"),
            ("x", Some("hdf5"), "hdf5"),
            ("x.1", Some("vtp"), "vtp"),
            ("x.dump", Some("lammps"), "lammps"),
        ];
        for (out, name, writer) in chosen {
            assert_eq!(to(out, name).unwrap(), writer, "{out}");
        }
        for (out, name) in [
            ("x.csv", None),
            ("x.FITS", None),
            ("x.xyz", None),
            ("x.npz", None),
            ("x.ply", None),
            ("x.vdb", None),
            ("x.csv", Some("hdf5")),
            ("b.npy", Some("raw")),
            ("b.npy", Some("hdf5")),
            ("x", Some("fits")),
        ] {
            let error = to(out, name).unwrap_err();
            assert!(
                error.hint().to_string().contains("raw (a folder); npy (.npy); hdf5 (.hdf5, .h5)"),
                "{out}: {}",
                error.hint()
            );
        }
    }
}
