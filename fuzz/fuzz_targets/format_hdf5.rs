//! Any bytes as a file of format `hdf5`.
//! `cargo fuzz run format_hdf5` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("hdf5", bytes));
