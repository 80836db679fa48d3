//! Particle snapshots as mixtures of Gaussians.
//!
//! A snapshot becomes a mixture ([`fit`]), a mixture becomes a file ([`codec`]), a file becomes
//! pictures ([`render`]) and numbers ([`score`]). The modules stand in floors; each uses only the
//! floors below it (see ARCHITECTURE.md).
//!
//! The picture law is the optical depth: white splats blended over black are `1 - exp(-tau)` with
//! `tau` a plain sum, so a mixture of Gaussians that carry counts follows any view, particle
//! radius and opacity in closed form.
//!
//! ```
//! use particlegs::camera::{View, base_distance, spherical_camera};
//! use particlegs::compress::{Options, Target, compress};
//! use particlegs::checkpoint::NoCheckpoints;
//! use particlegs::model::CertificateLevel;
//! use particlegs::particles::Particles;
//! use particlegs::picture::Size;
//! use particlegs::context::Context;
//! use particlegs::render::{Scene, draw};
//! use particlegs::splat::ToneStyle;
//!
//! // Positions in columns of float32, any unit of length.
//! let column = |k: u32| (0..3000u32).map(|i| (i * (k + 7) % 997) as f32).collect::<Vec<f32>>();
//! let particles = Particles::from_columns(column(1), column(2), column(3));
//!
//! // A file of 100 Gaussians: `made.bytes`, and what they decode to.
//! let options = Options { target: Target::Gaussians(100), certificate: CertificateLevel::None, ..Options::default() };
//! let made = compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT)?;
//! assert_eq!(made.model.metadata.count, 3000);
//!
//! // Its picture from any side, at any particle radius and opacity.
//! let (m, size) = (&made.model.metadata, Size { width: 64, height: 36 });
//! let camera = spherical_camera(m.bounds.center(), 30.0, 20.0, base_distance(&m.bounds, size));
//! let view = View { name: "view".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
//! let picture = draw(&Scene::new(&made.model), &view, size, ToneStyle::Expected, &Context::SILENT)?;
//! assert_eq!(picture.data.len(), 64 * 36);
//! # Ok::<(), particlegs::Error>(())
//! ```

pub use particlegs_core::{checkpoint, context, error, math, model, parallel, render, space, splat};

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

#[cfg(test)]
mod law_tests;
#[cfg(test)]
mod testing;

pub use particlegs_core::{Error, Hint, NamedValue, Result, named_values};
