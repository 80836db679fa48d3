//! A mixture becomes particles again: synthetic ones, drawn from it.
//!
//! A `plan` says how many particles each Gaussian gets (its own number, or a share of another
//! total) and cuts each layer into runs of 65 536. A run's draws belong to (seed, layer, run), so
//! that threads do not matter: `normals` makes standard normals many at once, `draw` places them
//! by the [`Method`] and draws fields (`two_normals` those that are logarithms, `two_phases` where these are cold
//! and hot gas), `wrap` takes them into the periodic box. [`recover`] streams the runs to disk and writes beside them what they are: synthetic, of which file, and good
//! for what (`notes`); [`Options::draw`] keeps them in memory.

mod draw;
mod in_memory;
mod job;
mod joint;
mod normals;
mod notes;
mod options;
mod plan;
mod quantile;
mod spaced;
mod stratified;
mod two_normals;
mod two_phases;
mod wrap;

pub use in_memory::draw;
pub use job::{drawn_fields, recover};
pub use options::{Method, Options};
pub use stratified::stratify;
