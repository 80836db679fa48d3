//! What `stats` and `haloes` measure: a snapshot, with its fields where they are needed, or a model.

use crate::inputs::{self, ModelOrSnapshot};
use crate::snapshot_args::SnapshotArgs;
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_core::{Result, codec};
use particlegs_files::input::name_of;
use particlegs_measure::stats::{StatsSide, Subject};
use particlegs_particles::{LayerFields, Particles, Storage};
use std::path::Path;

pub enum MeasuredInput {
    Particles(Box<Particles>, Vec<LayerFields>),
    Model(Box<Model>),
}

impl MeasuredInput {
    pub fn open(path: &Path, opening: &SnapshotArgs, with_fields: bool, context: &Context<'_>) -> Result<Self> {
        let paths = [path.to_path_buf()];
        Ok(match inputs::model_or_snapshot(path, opening, context)? {
            ModelOrSnapshot::Model(bytes) => {
                let model = opening.layers_of(codec::decode_with(&bytes, &name_of(path), context)?)?;
                MeasuredInput::Model(model.into())
            }
            ModelOrSnapshot::Snapshot(mut choice) if with_fields => {
                let (particles, fields) = choice.read_fields(&paths, &Storage::Memory, context)?;
                MeasuredInput::Particles(particles.into(), fields)
            }
            ModelOrSnapshot::Snapshot(choice) => {
                MeasuredInput::Particles(choice.read(&paths, &Storage::Memory, context)?.into(), Vec::new())
            }
        })
    }

    pub fn side(&self) -> StatsSide<'_> {
        match self {
            MeasuredInput::Particles(p, fields) => StatsSide { subject: Subject::Particles(p), fields },
            MeasuredInput::Model(m) => Subject::Model(m).into(),
        }
    }
}
