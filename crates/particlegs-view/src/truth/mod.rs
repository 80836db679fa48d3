//! Pictures of all particles for the page, by the reference renderer: one at a time, the newest first.
//!
//! [`Question`] is what the page asks, checked; `desk` takes questions from connections and hands them to the one
//! thread that draws.

pub(crate) mod desk;
mod question;

pub use question::Question;
