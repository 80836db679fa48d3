//! Snapshots out: raw float32 columns with meta.json, or one .npy; whole or not at all.

use super::select::Run;
use super::{Number, Particles, SnapshotMeta};
use particlegs_core::model::Layer;
use particlegs_core::{Error, Result};
use particlegs_files::output::{PlacedFile, WholeFolder, check_space, npy_header, write_at};
use std::fs::File;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Column files in the order of a run's columns.
const COLUMNS: [&str; 4] = ["xx.f32", "yy.f32", "zz.f32", "ww.f32"];
const TRIPLES: &str = "positions.npy";
const SIDECAR: &str = "meta.json";

/// The form of particles in the output.
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
    /// The names that a folder of particles may hold, whatever its form.
    pub const FOLDER_FILES: [&str; 6] = [COLUMNS[0], COLUMNS[1], COLUMNS[2], COLUMNS[3], TRIPLES, SIDECAR];
}

/// The description of a snapshot that is written: its meta.json.
pub struct SnapshotDescription<'a> {
    /// Box, units, cosmology; unknown things are left out.
    pub meta: &'a SnapshotMeta,
    /// The f64 point that the columns are relative to.
    pub origin: [f64; 3],
    /// Each layer's particles, by their indices in the columns.
    pub layers: Vec<Layer<Range<u64>>>,
    /// The particles' order, in words.
    pub order: &'static str,
    /// Further keys, for people and programs that know them.
    pub notes: serde_json::Map<String, serde_json::Value>,
}

/// The content of files of particles.
#[derive(Clone, Copy, Debug)]
pub struct SnapshotLayout<'a> {
    /// The form of positions.
    pub form: RawForm,
    /// Number of particles.
    pub count: u64,
    /// Whether there is a column of weights.
    pub weighted: bool,
    /// The point that runs are relative to: columns stay so, triples are about 0.
    pub origin: [f64; 3],
    /// Whether triples are float64.
    pub wide: bool,
    /// File names for the columns of fields that runs have, and their numbers; in the form of columns alone.
    pub fields: &'a [(String, Number)],
}

/// A snapshot being written: files of final length beside their place, which go away unless
/// [`SnapshotWriter::finish`] moves them there together.
pub struct SnapshotWriter {
    out: PathBuf,
    form: RawForm,
    target: WriteTarget,
    /// Bytes before the triples.
    header: u64,
    /// The point that runs are relative to.
    origin: [f64; 3],
    /// Whether triples are float64.
    wide: bool,
    /// Columns of fields after those of positions and weights.
    fields: Vec<Number>,
}

enum WriteTarget {
    File(PlacedFile),
    /// A folder with these files: columns, or one of triples.
    Folder(WholeFolder, Vec<File>),
}

impl SnapshotWriter {
    /// Opens files for particles of this layout. A folder that is there is replaced by the new one as a whole.
    pub fn create(out: &Path, layout: &SnapshotLayout<'_>) -> Result<Self> {
        let SnapshotLayout { form, count, weighted, origin, wide, fields } = *layout;
        if form != RawForm::Columns && !fields.is_empty() {
            return Err(Error::input_with(
                out,
                "an .npy file of positions cannot store the fields",
                "write to a folder instead",
            ));
        }
        // Columns keep their digits as float32 about the origin, which meta.json states.
        let wide = wide && form != RawForm::Columns;
        if form != RawForm::Columns && weighted {
            return Err(Error::input_with(
                out,
                "an .npy file of positions cannot store the weights",
                "write to a folder instead",
            ));
        }
        let header = if form == RawForm::Columns {
            Vec::new()
        } else {
            npy_header(if wide { "<f8" } else { "<f4" }, &[count, 3])
        };
        let of_fields: u64 = fields.iter().map(|(_, number)| number.bytes()).sum();
        let bytes = particle_bytes(wide, weighted) + of_fields;
        let bytes = count.saturating_mul(bytes).saturating_add(header.len() as u64);
        let target = match form {
            RawForm::Npy => {
                let file = PlacedFile::create(out, bytes)?;
                file.write_at(&header, 0)?;
                WriteTarget::File(file)
            }
            RawForm::Columns => {
                let names = COLUMNS[..if weighted { 4 } else { 3 }].iter().copied();
                let names: Vec<&str> = names.chain(fields.iter().map(|(name, _)| &name[..])).collect();
                folder(out, &names, bytes, &header)?
            }
            RawForm::NpyFolder => folder(out, &[TRIPLES], bytes, &header)?,
        };
        Ok(SnapshotWriter {
            out: out.to_path_buf(),
            form,
            target,
            header: header.len() as u64,
            origin,
            wide,
            fields: fields.iter().map(|(_, number)| *number).collect(),
        })
    }

    /// Bytes of a particle in the output.
    pub fn particle_bytes(&self, weighted: bool) -> u64 {
        particle_bytes(self.wide, weighted) + self.fields.iter().map(|number| number.bytes()).sum::<u64>()
    }

