//! Any bytes as a file of format `asdf`.
//! `cargo fuzz run format_asdf` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("asdf", bytes));
