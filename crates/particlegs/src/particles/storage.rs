//! A snapshot opened whole: columns or triples, owned or mapped.

use super::{Bounds, Chunk, ChunkBuffer, ParticleLayer, SnapshotMeta};
use rayon::prelude::*;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A run of f32 that is owned or lies in a mapped file.
#[derive(Clone)]
pub enum Column {
    /// `len` floats from `offset` of floats in memory.
    Owned {
        /// The floats.
        values: Arc<Vec<f32>>,
        /// First of them.
        offset: usize,
        /// Floats.
        len: usize,
    },
    /// `len` floats from byte `offset` of a mapped little-endian file.
    Mapped {
        /// The mapping.
        map: Arc<memmap2::Mmap>,
        /// First byte, a multiple of 4.
        offset: usize,
        /// Floats.
        len: usize,
    },
}

impl Column {
    /// Owned values.
    pub fn owned(values: Vec<f32>) -> Self {
        let len = values.len();
        Column::Owned { values: Arc::new(values), offset: 0, len }
    }

    /// A part of it, which must lie inside; nothing is copied.
    pub fn slice(&self, range: Range<usize>) -> Self {
        assert!(range.start <= range.end && range.end <= self.len(), "a part of the column");
        let mut part = self.clone();
        match &mut part {
            Column::Owned { offset, len, .. } => (*offset, *len) = (*offset + range.start, range.len()),
            Column::Mapped { offset, len, .. } => (*offset, *len) = (*offset + 4 * range.start, range.len()),
        }
        part
    }
}

impl Deref for Column {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        match self {
            Column::Owned { values, offset, len } => &values[*offset..*offset + *len],
            Column::Mapped { map, offset, len } => bytemuck::cast_slice(&map[*offset..*offset + 4 * *len]),
        }
    }
}

/// How positions lie in memory.
#[derive(Clone)]
pub enum Positions {
    /// x, y and z apart.
    Columns([Column; 3]),
    /// x, y, z, x, y, z, ... in one run.
    Triples(Column),
}

/// A snapshot: positions `origin + local`, optional weights, metadata.
#[derive(Clone)]
pub struct Particles {
    /// Local positions.
    pub positions: Positions,
    /// Weights (> 0), one a particle.
    pub weights: Option<Column>,
    /// What f32 positions are relative to, world units.
    pub origin: [f64; 3],
    /// What the source says.
    pub meta: SnapshotMeta,
    /// Kinds of particles, in order and without gaps; empty where the source tells none apart
    /// ([`Particles::layers`]).
    pub kinds: Vec<ParticleLayer>,
}

/// Particles in one step of parallel work; fixed, so that sums do not depend on threads.
pub(crate) const CHUNK: usize = super::RUN;

impl Particles {
    /// Particles in memory, columns, origin 0: for tests and for callers that made their own.
    pub fn from_columns(x: Vec<f32>, y: Vec<f32>, z: Vec<f32>) -> Self {
        assert!(x.len() == y.len() && y.len() == z.len(), "columns of one length");
        Particles {
            positions: Positions::Columns([Column::owned(x), Column::owned(y), Column::owned(z)]),
            weights: None,
            origin: [0.0; 3],
            meta: SnapshotMeta::default(),
            kinds: Vec::new(),
        }
    }

    /// Particles of columns x, y, z and perhaps weights.
    pub(crate) fn of_columns(
        columns: Vec<Column>,
        origin: [f64; 3],
        meta: SnapshotMeta,
        kinds: Vec<ParticleLayer>,
    ) -> Self {
        let mut columns = columns.into_iter();
        let mut next = || columns.next().expect("three columns at least");
        let positions = Positions::Columns([next(), next(), next()]);
        Particles { positions, weights: columns.next(), origin, meta, kinds }
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        match &self.positions {
            Positions::Columns(c) => c[0].len(),
            Positions::Triples(t) => t.len() / 3,
        }
    }

    /// No particles?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The particles of `range` as columns: borrowed where they lie so, else copied to `buffer`.
    pub fn chunk<'a>(&'a self, range: Range<usize>, buffer: &'a mut ChunkBuffer) -> Chunk<'a> {
        let weight = self.weights.as_ref().map(|w| &w[range.clone()]);
        match &self.positions {
            Positions::Columns([x, y, z]) => {
                Chunk { position: [&x[range.clone()], &y[range.clone()], &z[range]], weight }
            }
            Positions::Triples(t) => {
                let triples = &t[3 * range.start..3 * range.end];
                for k in 0..3 {
                    buffer.position[k].clear();
                    buffer.position[k].extend(triples.iter().skip(k).step_by(3));
                }
                let [x, y, z] = &buffer.position;
                Chunk { position: [x, y, z], weight }
            }
        }
    }

    /// Runs `work` over fixed chunks in parallel; results come in the order of the particles,
    /// whatever the threads. `work` gets the index of the chunk's first particle.
    pub fn par_chunks<T: Send>(&self, work: impl Fn(usize, Chunk<'_>) -> T + Sync) -> Vec<T> {
        let n = self.len();
        (0..n.div_ceil(CHUNK))
            .into_par_iter()
            .map_init(ChunkBuffer::default, |buffer, c| {
                let start = c * CHUNK;
                work(start, self.chunk(start..n.min(start + CHUNK), buffer))
            })
            .collect()
    }

    /// World position of particle `i`.
    pub fn position(&self, i: usize) -> [f64; 3] {
        let local = match &self.positions {
            Positions::Columns(c) => [c[0][i], c[1][i], c[2][i]],
            Positions::Triples(t) => [t[3 * i], t[3 * i + 1], t[3 * i + 2]],
        };
        std::array::from_fn(|k| self.origin[k] + f64::from(local[k]))
    }

    /// Bounds of the particles, world units.
    pub fn bounds(&self) -> Bounds {
        let parts = self.par_chunks(|_, chunk| {
            let ends = chunk
                .position
                .map(|c| c.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v))));
            Bounds { min: ends.map(|e| f64::from(e.0)), max: ends.map(|e| f64::from(e.1)) }
        });
        let local = parts.iter().fold(Bounds::empty(), |a, b| a.union(b));
        Bounds {
            min: std::array::from_fn(|k| self.origin[k] + local.min[k]),
            max: std::array::from_fn(|k| self.origin[k] + local.max[k]),
        }
    }

    /// Sum of the weights (ordered f64 sums), or the number of particles where there are none.
    pub fn total_mass(&self) -> f64 {
        match &self.weights {
            None => self.len() as f64,
            Some(_) => {
                self.par_chunks(|_, c| c.weight.unwrap_or(&[]).iter().map(|&w| f64::from(w)).sum::<f64>()).iter().sum()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triples_and_columns_agree() {
        let columns = Particles::from_columns(vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]);
        let mut triples = columns.clone();
        triples.positions = Positions::Triples(Column::owned(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(columns.bounds(), triples.bounds());
        assert_eq!(triples.position(1), [4.0, 5.0, 6.0]);
        assert_eq!(triples.par_chunks(|s, c| (s, c.position[2].to_vec())), vec![(0, vec![3.0, 6.0])]);
    }
}
