//! A snapshot in memory divided into its blocks.

use super::{KdTree, sample};
use crate::Result;
use crate::particles::{ChunkBuffer, Column, ParticleLayer, Particles, Positions, RUN};
use crate::progress::Progress;
use rayon::prelude::*;

/// The particles of each block, in their order; layers stay layers. Blocks may lack a layer.
///
/// # Errors
/// Those of [`KdTree::new`]; [`crate::Error::Cancelled`].
pub fn divide(particles: &Particles, blocks: u32, progress: &dyn Progress) -> Result<Vec<Particles>> {
    if blocks == 1 {
        return Ok(vec![particles.clone()]);
    }
    let tree = KdTree::new(&sample(particles, progress)?, blocks)?;
    let numbers: Vec<Vec<u32>> = particles
        .par_chunks(|_, chunk| (0..chunk.len()).map(|i| tree.block_of(chunk.position.map(|c| c[i]))).collect());
    progress.check()?;
    Ok((0..blocks).into_par_iter().map(|b| of_block(particles, &numbers, b)).collect())
}

/// The particles whose number is `block`.
fn of_block(particles: &Particles, numbers: &[Vec<u32>], block: u32) -> Particles {
    let (mut columns, mut buffer): ([Vec<f32>; 4], _) = Default::default();
    let mut kinds: Vec<ParticleLayer> = Vec::new();
    for layer in particles.layers() {
        let start = columns[0].len();
        let mut at = layer.range.start;
        while at < layer.range.end {
            // Numbers come in the particles' own chunks, which layers do not respect.
            let end = layer.range.end.min((at / RUN + 1) * RUN);
            let chunk = particles.chunk(at..end, &mut buffer as &mut ChunkBuffer);
            let own = &numbers[at / RUN][at % RUN..][..end - at];
            for (i, _) in own.iter().enumerate().filter(|n| *n.1 == block) {
                (0..3).for_each(|k| columns[k].push(chunk.position[k][i]));
                chunk.weight.iter().for_each(|w| columns[3].push(w[i]));
            }
            at = end;
        }
        if columns[0].len() > start {
            kinds.push(ParticleLayer { range: start..columns[0].len(), ..layer });
        }
    }
    let [x, y, z, w] = columns.map(Column::owned);
    Particles {
        positions: Positions::Columns([x, y, z]),
        weights: particles.weights.as_ref().map(|_| w),
        origin: particles.origin,
        meta: particles.meta.clone(),
        kinds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn every_particle_is_in_one_block() {
        let n = 150_000;
        let column = |k: u64| (0..n).map(|i| ((i * (7 + k) * 2_654_435_761) % 1_000_003) as f32).collect::<Vec<f32>>();
        let mut p = Particles::from_columns(column(0), column(1), column(2));
        p.weights = Some(Column::owned((0..n).map(|i| i as f32 + 1.0).collect()));
        let kind = |name: &str, range| ParticleLayer { name: name.into(), range, particle_mass: None, weighted: true };
        p.kinds = vec![kind("a", 0..70_000), kind("b", 70_000..n as usize)];
        let blocks = divide(&p, 3, &Silent).unwrap();
        assert_eq!(blocks.iter().map(Particles::len).sum::<usize>(), p.len());
        let mut seen: Vec<f32> = blocks.iter().flat_map(|b| b.weights.clone().unwrap().to_vec()).collect();
        seen.sort_by(f32::total_cmp);
        assert!(seen.iter().enumerate().all(|(i, w)| *w == i as f32 + 1.0));
        for b in &blocks {
            assert!(b.len().abs_diff(50_000) < 100, "{}", b.len());
            let names: Vec<String> = b.layers().iter().map(|l| l.name.clone()).collect();
            assert_eq!(names, ["a", "b"]);
            let weights = b.weights.clone().unwrap();
            assert!(b.layers()[0].range.clone().all(|i| weights[i] <= 70_000.0));
        }
    }
}
