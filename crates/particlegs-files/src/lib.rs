//! What the machine gives and takes: files that a user names are opened by [`input`], within bounds;
//! files are made by [`output`], whole or not at all, and never over an input; [`memory`] says how much
//! of it there is.

#![allow(missing_docs)]

#[cfg(not(any(unix, windows)))]
compile_error!("files are read and written on Unix and Windows alone; particlegs-core works without any");

pub mod input;
pub mod memory;
pub mod output;

use particlegs_core::{Error, Result, context};
