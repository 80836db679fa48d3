//! Snapshots out: raw float32 columns with meta.json, or one .npy; whole or not at all.

use super::select::{KeptLayer, Run};
use super::{ONE_LAYER, SnapshotMeta};
use crate::output::{check_space, write_at};
use crate::{Error, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Column files in the order of a run's columns.
const COLUMNS: [&str; 4] = ["xx.f32", "yy.f32", "zz.f32", "ww.f32"];
const TRIPLES: &str = "positions.npy";
const SIDECAR: &str = "meta.json";

/// How particles lie in the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawForm {
    /// A folder with xx.f32, yy.f32, zz.f32, perhaps ww.f32, and meta.json.
    Columns,
    /// One .npy of triples, alone.
    Npy,
    /// A folder with positions.npy and meta.json.
    NpyFolder,
}

impl RawForm {
    /// What the name of an output means: a .npy, or a folder of columns.
    pub fn of_name(out: &Path) -> Self {
        if out.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) { RawForm::Npy } else { RawForm::Columns }
    }
}

/// What is known about a snapshot that is written: its meta.json.
pub struct Described<'a> {
    /// Box, units, cosmology; unknown things are left out.
    pub meta: &'a SnapshotMeta,
    /// Layers, one after the other.
    pub layers: Vec<KeptLayer>,
    /// The particles' order, in words.
    pub order: &'static str,
    /// Further keys, for people and programs that know them.
    pub notes: serde_json::Map<String, serde_json::Value>,
}

/// A snapshot being written: files of final length in a temporary folder beside their place, which
/// goes away unless [`SnapshotWriter::finish`] moves them there.
pub struct SnapshotWriter {
    out: PathBuf,
    folder: tempfile::TempDir,
    form: RawForm,
    /// Names and files: columns, or one of triples after a header of so many bytes.
    files: Vec<(&'static str, File)>,
    header: u64,
}

impl SnapshotWriter {
    /// Opens files for `count` particles.
    ///
    /// # Errors
    /// [`Error::Io`] where the place cannot be written or the disk has no room; [`Error::Input`]
    /// where weights would be lost, or a stale file beside the new ones would be taken for theirs.
    pub fn create(out: &Path, form: RawForm, count: u64, weighted: bool) -> Result<Self> {
        if form != RawForm::Columns && weighted {
            return Err(Error::input_hint(
                out,
                "an .npy file of positions cannot store the weights",
                "name a folder instead",
            ));
        }
        let names = match form {
            RawForm::Columns if weighted => &COLUMNS[..],
            RawForm::Columns => &COLUMNS[..3],
            RawForm::Npy | RawForm::NpyFolder => &[TRIPLES],
        };
        let stale: &[&str] = match form {
            RawForm::Columns => &COLUMNS[names.len()..],
            RawForm::Npy => &[],
            RawForm::NpyFolder => &COLUMNS,
        };
        if let Some(name) = stale.iter().find(|n| out.join(n).exists()) {
            return Err(Error::input_hint(
                out,
                format!("its {name} belongs to another snapshot and would be taken for this one's"),
                "remove it, or name another folder",
            ));
        }
        let beside = if form != RawForm::Npy && out.is_dir() { out } else { parent(out) };
        let folder = temporary_folder(beside).map_err(|e| Error::io(out, e))?;
        let bytes = count.saturating_mul(if weighted { 16 } else { 12 });
        check_space(folder.path(), bytes).map_err(|e| Error::io(out, e))?;
        let create = |name: &'static str| Ok((name, File::create(folder.path().join(name))?));
        let files: std::io::Result<Vec<_>> = names.iter().copied().map(create).collect();
        let mut files = files.map_err(|e| Error::io(out, e))?;
        let mut header = 0;
        if form != RawForm::Columns {
            let head = npy_header(count);
            files[0].1.write_all(&head).map_err(|e| Error::io(out, e))?;
            header = head.len() as u64;
        }
        Ok(SnapshotWriter { out: out.to_path_buf(), folder, form, files, header })
    }

    /// Writes a run at particle `first`; runs may come in any order and from several threads.
    /// `triples` is scratch space.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, first: u64, run: &Run, triples: &mut Vec<f32>) -> Result<()> {
        let done = if self.form == RawForm::Columns {
            let mut columns = self.files.iter().zip(&run.columns);
            columns.try_for_each(|((_, file), column)| write_at(file, bytemuck::cast_slice(column), 4 * first))
        } else {
            let [x, y, z, _] = &run.columns;
            triples.clear();
            triples.extend((0..x.len()).flat_map(|i| [x[i], y[i], z[i]]));
            write_at(&self.files[0].1, bytemuck::cast_slice(triples), self.header + 12 * first)
        };
        done.map_err(|e| Error::io(&self.out, e))
    }

    /// Syncs the files and moves them to their place; what is known goes beside them.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(self, described: &Described<'_>) -> Result<()> {
        let fail = |e| Error::io(&self.out, e);
        let folder = self.folder.path();
        self.files.iter().try_for_each(|f| f.1.sync_all()).map_err(fail)?;
        if self.form == RawForm::Npy {
            return std::fs::rename(folder.join(TRIPLES), &self.out).map_err(fail);
        }
        write_sidecar(&folder.join(SIDECAR), described).map_err(fail)?;
        if !self.out.is_dir() {
            let kept = self.folder.keep();
            return std::fs::rename(&kept, &self.out).map_err(|e| {
                // The copy without its place is of no use; the rename's error is what counts.
                let _ = std::fs::remove_dir_all(&kept);
                Error::io(&self.out, e)
            });
        }
        let mut names = self.files.iter().map(|f| f.0).chain([SIDECAR]);
        names.try_for_each(|n| std::fs::rename(folder.join(n), self.out.join(n))).map_err(fail)
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
fn write_sidecar(path: &Path, described: &Described<'_>) -> std::io::Result<()> {
    let meta = described.meta;
    let mut form = serde_json::json!({ "name": meta.name, "order": described.order });
    match &meta.cell {
        Some(cell) if cell.origin == [0.0; 3] && cell.lengths().is_some() => {
            form["box"] = serde_json::json!(cell.lengths());
            let all = cell.periodic.iter().all(|p| *p);
            form["periodic"] = if all { true.into() } else { serde_json::json!(cell.periodic) };
        }
        Some(cell) => form["cell"] = serde_json::json!(cell),
        None => {}
    }
    let layers = &described.layers;
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
    described.notes.iter().for_each(|(key, value)| set(key, value.clone()));
    let mut file = File::create(path)?;
    file.write_all(&serde_json::to_vec_pretty(&form)?)?;
    file.write_all(b"\n")?;
    file.sync_all()
}
