//! Any bytes: read as a file, and as the one block of a file, whose checksums are none.
//! `cargo fuzz run model_reader` (seeds: crates/particlegs/tests/fixtures).
#![no_main]

use libfuzzer_sys::fuzz_target;
use particlegs::codec;
use particlegs::model::Law;

fuzz_target!(|bytes: &[u8]| {
    let _ = codec::read_info(bytes, "fuzz");
    if let Ok(model) = codec::decode(bytes, "fuzz") {
        assert!(model.gaussians() > 0);
        let shaded = model.metadata.law == Law::AlphaBlend;
        assert!(model.blocks().all(|b| b.gaussians.shade.is_some() == shaded));
    }
    if let Ok(block) = codec::decode_block(bytes, "fuzz") {
        assert_eq!(block.gaussians.count.iter().map(|&c| c as u64).sum::<u64>(), block.count);
        if let Some(shade) = &block.gaussians.shade {
            assert!(shade.opacity.iter().all(|&o| o > 0.0 && o < 1.0));
            assert!(shade.grey.iter().all(|&v| v >= 0.0 && v.is_finite()));
        }
    }
});
