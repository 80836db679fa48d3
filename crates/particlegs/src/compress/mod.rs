//! Floor 6: the whole job: a snapshot, a target, an effort in; a model file's bytes out.
//!
//! [`Target`] says what is asked for, [`describe`] what is known about the snapshot, [`compress`]
//! chooses how many Gaussians at how many bits, fits, codes, decodes and measures; [`simplify()`]
//! makes a file smaller without the particles, [`finetune()`] trains a merged file on the whole snapshot.

mod block;
mod checkpoint;
mod clock;
mod describe;
mod finetune;
mod job;
mod memory;
mod plan;
mod rate;
mod search;
mod simplify;
mod target;

pub use block::{BlockJob, CodedBlock, Outcome, StopMeans, TrainedRun, Workshop};
pub use checkpoint::{Checkpoint, Found};
pub use clock::Clock;
pub use describe::{describe, is_asked_for, is_made_of};
pub use finetune::{FineTuning, finetune};
pub use job::{Compressed, Options, compress, name_of};
pub use memory::Load;
pub use plan::Plan;
pub use simplify::{Simplified, simplify};
pub use target::{Target, parse_bytes};
