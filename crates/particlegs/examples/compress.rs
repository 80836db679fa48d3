//! From positions in memory to a model file: `cargo run --release -p particlegs --example compress`.

use particlegs::prelude::*;

fn main() -> Result<()> {
    // Three columns of float32, one value a particle, in any unit of length: here a spiral.
    let column = |axis: usize| -> Vec<f32> {
        let place = |i: u32| {
            let turn = i as f32 * 0.001;
            [turn * turn.cos(), turn * turn.sin(), (i % 97) as f32 * 0.01][axis]
        };
        (0..50_000).map(place).collect()
    };
    let snapshot = Snapshot::from_columns(column(0), column(1), column(2))?;
    let model = compress(&snapshot, &CompressOptions::ratio(100.0), &Context::default())?;
    model.save("spiral.pgs")?;
    println!("{} particles in {} bytes", model.metadata().count, model.bytes().len());
    Ok(())
}
