//! Haloes of particles or of a model.
//!
//! Dark matter is linked by friends of friends ([`crate::stats`]'s `groups`), the other species attached to it
//! (`members`). Each group's density peak is the centre of spheres whose mean densities the cosmology gives
//! (`overdensity`). Measures inside them (`sphere`), each particle in one halo (`overlap`), become a catalogue (`find`,
//! `catalogue`). Of a model, particles are
//! drawn to find the centres, and masses are integrated over its Gaussians (`model`). Catalogues are compared
//! (`matching`) and counted by mass: a `report` has it all.

mod catalogue;
mod find;
mod matching;
mod members;
mod model;
mod overdensity;
mod overlap;
mod report;
mod sphere;

pub use catalogue::{HaloCatalogue, HaloColumn};
pub use find::{HaloOptions, find_haloes};
pub use matching::HaloMatch;
pub use overdensity::stated_cosmology;
pub use report::{HaloReport, MassFunctionBin, mass_function};
