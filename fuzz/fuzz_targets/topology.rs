//! Any first line as a selection of atoms, and what follows as the topology of a trajectory.
//! `cargo fuzz run topology` (seeds: `all`, a newline, and files such as crates/particlegs-formats/tests/data/molecules/*.psf).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_topology(bytes));
