//! Any bytes as a catalogue of centres.
//! `cargo fuzz run catalogue` (seeds: crates/particlegs-formats/tests/fixtures).
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = particlegs_formats::Catalogue::parse(bytes);
});
