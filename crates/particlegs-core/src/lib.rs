//! Mixtures of Gaussians as bytes and as pictures.
//!
//! A model file is decoded from bytes ([`codec`]), held as columns ([`model`]), and drawn into a
//! picture ([`render`]) that [`splat`] turns into grey levels. No files, no clock, no state of its own: the
//! caller's [`context::Context`] says which instruction set to use and how much memory there is. Without the
//! feature `threads` no threads either.

// clippy.toml: functions whose bits are the platform's. Tests compare with them.
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod checkpoint;
pub mod context;
pub mod error;
mod hash;
pub mod math;
pub mod memory;
mod named;
pub mod parallel;
pub mod space;
pub mod text;

pub mod camera;
pub mod picture;
pub mod splat;

pub mod model;

pub mod codec;
pub mod render;

pub use error::{Error, Hint, Result};
pub use named::NamedValue;
