//! Snapshots out: raw float32 columns with meta.json, or one .npy; whole or not at all.

use super::ONE_LAYER;
use super::select::{Kept, KeptLayer, Run};
use crate::output::{check_space, write_at};
use crate::{Error, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Column files in the order of a run's columns.
const COLUMNS: [&str; 4] = ["xx.f32", "yy.f32", "zz.f32", "ww.f32"];
const SIDECAR: &str = "meta.json";

/// A snapshot being written: files of final length in a temporary folder beside their place, which
/// goes away unless [`SnapshotWriter::finish`] moves them there.
pub(super) struct SnapshotWriter {
    out: PathBuf,
    folder: tempfile::TempDir,
    layout: Layout,
}

enum Layout {
    /// xx, yy, zz and perhaps ww.
    Columns(Vec<File>),
    /// Triples after a header of so many bytes.
    Npy(File, u64),
}

impl SnapshotWriter {
    /// Opens files for `count` particles: one .npy where `out` ends so, else columns in a folder.
    ///
    /// # Errors
    /// [`Error::Io`] where the place cannot be written or the disk has no room; [`Error::Input`]
    /// where weights would be lost or a stale weights file would be taken for the new one's.
    pub fn create(out: &Path, count: u64, weighted: bool) -> Result<Self> {
        let npy = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy"));
        if npy && weighted {
            return Err(Error::input_hint(out, "an .npy of positions would lose the weights", "name a folder instead"));
        }
        if !npy && !weighted && out.join(COLUMNS[3]).exists() {
            return Err(Error::input_hint(
                out,
                "its ww.f32 belongs to another snapshot and would be taken for this one's",
                "remove it, or name another folder",
            ));
        }
        let beside = if !npy && out.is_dir() { out } else { parent(out) };
        let folder = temporary_folder(beside).map_err(|e| Error::io(out, e))?;
        let bytes = count * if weighted { 16 } else { 12 };
        check_space(folder.path(), bytes).map_err(|e| Error::io(out, e))?;
        let create = |name: &str| File::create(folder.path().join(name)).map_err(|e| Error::io(out, e));
        let layout = if npy {
            let header = npy_header(count);
            let mut file = create("positions.npy")?;
            file.write_all(&header).map_err(|e| Error::io(out, e))?;
            Layout::Npy(file, header.len() as u64)
        } else {
            let columns = if weighted { &COLUMNS[..] } else { &COLUMNS[..3] };
            Layout::Columns(columns.iter().map(|name| create(name)).collect::<Result<_>>()?)
        };
        Ok(SnapshotWriter { out: out.to_path_buf(), folder, layout })
    }

    /// Writes a run at particle `first`; runs may come in any order and from several threads.
    /// `triples` is scratch space.
    pub fn write(&self, first: u64, run: &Run, triples: &mut Vec<f32>) -> Result<()> {
        let done = match &self.layout {
            Layout::Columns(files) => files
                .iter()
                .zip(&run.columns)
                .try_for_each(|(file, column)| write_at(file, bytemuck::cast_slice(column), 4 * first)),
            Layout::Npy(file, header) => {
                let [x, y, z, _] = &run.columns;
                triples.clear();
                triples.extend((0..x.len()).flat_map(|i| [x[i], y[i], z[i]]));
                write_at(file, bytemuck::cast_slice(triples), header + 12 * first)
            }
        };
        done.map_err(|e| Error::io(&self.out, e))
    }

    /// Syncs the files and moves them to their place; what is known goes beside columns.
    pub fn finish(self, kept: &Kept<'_>) -> Result<()> {
        let fail = |e| Error::io(&self.out, e);
        let folder = self.folder.path();
        match &self.layout {
            Layout::Npy(file, _) => {
                file.sync_all().map_err(fail)?;
                std::fs::rename(folder.join("positions.npy"), &self.out).map_err(fail)
            }
            Layout::Columns(files) => {
                files.iter().try_for_each(File::sync_all).map_err(fail)?;
                write_sidecar(&folder.join(SIDECAR), kept).map_err(fail)?;
                if !self.out.is_dir() {
                    let kept = self.folder.keep();
                    return std::fs::rename(&kept, &self.out).map_err(|e| {
                        // The copy without its place is of no use; the rename's error is what counts.
                        let _ = std::fs::remove_dir_all(&kept);
                        Error::io(&self.out, e)
                    });
                }
                let names = COLUMNS[..files.len()].iter().chain([&SIDECAR]);
                names.copied().try_for_each(|n| std::fs::rename(folder.join(n), self.out.join(n))).map_err(fail)
            }
        }
    }
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// A folder that is removed unless kept, as readable as any new folder.
fn temporary_folder(beside: &Path) -> std::io::Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".particlegs-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o777));
    }
    builder.tempdir_in(beside)
}

/// Header of a little-endian f32 array of shape (count, 3), padded to a multiple of 64 bytes.
fn npy_header(count: u64) -> Vec<u8> {
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}");
    while (10 + text.len() + 1) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

/// meta.json in the form that opening a folder reads; unknown things are left out.
fn write_sidecar(path: &Path, kept: &Kept<'_>) -> std::io::Result<()> {
    let meta = kept.meta();
    let mut form =
        serde_json::json!({ "name": meta.name, "order": "layer by layer, tile by tile, particles in input order" });
    match &meta.cell {
        Some(cell) if cell.origin == [0.0; 3] && cell.lengths().is_some() => {
            form["box"] = serde_json::json!(cell.lengths());
            let all = cell.periodic.iter().all(|p| *p);
            form["periodic"] = if all { true.into() } else { serde_json::json!(cell.periodic) };
        }
        Some(cell) => form["cell"] = serde_json::json!(cell),
        None => {}
    }
    let layers = kept.layers();
    if layers.len() > 1 || layers.iter().any(|l| l.name != ONE_LAYER) {
        let layer = |l: &KeptLayer| {
            serde_json::json!({
                "name": l.name,
                "particles": l.range.end - l.range.start,
                "particle_mass": l.particle_mass,
                "weighted": l.weighted,
            })
        };
        form["layers"] = layers.iter().map(layer).collect();
    }
    let mut set = |key: &str, value: serde_json::Value| {
        if !value.is_null() {
            form[key] = value;
        }
    };
    set("length_unit", meta.length_unit.clone().into());
    set("mass_unit", meta.mass_unit.clone().into());
    set("particle_mass", meta.particle_mass.into());
    set("comoving", meta.comoving.into());
    set("scale_factor", meta.scale_factor.into());
    set("h", meta.hubble.into());
    set("time", meta.time.into());
    set("made_from", kept.notes());
    let mut file = File::create(path)?;
    file.write_all(&serde_json::to_vec_pretty(&form)?)?;
    file.write_all(b"\n")?;
    file.sync_all()
}
