//! Any bytes as a file of format `lammps-data`.
//! `cargo fuzz run format_lammps_data` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| particlegs_fuzz::fuzz_format("lammps-data", bytes));
