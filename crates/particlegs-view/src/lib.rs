//! The page that shows models in a browser: as one file that works offline, or served to one user.
//!
//! [`page`] puts the page together from its sources (`assets/`), [`poster`] draws the picture that it opens with,
//! [`server`] hands it out, and [`truth`] draws all particles for it. What the page does once it is open is written
//! in its own sources. Nothing here prints, reads the environment or opens a file.

// Docs stand where a name does not say it.
#![allow(missing_docs)]

mod assets;
mod markup;
pub mod page;
pub mod poster;
pub mod server;
pub mod truth;
pub mod tunnel;
