//! A snapshot in memory divided into its blocks.

use crate::{Chunk, ChunkBuffer, ColumnBuffer, Particles, RUN, Storage};
use particlegs_core::context::Context;
use particlegs_core::model::Layer;
use particlegs_core::{Result, parallel};
use std::ops::Range;

/// The particles of each of `blocks` blocks, in their order, in columns of `storage`; layers stay layers. Blocks may
/// lack a layer. `blocks_of` says which block each particle of a chunk belongs to.
pub fn divide(
    particles: &Particles,
    blocks: usize,
    blocks_of: &(impl Fn(&Chunk<'_>) -> Vec<u32> + Sync),
    storage: &Storage,
    context: &Context<'_>,
) -> Result<Vec<Particles>> {
    let layers = particles.layers();
    let runs: Vec<(usize, Range<usize>)> =
        layers.iter().enumerate().flat_map(|(i, l)| runs_of(i, &l.content)).collect();
    let buffers = parallel::Scratch::<ChunkBuffer>::default();
    // Counted first: every run then has its own part of each block's columns to write to.
    let counts = parallel::try_map(&runs, |(_, run)| {
        context.check()?;
        let mut counts = vec![0u32; blocks];
        buffers.with(|buffer| {
            let chunk = particles.chunk(run.clone(), buffer);
            blocks_of(&chunk).iter().for_each(|b| counts[*b as usize] += 1);
        });
        Ok(counts)
    })?;
    let of_block = |b: usize| counts.iter().map(|c| c[b] as usize).sum::<usize>();
    let width = if particles.weights().is_some() { 4 } else { 3 };
    let mut columns: Vec<Vec<ColumnBuffer>> =
        (0..blocks).map(|b| storage.columns("the blocks", width, of_block(b))).collect::<Result<_>>()?;
    let places = places(&mut columns, &counts);
    parallel::try_for_each(runs.iter().zip(places), |((_, run), mut place)| {
        context.check()?;
        buffers.with(|buffer| {
            let chunk = particles.chunk(run.clone(), buffer);
            // Blocks are found a second time: kept from the count, they would take four bytes a particle.
            let mut at = vec![0usize; blocks];
            for (i, block) in blocks_of(&chunk).into_iter().enumerate() {
                let (to, at) = (&mut place[block as usize], &mut at[block as usize]);
                (0..3).for_each(|k| to[k][*at] = chunk.position[k][i]);
                chunk.weight.iter().for_each(|w| to[3][*at] = w[i]);
                *at += 1;
            }
        });
        Ok::<_, particlegs_core::Error>(())
    })?;
    let blocks = columns.into_iter().enumerate().map(|(b, columns)| {
        let kinds = kinds(layers, runs.iter().map(|r| r.0).zip(counts.iter().map(|c| c[b] as usize)));
        Particles::from_buffers(columns, particles.origin, particles.meta.clone(), kinds)
    });
    blocks.collect()
}

/// Runs of a layer's particles.
fn runs_of(layer: usize, range: &Range<usize>) -> impl Iterator<Item = (usize, Range<usize>)> + use<> {
    let end = range.end;
    range.clone().step_by(RUN).map(move |start| (layer, start..end.min(start + RUN)))
}

/// The destination of each run: for each block, its part of the block's columns.
fn places<'a>(columns: &'a mut [Vec<ColumnBuffer>], counts: &[Vec<u32>]) -> Vec<Vec<Vec<&'a mut [f32]>>> {
    let mut places: Vec<Vec<Vec<&mut [f32]>>> = counts.iter().map(|_| Vec::with_capacity(columns.len())).collect();
    for (b, columns) in columns.iter_mut().enumerate() {
        places.iter_mut().for_each(|p| p.push(Vec::with_capacity(columns.len())));
        for column in columns {
            let mut rest = &mut column[..];
            for (place, counts) in places.iter_mut().zip(counts) {
                let (part, after) = rest.split_at_mut(counts[b] as usize);
                place[b].push(part);
                rest = after;
            }
        }
    }
    places
}

/// The layers of a block from the layer and number of each of its runs' particles.
pub(super) fn kinds(
    layers: &[Layer<Range<usize>>],
    runs: impl Iterator<Item = (usize, usize)>,
) -> Vec<Layer<Range<usize>>> {
    let mut counts = vec![0; layers.len()];
    runs.for_each(|(layer, n)| counts[layer] += n);
    let mut end = 0;
    let part = |(l, n): (&Layer<Range<usize>>, usize)| {
        end += n;
        l.with(end - n..end)
    };
    layers.iter().zip(counts).map(part).filter(|l| !l.content.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{KdTree, SnapshotScan};
    use super::*;
    use crate::LayeredParticles;
    use crate::testing::two_layers;
    use particlegs_core::context::Context;

    #[test]
    fn every_particle_is_in_one_block() {
        let p = two_layers(150_000, |i| i as f32 + 1.0);
        let folder = tempfile::tempdir().unwrap();
        for storage in [Storage::Memory, Storage::Disk(folder.path().into())] {
            let scan =
                SnapshotScan::new(&LayeredParticles::from_particles(&p), "here", true, &Context::SILENT).unwrap();
            let tree = KdTree::new(&scan.sample, 3).unwrap();
            let blocks = divide(&p, 3, &|chunk| tree.blocks_of(chunk).collect(), &storage, &Context::SILENT).unwrap();
            assert_eq!(blocks.iter().map(Particles::len).sum::<usize>(), p.len());
            let mut seen: Vec<f32> = blocks.iter().flat_map(|b| b.weights().cloned().unwrap().to_vec()).collect();
            seen.sort_by(f32::total_cmp);
            assert!(seen.iter().enumerate().all(|(i, w)| *w == i as f32 + 1.0));
            for b in &blocks {
                assert!(b.len().abs_diff(50_000) < 100, "{}", b.len());
                let names: Vec<String> = b.layers().iter().map(|l| l.name.clone()).collect();
                assert_eq!(names, ["a", "b"]);
                let weights = b.weights().cloned().unwrap();
                assert!(weights.windows(2).all(|w| w[0] < w[1]), "order is kept");
                assert!(b.layers()[0].content.clone().all(|i| weights[i] <= 70_000.0));
            }
        }
    }
}
