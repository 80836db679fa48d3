//! Any bytes: read as a file, as a series, and as the one block of a file, whose checksums are none.
//! `cargo fuzz run model_reader` (seeds: crates/particlegs-compress/tests/fixtures).
#![no_main]

use libfuzzer_sys::fuzz_target;
use particlegs_core::codec;
use particlegs_core::context::Context;

fuzz_target!(|bytes: &[u8]| {
    let _ = codec::read_info(bytes, "fuzz");
    if let Ok(model) = codec::decode(bytes, "fuzz") {
        assert!(model.gaussians() > 0);
        assert!(model.blocks().all(|b| b.gaussians.law.kind() == model.metadata.law));
    }
    if let Ok(series) = codec::SeriesFile::read(bytes, "fuzz") {
        let _ = codec::SeriesDecoder::new(&series).frame(series.frames.len() - 1, &Context::SILENT);
    }
    for block in [codec::decode_block(bytes, "fuzz"), codec::decode_prefix(bytes, "fuzz")].into_iter().flatten() {
        assert_eq!(block.gaussians.count.iter().map(|&c| c as u64).sum::<u64>(), block.count);
        if let Some(columns) = block.gaussians.law.alpha_blend() {
            assert!(columns.opacity.iter().all(|&o| o > 0.0 && o < 1.0));
            assert!(columns.grey.iter().all(|&v| v >= 0.0 && v.is_finite()));
        }
    }
});
