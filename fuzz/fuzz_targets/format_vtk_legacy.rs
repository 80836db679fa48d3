//! Any bytes as a file of format `vtk-legacy`.
//! `cargo fuzz run format_vtk_legacy` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("vtk-legacy", bytes));
