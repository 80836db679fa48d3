//! Any bytes as a file of format `lammps`.
//! `cargo fuzz run format_lammps` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("lammps", bytes));
