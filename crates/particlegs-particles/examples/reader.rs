//! A reader of one's own: particles that come from anywhere, run by run, in bounded memory:
//! `cargo run --release --example reader`.

#![allow(clippy::disallowed_methods)]

use particlegs_core::context::Context;
use particlegs_particles::{Chunk, LayeredParticles, RUN, SnapshotMeta, SnapshotReader, Storage};
use std::ops::Range;
use std::sync::Arc;

/// A spiral of so many particles, made when they are asked for.
struct Spiral {
    meta: SnapshotMeta,
    count: u64,
}

impl SnapshotReader for Spiral {
    fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    fn count(&self) -> u64 {
        self.count
    }

    fn has_weights(&self) -> bool {
        false
    }

    fn origin(&self) -> [f64; 3] {
        [0.0; 3]
    }

    fn read(
        &self,
        runs: Range<u64>,
        context: &Context<'_>,
        sink: &(dyn Fn(u64, Chunk<'_>) -> particlegs_core::Result<()> + Sync),
    ) -> particlegs_core::Result<()> {
        for run in runs {
            context.check()?;
            let rows = run * RUN as u64..self.count.min((run + 1) * RUN as u64);
            let turn = |i: u64| i as f32 / self.count as f32 * 40.0;
            let column = |f: &dyn Fn(f32) -> f32| rows.clone().map(|i| f(turn(i))).collect::<Vec<f32>>();
            let [x, y, z] = [column(&|t| t * t.cos()), column(&|t| t * t.sin()), column(&|t| t)];
            sink(run, Chunk { position: [&x, &y, &z], weight: None })?;
        }
        Ok(())
    }
}

fn main() -> particlegs_core::Result<()> {
    let meta = SnapshotMeta { name: "spiral".into(), ..SnapshotMeta::default() };
    let reader = Arc::new(Spiral { meta, count: 200_000 });
    let source = LayeredParticles::new(vec![("gas".into(), reader)])?;
    let particles = source.load(&Storage::Memory, &Context::SILENT)?;
    println!("{} particles within {:?}", particles.len(), particles.bounds());
    Ok(())
}
