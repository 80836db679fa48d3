//! Any bytes as a file of the format that the target's name ends with: `cargo fuzz run format_hdf5` (seeds:
//! crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format(env!("CARGO_BIN_NAME"), bytes));
