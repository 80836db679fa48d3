//! Compression with the command's options.

use crate::errors::{InputError, IntoPyResult, named};
use crate::model::Model;
use crate::snapshot::Snapshot;
use crate::work::WorkOptions;
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use particlegs::RunOptions;
use particlegs_compress::{Options, Target};
use particlegs_core::Error;
use particlegs_core::model::{CertificateLevel, Goal, GoalKind, LawKind, Layer};
use particlegs_files::output::Outputs;
use particlegs_particles::{LayerFields, Number, Particles, SourceField, Storage};
use particlegs_train::{Config, Preset};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Options; the names are those of the command.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct CompressOptions {
    ratio: Option<f64>,
    size: Option<u64>,
    gaussians: Option<u64>,
    psnr: Option<f64>,
    /// The measure, its target, and the wave number, cell edge or group size it applies to.
    goal: Option<(String, f64, f64)>,
    effort: String,
    radius: Option<f64>,
    opacity: Option<f64>,
    train: Option<String>,
    law: Option<String>,
    certificate: String,
    memory: Option<u64>,
    blocks: Option<u32>,
    share_gaussians: String,
    /// Names of fields of the snapshot's files.
    pub fields: Vec<String>,
    size_with_fields: bool,
    seed: u64,
}

impl CompressOptions {
    fn target(&self) -> PyResult<Target> {
        let targets = [
            self.ratio.map(Target::Ratio),
            self.size.map(Target::Size),
            self.gaussians.map(Target::Gaussians),
            self.psnr.map(Target::Psnr),
            self.goal.as_ref().map(|(kind, limit, at)| goal(kind, *limit, *at)).transpose()?,
        ];
        let mut targets = targets.into_iter().flatten();
        match (targets.next(), targets.next()) {
            (None, _) => Ok(Target::Default),
            (Some(one), None) => one.check().or_raise(),
            _ => Err(InputError::new_err("only one target can be met: ratio, size, gaussians, psnr or a goal")),
        }
    }

    fn training(&self) -> PyResult<Option<Config>> {
        let preset: Preset = match self.train.as_deref() {
            None => match self.law {
                None => return Ok(None),
                Some(_) => return Err(InputError::new_err("law= needs train=")),
            },
            Some(name) => named("train", name)?,
        };
        let law: Option<LawKind> = self.law.as_ref().map(|name| named("law", name)).transpose()?;
        Ok(Some(Config::preset(preset, law.unwrap_or_default())))
    }

    pub fn options(&self, read: &BTreeMap<String, String>) -> PyResult<Options> {
        let options = Options {
            target: self.target()?,
            effort: named("effort", &self.effort)?,
            radius: self.radius,
            opacity: self.opacity,
            training: self.training()?,
            seed: self.seed,
            blocks: self.blocks,
            memory: self.memory,
            sharing: self
                .share_gaussians
                .parse()
                .map_err(|why| InputError::new_err(format!("share_gaussians=\"{}\": {why}", self.share_gaussians)))?,
            certificate: match named("certificate", &self.certificate)? {
                CertificateLevel::Blocks => {
                    return Err(InputError::new_err("certificate must be none, quick or full, not \"blocks\""));
                }
                level => level,
            },
            fields: self.fields.clone(),
            size_with_fields: self.size_with_fields,
            read: read.clone(),
            ..Options::default()
        };
        options.check().or_raise()?;
        Ok(options)
    }
}

fn goal(kind: &str, limit: f64, at: f64) -> PyResult<Target> {
    let kind = match kind {
        "max_pk_error" => GoalKind::PowerSpectrum,
        "min_correlation" => GoalKind::Correlation,
        "groups_within" => GoalKind::Groups,
        other => return Err(InputError::new_err(format!("there is no goal \"{other}\""))),
    };
    Ok(Target::Goal(Goal { kind, asked: limit, at }))
}

/// A field as an array: name, unit, values of shape (n,) or (n, 3).
pub type FieldArray<'py> = (String, Option<String>, PyReadonlyArrayDyn<'py, f64>);

/// Fields of each layer of the particles.
pub fn layer_fields(particles: &Particles, arrays: &[FieldArray<'_>]) -> PyResult<Vec<LayerFields>> {
    let mut fields: Vec<(SourceField, Vec<Vec<f64>>)> = Vec::with_capacity(arrays.len());
    for (name, unit, array) in arrays {
        let shape = array.shape();
        let components = match shape {
            [n] if *n == particles.len() => 1,
            [n, 3] if *n == particles.len() => 3,
            _ => {
                let n = particles.len();
                let message = format!("field \"{name}\" must have the shape ({n},) or ({n}, 3), not {shape:?}");
                return Err(InputError::new_err(message));
            }
        };
        let values = array.as_array();
        let rows: Vec<f64> = values.iter().copied().collect();
        let columns = (0..components).map(|k| rows.iter().skip(k).step_by(components).copied().collect()).collect();
        let (name, unit, components) = (name.clone(), unit.clone(), components as u32);
        let field = SourceField { name, number: Number::F64, components, unit, attributes: Vec::new(), physical: None };
        fields.push((field, columns));
    }
    // Vectors first, as readers give them.
    fields.sort_by_key(|(field, _)| field.components != 3);
    let fields_of = |layer: &Layer<std::ops::Range<usize>>| {
        let columns = fields.iter().flat_map(|(_, columns)| columns).map(|c| c[layer.content.clone()].to_vec());
        LayerFields::from_columns(fields.iter().map(|(field, _)| field.clone()).collect(), columns.collect())
    };
    Ok(particles.layers().iter().map(fields_of).collect())
}

/// The file of a model, and options of a run that is continued.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct OutputOptions {
    output: Option<PathBuf>,
    overwrite: bool,
    resume: bool,
    scratch: Option<PathBuf>,
}

/// Compresses a snapshot with fields: arrays, or those of its files that the options name. With an output the model is
/// written there, and training keeps a checkpoint beside it.
#[pyfunction]
#[pyo3(signature = (snapshot, asked, target, fields=Vec::new(), threads=None, progress=None))]
pub fn compress(
    py: Python<'_>,
    snapshot: &Snapshot,
    mut asked: CompressOptions,
    target: OutputOptions,
    fields: Vec<FieldArray<'_>>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let from_files = !asked.fields.is_empty();
    asked.fields.extend(fields.iter().map(|f| f.0.clone()));
    let mut options = asked.options(&snapshot.read)?;
    if let (Some(folder), Some(_)) = (&target.scratch, options.memory) {
        options.storage = Storage::Disk(folder.clone());
    }
    let arrays = layer_fields(snapshot.checked()?, &fields)?;
    let (outputs, replace) = (Outputs::new(target.overwrite), target.overwrite);
    let run = RunOptions { resume: target.resume, replace, scratch: target.scratch, ..RunOptions::default() };
    let model = WorkOptions { threads, progress }.run(py, |context| {
        let fields = if from_files { snapshot.layer_fields(context)? } else { arrays };
        if from_files && fields.is_empty() {
            return Err(Error::argument("fields cannot be read from this selection of particles"));
        }
        let source = snapshot.source(fields, false, context)?;
        let Some(out) = &target.output else { return particlegs::compress(&source, &options, context) };
        let compressed_model = particlegs::compress_into(&source, out, (&options, &run), &outputs, context)?.made;
        particlegs::Model::decode(compressed_model.bytes, &out.display().to_string(), context)
    })?;
    Ok(model.into())
}
