//! The one place that opens outputs: whole or not at all, and never over what was not meant.
//!
//! A file is written without a name and appears when it is whole; a link is followed, and the file
//! behind it is replaced. What is no regular file (a device, a pipe, an open descriptor) is written
//! through, and the path `-` is standard output. [`Outputs`] says before the work whether an output is
//! an input, another output, or there already.

mod ending;
mod folder;
mod identity;
mod kind;
pub mod kinds;
mod names;
mod npy;
mod place;
mod placed;
mod plan;
mod planned;
mod scratch;
mod set;
mod space;
mod state;
mod temporary;
mod work;
mod write;

pub use ending::ending;
pub use folder::WholeFolder;
pub use kind::Kind;
pub use names::is_temporary;
pub use npy::npy_header;
pub use placed::{PlacedFile, write_at};
pub use plan::{Input, Outputs};
pub use scratch::scratch_file;
pub use set::FileSet;
pub use space::{check_space, check_space_in};
pub use work::WorkFolder;
pub use write::{
    check_writable, is_stream, json_text, open_log, scratch_folder, write_atomic, write_bytes, write_json,
};

#[cfg(test)]
mod tests;
