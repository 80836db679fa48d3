//! Particles to models and back: the parts beneath `particlegs`, which is what a user imports.
//!
//! A snapshot becomes a mixture ([`fit`]), a mixture becomes a file ([`codec`]), a file becomes
//! pictures ([`render`]) and numbers ([`score`]). The modules stand in floors; each uses only the
//! floors below it (see ARCHITECTURE.md).
//!
//! The picture law is the optical depth: white splats blended over black are `1 - exp(-tau)` with
//! `tau` a plain sum, so a mixture of Gaussians that carry counts follows any view, particle
//! radius and opacity in closed form.

pub use particlegs_core::{checkpoint, context, error, math, model, parallel, render, space, splat, text};

pub mod camera;
pub mod particles;
pub mod picture;

pub mod codec;
pub mod fit;
pub mod reference;

mod blocks;
pub mod recover;
pub mod stats;
pub use particlegs_train as train;

pub mod haloes;
pub mod score;

pub mod compress;

pub mod job;
pub mod series;
pub mod verify;

#[cfg(test)]
mod law_tests;
#[cfg(test)]
mod testing;

pub use particlegs_core::{Error, Hint, NamedValue, Result, named_values};
