//! Statistics of two clouds of particles: `cargo run --release --example statistics`.

use particlegs::context::Context;
use particlegs::math::Random;
use particlegs::particles::Particles;
use particlegs::space::Cell;
use particlegs::stats::{Measure, StatsOptions, Subject, compare};

/// Particles about the points of a lattice, `width` wide.
fn cloud(seed: u64, width: f64) -> Particles {
    let column = |axis: u64| -> Vec<f32> {
        let place = |i: u64| {
            let lattice = (i >> (3 * axis) & 7) as f64 + 0.5;
            (lattice + width * Random::new(seed, 1, 3 * i + axis).normal()).rem_euclid(8.0) as f32
        };
        (0..50_000).map(place).collect()
    };
    let mut particles = Particles::from_columns(column(0), column(1), column(2));
    particles.meta.cell = Some(Cell::orthogonal([8.0; 3]));
    particles
}

fn main() -> particlegs::Result<()> {
    let (truth, other) = (cloud(1, 0.1), cloud(2, 0.12));
    let options =
        StatsOptions { measures: vec![Measure::Density, Measure::Spectrum], cells: 32, ..StatsOptions::default() };
    let found = compare(Subject::Particles(&truth), Subject::Particles(&other), &options, &Context::SILENT)?;
    if let Some(density) = &found.density {
        println!("density in {:?} cells: correlation {:.4}", density.cells, density.agreement.correlation);
    }
    for shell in found.spectra.iter().flat_map(|s| &s.shells) {
        println!("k {:.2}: P {:.3e} and {:.3e}, r {:?}", shell.k, shell.power[0], shell.power[1], shell.r);
    }
    Ok(())
}
