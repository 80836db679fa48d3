//! Any bytes as a file of format `pdb`.
//! `cargo fuzz run format_pdb` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("pdb", bytes));
