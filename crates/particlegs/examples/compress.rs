//! From positions in memory to a model file: `cargo run --release --example compress`.

use particlegs::checkpoint::NoCheckpoints;
use particlegs::codec;
use particlegs::compress::{Options, Target, compress};
use particlegs::context::Context;
use particlegs::math::Random;
use particlegs::model::CertificateLevel;
use particlegs::particles::Particles;
use particlegs_files::output::write_bytes;
use std::path::Path;

fn main() -> particlegs::Result<()> {
    // Three columns of float32, one value a particle, in any unit of length.
    let column = |axis: u64| -> Vec<f32> {
        (0..50_000).map(|i| (axis as f64 + Random::new(1, 1, 3 * i + axis).normal()) as f32).collect()
    };
    let particles = Particles::from_columns(column(0), column(1), column(2));

    let options = Options { target: Target::Ratio(100.0), certificate: CertificateLevel::None, ..Options::default() };
    let made = compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT)?;
    write_bytes(Path::new("cloud.pgs"), &made.bytes)?;

    let info = codec::read_info(&made.bytes, "cloud.pgs")?;
    println!("{} particles in {} bytes: {} Gaussians", info.metadata.count, info.bytes, made.model.gaussians());
    Ok(())
}
