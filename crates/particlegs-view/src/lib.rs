//! The page that shows models in a browser: as one file that works offline, or served to one user.
//!
//! [`page`] assembles the page from `assets/`, [`poster`] draws its first picture, [`server`] serves it, and [`truth`]
//! draws all particles for it. The sources of the page itself are in `web/`. Nothing here prints, reads the
//! environment or opens a file.

#![allow(missing_docs)]

mod assets;
mod markup;
mod opening;
pub mod page;
pub mod poster;
pub mod server;
pub mod truth;
pub mod tunnel;
