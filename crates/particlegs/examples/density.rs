//! Density on a grid, of particles or of a model: `cargo run --release --example density`.

use particlegs::context::Context;
use particlegs::math::Random;
use particlegs::particles::Particles;
use particlegs::space::Cell;
use particlegs::stats::{Assignment, Grid, Subject, deposit};

fn main() -> particlegs::Result<()> {
    let column = |axis: u64| -> Vec<f32> {
        (0..100_000).map(|i| 10.0 * Random::new(1, 1, 3 * i + axis).uniform() as f32).collect()
    };
    let mut particles = Particles::from_columns(column(0), column(1), column(2));
    // A periodic box, 10 units of length across.
    particles.meta.cell = Some(Cell::orthogonal([10.0; 3]));

    let subject = Subject::Particles(&particles);
    let grid = Grid::new(&subject.domain(), 32);
    let field = deposit(subject, &grid, Assignment::Cic, 0.0, &Context::SILENT)?;
    let mean = field.mass.iter().sum::<f32>() / field.mass.len() as f32;
    let densest = field.mass.iter().fold(0.0, |a: f32, b| a.max(*b));
    println!("{} cells, {mean:.3} particles in the mean one, {densest:.3} in the densest", field.mass.len());
    Ok(())
}
