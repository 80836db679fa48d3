//! The whole job: a snapshot, a target, an effort in; a model file's bytes out.
//!
//! [`Target`] says what is asked for, `describe` what is known about the snapshot, [`compress`]
//! chooses how many Gaussians at how many bits, fits, codes, decodes and measures; [`simplify()`]
//! makes a file smaller without the particles, [`finetune()`] trains a merged file on the whole snapshot.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod block;
mod budget;
mod certify;
mod checkpoint;
mod clock;
mod describe;
mod executor;
mod field_agreement;
mod fields;
mod finetune;
mod held_power;
pub mod job;
mod joined_fields;
mod layer;
mod memory;
mod options;
mod plan;
mod run;
mod search;
pub mod series;
mod shared_species;
mod sharing_trial;
mod simplify;
mod size;
mod thickness;
pub mod verify;

pub(crate) use block::{BlockParticles, CodedBlock};
pub(crate) use certify::DecodedFile;
pub use certify::{certify, measured_bytes};
pub use checkpoint::Checkpoint;
pub use describe::{differences_from, source_difference};
pub(crate) use executor::{BlockStore, do_block};
pub(crate) use fields::FieldPlan;
pub use fields::{FieldSelection, MOST_FIELDS};
pub use finetune::{FineTuning, finetune};
pub(crate) use memory::MemoryLoad;
pub use options::{Options, SharingPolicy};
pub use particlegs_core::model::Target;
pub(crate) use plan::{BlockSetup, CompressionPlan, StopPolicy, near_pixel};
pub use run::{CompressedModel, Compression, compress};
pub use simplify::simplify;
pub(crate) use size::SizeOutcome;
