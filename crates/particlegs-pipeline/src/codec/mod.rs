//! Floor 3: model files as files; their bytes are [`particlegs_core::codec`]'s.

mod read;

pub use particlegs_core::codec::*;
pub(crate) use read::read_file;
pub use read::{check_name, is_of_several, read_source};