    /// Writes a run at particle `first`; runs may come in any order and from several threads.
    /// `triples` is scratch space.
    pub fn write(&self, first: u64, run: &Run, triples: &mut Vec<u8>) -> Result<()> {
        triples.clear();
        if self.wide {
            triples.extend((0..run.columns[0].len()).flat_map(|i| run.wide(self.origin, i)).flat_map(f64::to_le_bytes));
        } else if self.form != RawForm::Columns {
            let [x, y, z, _] = &run.columns;
            triples.extend((0..x.len()).flat_map(|i| [x[i], y[i], z[i]]).flat_map(f32::to_le_bytes));
        }
        let place = self.header + particle_bytes(self.wide, false) * first;
        let done = match &self.target {
            WriteTarget::File(file) => return file.write_at(triples, place),
            WriteTarget::Folder(_, files) if self.form == RawForm::Columns => {
                let (position_files, fields) = files.split_at(files.len() - self.fields.len());
                let mut columns = position_files.iter().zip(&run.columns);
                columns.try_for_each(|(file, column)| write_at(file, bytemuck::cast_slice(column), 4 * first)).and_then(
                    |()| {
                        fields.iter().zip(&self.fields).zip(&run.fields).try_for_each(|((file, number), column)| {
                            triples.clear();
                            column.iter().for_each(|&v| number.append(number.stored(v), triples));
                            write_at(file, triples, number.bytes() * first)
                        })
                    },
                )
            }
            WriteTarget::Folder(_, files) => write_at(&files[0], triples, place),
        };
        done.map_err(|e| Error::io(&self.out, e))
    }

    /// Syncs the files and moves them to their place; what is known goes beside them.
    pub fn finish(self, described: &SnapshotDescription<'_>) -> Result<()> {
        let fail = |e| Error::io(&self.out, e);
        match self.target {
            WriteTarget::File(file) => file.finish(),
            WriteTarget::Folder(folder, files) => {
                files.iter().try_for_each(File::sync_all).map_err(fail)?;
                write_sidecar(&folder.path().join(SIDECAR), described).map_err(fail)?;
                folder.finish()
            }
        }
    }
}

/// Bytes of a particle's position, float64 or not, and of its weight.
fn particle_bytes(wide: bool, weighted: bool) -> u64 {
    // Triples, which alone may be float64, have no weights.
    if wide { 24 } else { 12 + if weighted { 4 } else { 0 } }
}

/// A folder with files of these names, each with `header` in front.
fn folder(out: &Path, names: &[&str], bytes: u64, header: &[u8]) -> Result<WriteTarget> {
    let file_names: Vec<&str> = RawForm::FOLDER_FILES.iter().chain(names).copied().collect();
    let folder = WholeFolder::create(out, &file_names)?;
    let create = |name: &&str| {
        let mut file = File::create(folder.path().join(name))?;
        file.write_all(header)?;
        Ok(file)
    };
    let files = check_space(folder.path(), bytes).and_then(|()| names.iter().map(create).collect());
    let files: Vec<_> = files.map_err(|e: std::io::Error| Error::io(out, e))?;
    Ok(WriteTarget::Folder(folder, files))
}

/// meta.json in the form that opening a folder reads; unknown things are left out.
fn write_sidecar(path: &Path, described: &SnapshotDescription<'_>) -> std::io::Result<()> {
    let meta = described.meta;
    let mut form = serde_json::json!({ "name": meta.name, "order": described.order });
    if described.origin != [0.0; 3] {
        form["origin"] = serde_json::json!(described.origin);
    }
    match &meta.cell {
        Some(cell) if cell.origin == [0.0; 3] && cell.lengths().is_some_and(|l| l.iter().all(|l| *l > 0.0)) => {
            form["box"] = serde_json::json!(cell.lengths());
            let all = cell.periodic.iter().all(|p| *p);
            form["periodic"] = if all { true.into() } else { serde_json::json!(cell.periodic) };
        }
        Some(cell) => form["cell"] = serde_json::json!(cell),
        None => {}
    }
    let layers = &described.layers;
    if layers.len() > 1 || layers.iter().any(|l| l.name != Particles::ONE_LAYER) {
        let layer = |l: &Layer<Range<u64>>| {
            serde_json::json!({
                "name": l.name,
                "particles": l.content.end - l.content.start,
                "particle_mass": l.mass.unit(),
                "weighted": l.mass.is_weighted(),
            })
        };
        form["layers"] = layers.iter().map(layer).collect();
    }
    let mut set = |key: &str, value: serde_json::Value| {
        if !value.is_null() {
            form[key] = value;
        }
    };
    set("length_unit", meta.units.length_text().into());
    set("mass_unit", meta.units.mass_text().into());
    set("time_unit", meta.units.time.as_ref().map(|u| &u.text[..]).into());
    set("particle_mass", meta.particle_mass.into());
    set("comoving", meta.units.comoving.into());
    set("scale_factor", meta.epoch.scale_factor.into());
    set("h", meta.cosmology.hubble.into());
    set("omega_matter", meta.cosmology.omega_matter.into());
    set("omega_lambda", meta.cosmology.omega_lambda.into());
    set("omega_baryon", meta.cosmology.omega_baryon.into());
    if !meta.field_units.is_empty() {
        set("field_units", serde_json::json!(meta.field_units));
    }
    set("time", meta.epoch.time.into());
    set("frame", meta.epoch.frame.into());
    set("step", meta.epoch.step.into());
    described.notes.iter().for_each(|(key, value)| set(key, value.clone()));
    let mut file = File::create(path)?;
    file.write_all(&serde_json::to_vec_pretty(&form)?)?;
    file.write_all(b"\n")?;
    file.sync_all()
}
