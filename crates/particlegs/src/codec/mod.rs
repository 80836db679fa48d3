//! Floor 3: model files as files; their bytes are [`particlegs_core::codec`]'s.

mod read;

pub use particlegs_core::codec::*;
pub use read::{read_file, read_source};
