//! A snapshot opened whole: columns or triples, owned or mapped, and its runs as columns.

use super::SnapshotMeta;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Columns, Layer, MASS};
use particlegs_core::space::Bounds;
use particlegs_core::{Result, parallel};
use particlegs_files::input::MappedFile;
use particlegs_files::memory::require;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A run of f32 that is owned, lies in a mapped file or is lent.
#[derive(Clone)]
pub struct Column {
    floats: FloatStore,
    /// The floats that are the column's.
    range: Range<usize>,
}

/// The owner of a column's floats.
#[derive(Clone)]
enum FloatStore {
    Owned(Arc<Vec<f32>>),
    /// Little-endian, from this byte of a file on, a multiple of 4.
    Mapped(Arc<MappedFile>, usize),
    Lent(Arc<dyn AsRef<[f32]> + Send + Sync>),
}

impl Column {
    /// Owned values.
    pub fn owned(values: Vec<f32>) -> Self {
        Column { range: 0..values.len(), floats: FloatStore::Owned(Arc::new(values)) }
    }

    /// All values of another owner, such as an array of Python's, where they lie.
    pub fn lent(owner: Arc<dyn AsRef<[f32]> + Send + Sync>) -> Self {
        Column { range: 0..(*owner).as_ref().len(), floats: FloatStore::Lent(owner) }
    }

    /// `len` floats from byte `offset`, a multiple of 4, of a mapped little-endian file.
    pub fn mapped(map: Arc<MappedFile>, offset: usize, len: usize) -> Self {
        Column { range: 0..len, floats: FloatStore::Mapped(map, offset) }
    }

    /// The file that it lies in.
    fn file(&self) -> Option<&MappedFile> {
        if let FloatStore::Mapped(map, _) = &self.floats { Some(map) } else { None }
    }

    /// A part of it, which must lie inside; nothing is copied.
    pub fn slice(&self, range: Range<usize>) -> Self {
        assert!(range.start <= range.end && range.end <= self.len(), "a part of the column");
        let start = self.range.start;
        Column { range: start + range.start..start + range.end, floats: self.floats.clone() }
    }
}

impl Deref for Column {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        let range = self.range.clone();
        match &self.floats {
            FloatStore::Owned(values) => &values[range],
            FloatStore::Mapped(map, offset) => {
                bytemuck::cast_slice(&map[offset + 4 * range.start..offset + 4 * range.end])
            }
            FloatStore::Lent(owner) => &(**owner).as_ref()[range],
        }
    }
}

/// The layout of positions in memory.
#[derive(Clone)]
pub enum Positions {
    /// x, y and z apart.
    Columns([Column; 3]),
    /// x, y, z, x, y, z, ... in one run.
    Triples(Column),
}

/// A snapshot: positions `origin + local`, columns, layers, metadata.
#[derive(Clone)]
pub struct Particles {
    /// Positions relative to the origin, float32.
    pub positions: Positions,
    /// Columns of one value a particle; [`MASS`] are weights, > 0.
    columns: Columns<Column>,
    /// The point that f32 positions are relative to, world units.
    pub origin: [f64; 3],
    /// Metadata of the source.
    pub meta: SnapshotMeta,
    /// The layers, in order and without gaps; none of them empty where there are particles.
    pub(super) layers: Vec<Layer<Range<usize>>>,
}

/// Particles in one step of parallel work; fixed, so that sums do not depend on threads.
pub const CHUNK: usize = RUN;

impl Particles {
    /// Particles of one layer without weights.
    pub fn new(positions: Positions, origin: [f64; 3], meta: SnapshotMeta) -> Self {
        let particles = Particles { positions, columns: Columns::default(), origin, meta, layers: Vec::new() };
        particles.with_layers(Vec::new())
    }

    /// Particles in memory, columns, origin 0.
    ///
    /// # Panics
    /// If the columns are not of one length.
    pub fn from_columns(x: Vec<f32>, y: Vec<f32>, z: Vec<f32>) -> Self {
        assert!(x.len() == y.len() && y.len() == z.len(), "columns of one length");
        let positions = Positions::Columns([Column::owned(x), Column::owned(y), Column::owned(z)]);
        Particles::new(positions, [0.0; 3], SnapshotMeta::default())
    }

    fn all_columns_mut(&mut self) -> impl Iterator<Item = &mut Column> {
        let positions = match &mut self.positions {
            Positions::Columns(columns) => &mut columns[..],
            Positions::Triples(all) => std::slice::from_mut(all),
        };
        positions.iter_mut().chain(self.columns.iter_mut().map(|(_, column)| column))
    }

    /// Refuses particles that lie in a mapped file which has become shorter since: reading them would end the process.
    /// Whatever reads all particles calls it before.
    ///
    /// # Errors
    /// [`particlegs_core::Error::Input`], which names the file.
    pub fn check_files(&self) -> Result<()> {
        let positions = match &self.positions {
            Positions::Columns(columns) => &columns[..],
            Positions::Triples(all) => std::slice::from_ref(all),
        };
        let columns = positions.iter().chain(self.columns.iter().map(|(_, column)| column));
        columns.filter_map(Column::file).try_for_each(MappedFile::check)
    }

    /// The particles in memory, where they lie in mapped files: what becomes of the files later does not matter.
    ///
    /// # Errors
    /// Those of [`Particles::check_files`], and [`particlegs_core::Error::Memory`].
    pub fn in_memory(mut self) -> Result<Particles> {
        self.check_files()?;
        require("the particles", self.raw_bytes())?;
        for column in self.all_columns_mut().filter(|c| c.file().is_some()) {
            *column = Column::owned(column.to_vec());
        }
        Ok(self)
    }

