//! The worth of the first bytes of a model's block, beside a model that was simplified to as many bytes: masked PSNR of
//! noise-free pictures against the snapshot's. `cargo run --release -p particlegs-compress --example prefixes MODEL.pgs
//! X.f32 Y.f32 Z.f32`, a model of one block and the raw columns that it was made of.

use particlegs_compress::simplify;
use particlegs_core::camera::View;
use particlegs_core::codec;
use particlegs_core::codec::CodedLayer;
use particlegs_core::context::Context;
use particlegs_core::model::{Layer, Model, Target};
use particlegs_core::picture::Size;
use particlegs_measure::score::{evaluate, evaluation_views};
use particlegs_particles::Particles;
use std::path::PathBuf;

const SIZE: Size = Size { width: 640, height: 360 };
/// Shares of the block's bytes, per cent.
const SHARES: [usize; 4] = [5, 10, 25, 50];

fn score(model: &Model, particles: &Particles, views: &[View]) -> particlegs_core::Result<f64> {
    let evaluation = evaluate(model, particles, views, SIZE, None, &Context::SILENT)?;
    Ok(evaluation.mean.expected.model.masked_psnr.unwrap_or(f64::INFINITY))
}

fn main() -> particlegs_core::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (path, columns) = arguments.split_first().expect("MODEL.pgs X.f32 Y.f32 Z.f32");
    let columns: Vec<PathBuf> = columns.iter().map(PathBuf::from).collect();
    let particles = Particles::open_raw(&columns)?;
    let bytes = std::fs::read(path).expect("a model file that can be read");
    let model = codec::decode(&bytes, path)?;
    let layers: Vec<CodedLayer> = codec::coded_layers(&bytes, path)?;
    let block = &layers[0].content[0].bytes;
    let views = evaluation_views(&model.metadata, SIZE, 42, 8);
    println!("{} Gaussians in {} bytes: {:.2} dB", model.gaussians(), block.len(), score(&model, &particles, &views)?);
    for share in SHARES {
        let n = block.len() * share / 100;
        let part = codec::decode_prefix(&block[..n], path)?;
        let gaussians = part.gaussians.len();
        let layer = Layer { content: vec![part], ..model.layers[0].clone() };
        let prefix = score(&Model { layers: vec![layer], ..model.clone() }, &particles, &views)?;
        let size = (bytes.len() - block.len() + n) as u64;
        let file = simplify(model.clone(), bytes.len() as u64, Target::Size(size), &Context::SILENT)?;
        let other = codec::decode(&file, path)?;
        let simplified = score(&other, &particles, &views)?;
        println!(
            "{share:>3} %: {gaussians:>6} Gaussians {prefix:.2} dB; simplified {:>6}, {simplified:.2} dB; {:+.2} dB",
            other.gaussians(),
            prefix - simplified
        );
    }
    Ok(())
}
