//! What the machine gives and takes: files that a user names are opened by [`input`], within bounds;
//! files are made by [`output`], whole or not at all, and never over an input; [`memory`] says how much
//! of it there is.

#![allow(missing_docs)]

pub mod input;
pub mod memory;
pub mod output;

use particlegs_core::{Error, Result, context};
