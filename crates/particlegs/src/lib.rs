//! Particle snapshots as mixtures of Gaussians.
//!
//! A snapshot becomes a mixture ([`fit`]), a mixture becomes a file ([`codec`]), a file becomes
//! pictures ([`render`]) and numbers ([`score`]). The modules stand in floors; each uses only the
//! floors below it (see ARCHITECTURE.md).
//!
//! The picture law is the optical depth: white splats blended over black are `1 - exp(-tau)` with
//! `tau` a plain sum, so a mixture of Gaussians that carry counts follows any view, particle
//! radius and opacity in closed form.

pub use particlegs_core::{error, math, model, pieces, progress, render, space, splat};

pub mod input;
pub mod memory;
pub mod output;

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

pub mod score;

pub mod compress;

pub mod job;

pub use particlegs_core::{Error, Remedy, Result};