    /// With weights (> 0), one a particle: masses, relative to the mass of weight 1 where a layer knows one.
    ///
    /// # Panics
    /// If they are not as many as the particles.
    pub fn with_weights(mut self, weights: Column) -> Self {
        assert!(weights.len() == self.len(), "a weight for every particle");
        self.columns.set(MASS, weights);
        if self.is_one_kind() {
            self.layers = vec![self.one_layer()];
        }
        self
    }

    /// Without weights: all particles count alike.
    pub fn without_weights(mut self) -> Self {
        self.columns.remove(MASS);
        self.layers.iter_mut().filter(|l| l.mass.is_weighted()).for_each(|l| l.mass = l.mass.without_weights());
        self
    }

    /// In layers, given in order and without gaps; those of no particles are left out. None at all: one
    /// layer of all particles.
    pub fn with_layers(mut self, mut layers: Vec<Layer<Range<usize>>>) -> Self {
        layers.retain(|l| !l.content.is_empty());
        self.layers = if layers.is_empty() { vec![self.one_layer()] } else { layers };
        self
    }

    /// Particles of columns x, y, z and perhaps weights.
    pub fn from_column_list(
        columns: Vec<Column>,
        origin: [f64; 3],
        meta: SnapshotMeta,
        layers: Vec<Layer<Range<usize>>>,
    ) -> Self {
        let mut columns = columns.into_iter();
        let mut next = || columns.next().expect("three columns at least");
        let positions = Positions::Columns([next(), next(), next()]);
        let particles = Particles::new(positions, origin, meta);
        match columns.next() {
            Some(weights) => particles.with_weights(weights),
            None => particles,
        }
        .with_layers(layers)
    }

    /// Weights, one a particle, where there are any.
    pub fn weights(&self) -> Option<&Column> {
        self.columns.get(MASS)
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        match &self.positions {
            Positions::Columns(c) => c[0].len(),
            Positions::Triples(t) => t.len() / 3,
        }
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The particles of `range` as columns: borrowed where they lie so, else copied to `buffer`.
    pub fn chunk<'a>(&'a self, range: Range<usize>, buffer: &'a mut ChunkBuffer) -> Chunk<'a> {
        let weight = self.weights().map(|w| &w[range.clone()]);
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
        let buffers = parallel::Scratch::<ChunkBuffer>::default();
        let starts = (0..n).step_by(CHUNK);
        parallel::map(starts, |s| buffers.with(|buffer| work(s, self.chunk(s..n.min(s + CHUNK), buffer))))
    }

    /// Positions of particles relative to the origin, as they are stored, in columns.
    ///
    /// # Panics
    /// If the range reaches beyond the particles.
    pub fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3] {
        self.chunk(range, &mut ChunkBuffer::default()).position.map(<[f32]>::to_vec)
    }

    /// World position of particle `i`.
    pub fn position(&self, i: usize) -> [f64; 3] {
        let local = match &self.positions {
            Positions::Columns(c) => [c[0][i], c[1][i], c[2][i]],
            Positions::Triples(t) => [t[3 * i], t[3 * i + 1], t[3 * i + 2]],
        };
        each_axis(|k| self.origin[k] + f64::from(local[k]))
    }

    /// Bounds of the particles, world units.
    pub fn bounds(&self) -> Bounds {
        self.in_world(self.local_bounds())
    }

    /// Bounds about the origin.
    pub fn local_bounds(&self) -> Bounds {
        let parts = self.par_chunks(|_, chunk| {
            let ends = chunk
                .position
                .map(|c| c.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v))));
            Bounds { min: ends.map(|e| f64::from(e.0)), max: ends.map(|e| f64::from(e.1)) }
        });
        parts.iter().fold(Bounds::empty(), |a, b| a.union(b))
    }

    /// Bounds about the origin as bounds of the world.
    pub fn in_world(&self, local: Bounds) -> Bounds {
        Bounds { min: each_axis(|k| self.origin[k] + local.min[k]), max: each_axis(|k| self.origin[k] + local.max[k]) }
    }

    /// Sum of the weights (ordered f64 sums), or the number of particles where there are none.
    pub fn total_mass(&self) -> f64 {
        match self.weights() {
            None => self.len() as f64,
            Some(_) => {
                self.par_chunks(|_, c| c.weight.unwrap_or(&[]).iter().map(|&w| f64::from(w)).sum::<f64>()).iter().sum()
            }
        }
    }
}

/// Columns that the caller owns and reuses.
#[derive(Default, Debug)]
pub struct ChunkBuffer {
    /// x, y, z relative to the origin, same length each.
    pub position: [Vec<f32>; 3],
}

/// A borrowed run of particles.
#[derive(Clone, Copy, Debug)]
pub struct Chunk<'a> {
    /// x, y, z relative to the origin, same length each.
    pub position: [&'a [f32]; 3],
    /// Weights, same length, where the source has them.
    pub weight: Option<&'a [f32]>,
}

impl Chunk<'_> {
    /// Number of particles.
    pub fn len(&self) -> usize {
        self.position[0].len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Particles that a reader hands over at once: a run. Fixed, so that nothing depends on threads.
pub const RUN: usize = 1 << 16;

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
