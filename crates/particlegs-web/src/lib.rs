//! The engine of the page: it decodes models, draws them, gives their footprints to the GPU, and finds what is under
//! the pointer. Compiled to WebAssembly (`exported`) it has one call: a query in JSON, answered by JSON followed by
//! numbers. It keeps nothing but the models.

#![allow(missing_docs)]

mod about;
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

pub use engine::Engine;
pub use question::EngineResponse;
