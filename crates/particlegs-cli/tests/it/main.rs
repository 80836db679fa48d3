//! End-to-end tests of the command.

mod alpha_blend;
mod bad_input;
#[cfg(feature = "lab")]
mod bench;
mod common;
mod compress;
mod convert;
mod export;
mod fields;
mod figures;
mod forged;
mod formats;
mod gpu;
mod haloes;
mod help;
mod inputs;
mod job;
mod look;
mod meanwhile;
mod merge_simplify_recover;
mod options;
mod outputs;
mod planner;
mod quality;
mod scores;
mod series;
mod species;
mod stats;
mod terminal;
mod train;
mod units;
mod verify;
mod view;
