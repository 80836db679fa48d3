//! The formats that snapshots are written in.

use particlegs::particles::{Kept, RawForm, write_raw};
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use std::path::Path;

/// A format to write.
pub struct Writer {
    /// Name for `--to`.
    pub name: &'static str,
    /// What it is called among people.
    pub title: &'static str,
    /// Endings of names that mean it.
    pub endings: &'static [&'static str],
    /// Can it hold the periodic box?
    pub holds_box: bool,
    /// Does it write a folder, not a file?
    pub folder: bool,
    /// Writes what is kept, whole or not at all; the bytes written.
    pub write: fn(&Kept<'_>, &Path, &dyn Progress) -> Result<u64>,
}

/// All of them; the first is for names without a known ending.
pub static WRITERS: &[Writer] = &[
    Writer {
        name: "raw",
        title: "a folder with float32 columns and meta.json",
        endings: &[],
        holds_box: true,
        folder: true,
        write: |kept, out, progress| Ok(write_raw(kept, out, RawForm::Columns, progress)?.bytes),
    },
    Writer {
        name: "npy",
        title: "NumPy array of shape (N, 3)",
        endings: &["npy"],
        holds_box: false,
        folder: false,
        write: |kept, out, progress| Ok(write_raw(kept, out, RawForm::Npy, progress)?.bytes),
    },
    Writer {
        name: "hdf5",
        title: "HDF5 in the layout of Gadget-4",
        endings: &["hdf5", "h5"],
        holds_box: true,
        folder: false,
        write: crate::hdf5::write,
    },
    Writer {
        name: "vtp",
        title: "VTK PolyData (VTP)",
        endings: &["vtp"],
        holds_box: false,
        folder: false,
        write: crate::vtk_xml::write,
    },
    Writer {
        name: "lammps",
        title: "LAMMPS text dump",
        endings: &["dump", "lammpstrj"],
        holds_box: true,
        folder: false,
        write: crate::lammps::write::write,
    },
];

/// The writer of that name, or else the one that the output's ending means.
///
/// # Errors
/// [`Error::Argument`] for an unknown name.
pub fn writer_for(out: &Path, name: Option<&str>) -> Result<&'static Writer> {
    if let Some(name) = name {
        return WRITERS.iter().find(|w| w.name == name).ok_or_else(|| {
            let names: Vec<&str> = WRITERS.iter().map(|w| w.name).collect();
            Error::argument(format!("output format `{name}` is not one of: {}", names.join(", ")))
        });
    }
    let ending = out.extension().map(|e| e.to_string_lossy().to_lowercase());
    let known = WRITERS.iter().find(|w| ending.as_deref().is_some_and(|e| w.endings.contains(&e)));
    Ok(known.unwrap_or(&WRITERS[0]))
}
