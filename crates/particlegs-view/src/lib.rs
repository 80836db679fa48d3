//! The page that shows models in a browser, as one file that works offline.
//!
//! [`page`] assembles the page from `assets/`, and [`poster`] draws its first picture. The sources of the page itself are in `web/`; `particlegs-server` serves it. Nothing here prints, reads the
//! environment or opens a file.

#![allow(missing_docs)]

pub mod assets;
mod markup;
mod opening;
pub mod page;
pub mod poster;
