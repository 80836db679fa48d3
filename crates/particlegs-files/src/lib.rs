//! Files and memory of the machine: files that a user names are opened by [`input`], within bounds;
//! files are made by [`output`], whole or not at all, and never over an input; [`memory`] says how much
//! of it there is. Files of the house are [`png`], [`ViewsFile`] and [`model_file`].

#![allow(missing_docs)]

#[cfg(not(any(unix, windows)))]
compile_error!("files are read and written on Unix and Windows alone; particlegs-core works without any");

pub mod input;
pub mod memory;
pub mod model_file;
pub mod output;
pub mod png;
mod views_file;

pub use views_file::ViewsFile;

use particlegs_core::{Error, Result, context};
