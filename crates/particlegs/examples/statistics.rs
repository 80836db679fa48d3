//! Statistics of a model against its snapshot: `cargo run --release -p particlegs --example statistics SNAPSHOT
//! MODEL.pgs`.

use particlegs::prelude::*;
use particlegs::stats::{Measure, StatsOptions, Subject, compare};

fn main() -> Result<()> {
    let paths: Vec<std::path::PathBuf> = std::env::args_os().skip(1).map(Into::into).collect();
    let [snapshot, model] = &paths[..] else { panic!("the paths of a snapshot and of its model") };
    let context = Context::default();
    let (truth, model) = (Snapshot::open(snapshot)?.particles(&context)?, Model::open(model)?);
    let options = StatsOptions {
        measures: vec![Measure::Density, Measure::Spectrum],
        cells: Some(32),
        ..StatsOptions::default()
    };
    let comparison = compare(Subject::Particles(&truth), Subject::Model(model.decoded()), &options, &context)?;
    if let Some(density) = &comparison.density {
        println!("density in {:?} cells: correlation {:.4}", density.cells, density.agreement.correlation);
    }
    for shell in comparison.spectra.iter().flat_map(|s| &s.shells) {
        println!("k {:.2}: P {:.3e} and {:.3e}, r {:?}", shell.k, shell.power[0], shell.power[1], shell.r);
    }
    Ok(())
}
