//! The first bytes of a block, drawn: about as good as a model that was simplified to as many bytes.

use particlegs_compress::{Options, compress, simplify};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::codec;
use particlegs_core::context::Context;
use particlegs_core::model::{CertificateLevel, Layer, Model, Target};
use particlegs_core::picture::Size;
use particlegs_measure::score::{evaluate, evaluation_views};
use particlegs_particles::Particles;
use std::path::Path;

#[test]
#[ignore = "ten seconds on one core: .ci/later runs it"]
fn prefixes_draw_pictures_like_simplified_models() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64");
    let particles = Particles::open_raw(&["xx", "yy", "zz"].map(|c| folder.join(c).with_extension("f32"))).unwrap();
    let options = Options { target: Target::Ratio(300.0), certificate: CertificateLevel::None, ..Options::default() };
    let whole = compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT).unwrap();
    let size = Size { width: 640, height: 360 };
    let views = evaluation_views(&whole.model.metadata, size, 42, 2);
    let score = |model: &Model| {
        let mean = evaluate(model, &particles, &views, size, None, &Context::SILENT).unwrap().mean;
        mean.expected.model.masked_psnr.unwrap()
    };
    let block = codec::coded_layers(&whole.bytes, "m").unwrap()[0].content[0].bytes.clone();
    let mut before = 0.0;
    for share in [5, 10, 25, 50, 100] {
        let n = block.len() * share / 100;
        let part = codec::decode_prefix(&block[..n], "m").unwrap();
        let layer = Layer { content: vec![part], ..whole.model.layers[0].clone() };
        let prefix = score(&Model { layers: vec![layer], ..whole.model.clone() });
        assert!(prefix > before, "{share} %: {prefix} dB after {before} dB");
        before = prefix;
        if share < 100 {
            let target = Target::Size((whole.bytes.len() - block.len() + n) as u64);
            let file = simplify(whole.model.clone(), whole.bytes.len() as u64, target, &Context::SILENT).unwrap();
            let simplified = score(&codec::decode(&file, "m").unwrap());
            println!("{share} %: {prefix:.2} dB, simplified {simplified:.2} dB");
            assert!(prefix > simplified - 1.5, "{share} %: {prefix} dB, simplified {simplified} dB");
        }
    }
}
