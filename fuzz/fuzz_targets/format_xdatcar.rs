//! Any bytes as a file of format `xdatcar`.
//! `cargo fuzz run format_xdatcar` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("xdatcar", bytes));
