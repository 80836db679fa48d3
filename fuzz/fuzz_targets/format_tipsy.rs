//! Any bytes as a file of format `tipsy`.
//! `cargo fuzz run format_tipsy` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("tipsy", bytes));
