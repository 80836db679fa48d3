//! End-to-end tests of the command.

mod alpha_blend;
mod bad_input;
#[cfg(feature = "lab")]
mod bench;
mod common;
mod compress;
mod convert;
mod eval;
mod export;
mod fields;
mod figures;
mod forged;
mod formats;
mod gpu;
mod help;
mod inputs;
mod job;
mod look;
mod meanwhile;
mod memory;
mod merge_recover;
mod models;
mod odd_options;
mod options;
mod outputs;
mod planner;
mod simplify;
mod smooth;
mod stats;
mod targets;
mod terminal;
mod train;
mod units;
mod verdict;
mod view;
mod views;
