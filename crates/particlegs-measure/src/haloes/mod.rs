//! Haloes of particles or of a model.
//!
//! Dark matter is linked by friends of friends ([`crate::stats`]'s `groups`), the other species attached to it
//! (`members`). Each group's density peak is the centre of spheres whose mean densities the cosmology gives
//! (`overdensity`). Measures inside them (`sphere`, `properties`) become a catalogue (`find`, `columns`, `table`). Of a
//! model, particles are drawn to find the centres, and masses are integrated over its Gaussians (`mass_curve`).
//! Catalogues are compared (`matching`) and counted by mass (`mass_function`): a `report` has it all.

mod columns;
mod dense;
mod find;
mod mass_curve;
mod mass_function;
mod matching;
mod members;
mod overdensity;
mod properties;
mod report;
mod sphere;
mod table;

pub use find::{HaloOptions, find_haloes};
pub use mass_function::{MassFunctionBin, mass_function};
pub use matching::HaloMatch;
pub use overdensity::stated_cosmology;
pub use report::HaloReport;
pub use table::{HaloCatalogue, HaloColumn};
