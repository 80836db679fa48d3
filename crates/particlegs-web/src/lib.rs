//! What a page needs of a model: to decode it, draw it, hand its footprints to a graphics card, and answer what is
//! under the pointer. Compiled to WebAssembly it is a page's engine (`exported`), behind one call: a question in JSON,
//! and an answer in JSON with numbers behind it. It knows no page and keeps nothing but the models.

// Docs stand where a name does not say it.
#![allow(missing_docs)]

mod about;
mod answer;
mod clip;
mod coarse;
mod engine;
mod opened;
mod picture;
mod probe;
mod question;
mod strokes;

#[cfg(target_arch = "wasm32")]
mod exported;

pub use answer::EngineResponse;
pub use engine::Engine;
