//! A model's density on a grid: `cargo run --release -p particlegs --example density MODEL.pgs`.

use particlegs::prelude::*;

fn main() -> Result<()> {
    let path = std::env::args_os().nth(1).expect("the path of a model file");
    let density = Model::open(std::path::Path::new(&path))?.density_grid(64, &Context::default())?;
    let densest = density.values.iter().fold(0.0, |a: f32, b| a.max(*b));
    println!("{:?} cells, {densest:.3e} {} in the densest", density.grid.cells, density.unit);
    Ok(())
}
