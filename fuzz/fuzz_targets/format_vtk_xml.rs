//! Any bytes as a file of format `vtk-xml`.
//! `cargo fuzz run format_vtk_xml` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("vtk-xml", bytes));
