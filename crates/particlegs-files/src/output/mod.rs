//! The one place that opens outputs: whole or not at all, and never over what was not meant.
//!
//! A file is written without a name and appears when it is whole; a link is followed, and the file
//! behind it is replaced. What is no regular file (a device, a pipe, an open descriptor) is written
//! through, and the path `-` is standard output. [`Outputs`] says before the work whether an output is
//! an input, another output, or there already.

mod folder;
mod kind;
pub mod kinds;
mod names;
mod place;
mod placed;
mod plan;
mod planned;
mod state;
mod temporary;
mod work;
mod write;

pub use folder::{FileSet, WholeFolder};
pub use kind::{Kind, ending};
pub use names::is_temporary;
pub use placed::{PlacedFile, check_space, check_space_in, scratch_file, write_at};
pub use plan::{Input, Outputs};
pub use work::WorkFolder;
pub use write::{
    check_writable, is_stream, json_text, npy_header, open_log, scratch_folder, write_atomic, write_bytes, write_json,
};

#[cfg(test)]
mod tests;
