//! The layers of a snapshot, one reader each: read run by run as if they were in memory, or opened whole.

use super::{Chunk, ChunkBuffer, InPlace, LayerFields, Particles, RUN, RunSink, SnapshotMeta, SnapshotReader, Storage};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Layer, Mass};
use particlegs_core::{Error, Result};
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Layers of one snapshot, about one origin. Where one layer has weights, or the masses of their
/// particles differ, particles have masses, if all are known; else none is used.
pub struct LayeredParticles {
    /// Metadata of the snapshot.
    pub meta: SnapshotMeta,
    /// The f64 point that positions are relative to.
    pub origin: [f64; 3],
    /// The layers, none of them empty.
    pub layers: Vec<ReadLayer>,
    /// Their fields, where they were asked for and can be read.
    pub fields: Vec<LayerFields>,
}

/// A layer, and what reads its particles.
pub struct ReadLayer {
    /// Name, masses, and number of particles.
    pub layer: Layer<u64>,
    reader: Arc<dyn SnapshotReader>,
}

impl LayeredParticles {
    /// Layers as their readers give them: a name, and a reader whose metadata says the mass of a particle.
    pub fn new(sources: Vec<(String, Arc<dyn SnapshotReader>)>) -> Result<Self> {
        let (_, first) = sources.first().ok_or_else(|| Error::argument("no layer was chosen"))?;
        let mass = |reader: &Arc<dyn SnapshotReader>| reader.meta().particle_mass;
        let one = first.meta().particle_mass;
        let known = sources.iter().all(|(_, r)| r.has_weights() || mass(r).is_some());
        let same = sources.iter().all(|(_, r)| !r.has_weights() && mass(r) == one);
        let meta = SnapshotMeta { particle_mass: one.filter(|_| known && same), ..first.meta().clone() };
        // One origin for all: 0 unless every layer lies far from it.
        let far = |k: usize| sources.iter().all(|(_, r)| r.origin()[k] != 0.0);
        let origin = [0, 1, 2].map(|k| if far(k) { first.origin()[k] } else { 0.0 });
        let layers = sources.into_iter().map(|(name, reader)| {
            let weighted = known && reader.has_weights();
            // A weight of its own is the mass; the layer's is in the weights too, for who reads all.
            let particle_mass = reader.meta().particle_mass.filter(|_| known && !weighted);
            let layer = Layer { name, mass: Mass::new(weighted, particle_mass), content: reader.count() };
            ReadLayer { layer, reader }
        });
        Ok(LayeredParticles { meta, origin, layers: layers.collect(), fields: Vec::new() })
    }

    /// Particles in memory or mapped.
    pub fn from_particles(particles: &Particles) -> Self {
        let layer = |l: &Layer<Range<usize>>| ReadLayer {
            layer: l.with(l.content.len() as u64),
            reader: Arc::new(particles.of_layer(l)),
        };
        let layers = particles.layers().iter().map(layer).filter(|l| l.layer.content > 0).collect();
        LayeredParticles { meta: particles.meta.clone(), origin: particles.origin, layers, fields: Vec::new() }
    }

    /// With the fields of each layer; empty where they cannot be read.
    pub fn with_fields(self, fields: Vec<LayerFields>) -> Self {
        LayeredParticles { fields, ..self }
    }

    /// Number of particles.
    pub fn count(&self) -> u64 {
        self.layers.iter().fold(0, |n, l| n.saturating_add(l.layer.content))
    }

    /// Bytes of the particles as float32 columns: 12 each, 16 where their layer is weighted.
    pub fn raw_bytes(&self) -> u64 {
        self.layers.iter().map(|l| l.layer.content * l.layer.mass.particle_bytes()).sum()
    }

    /// Whether there are weights in the columns of all.
    pub fn has_weights(&self) -> bool {
        let mass = |l: &ReadLayer| l.layer.mass;
        self.layers.iter().any(|l| mass(l).is_weighted() || mass(l).unit() != mass(&self.layers[0]).unit())
    }

    /// Whether runs can be read in any order at no more than their own cost.
    pub fn random_access(&self) -> bool {
        self.layers.iter().all(|l| l.reader.random_access())
    }

    /// The layer that lies in a file as it would lie in memory, where it is the only one.
    fn in_place(&self) -> Option<InPlace> {
        match &self.layers[..] {
            [one] => one.reader.in_place(),
            _ => None,
        }
    }

    /// Drops the weights of layer `index`: all its particles weigh `weight`.
    pub(crate) fn settle(&mut self, index: usize, weight: f32) {
        let mass = &mut self.layers[index].layer.mass;
        *mass = mass.all_of_weight(weight);
    }
}

impl ReadLayer {
    /// Number of runs of at most [`RUN`] particles.
    pub fn runs(&self) -> u64 {
        self.layer.content.div_ceil(RUN as u64)
    }

    /// Hands over the runs of `runs` in any order, about `origin`, with weights where the layer has
    /// them.
    pub fn read(&self, origin: [f64; 3], runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let reader = &*self.reader;
        let shift: [f64; 3] = each_axis(|k| reader.origin()[k] - origin[k]);
        let wrong = |message: String| Error::input(&self.layer.name, message);
        reader.read(runs.clone(), context, &|run, chunk| {
            if !runs.contains(&run) {
                return Err(wrong(format!("the reader returned data chunk {run}, which was not requested")));
            }
            let count = (self.layer.content - run * RUN as u64).min(RUN as u64);
            if chunk.len() as u64 != count || self.layer.mass.is_weighted() && chunk.weight.is_none() {
                return Err(wrong(format!("data chunk {run} has {} particles instead of {count}", chunk.len())));
            }
            let weight = chunk.weight.filter(|_| self.layer.mass.is_weighted());
            if shift == [0.0; 3] {
                return sink(run, Chunk { position: chunk.position, weight });
            }
            let mut buffer = ChunkBuffer::default();
            for k in 0..3 {
                buffer.position[k].extend(chunk.position[k].iter().map(|&v| match shift[k] {
                    0.0 => v,
                    s => (f64::from(v) + s) as f32,
                }));
            }
            let [x, y, z] = &buffer.position;
            sink(run, Chunk { position: [x, y, z], weight })
        })
    }
}

impl LayeredParticles {
    /// Reads layers into columns of `storage`, one layer after the other; a single layer is mapped where its
    /// file's layout allows it. `NaN` and infinity stay ([`Particles::checked`]).
    pub fn load(&self, storage: &Storage, context: &Context<'_>) -> Result<Particles> {
        let (origin, meta) = (self.origin, self.meta.clone());
        let weighted = self.has_weights();
        let layers = layers(self)?;
        if let Some(InPlace { positions, weights }) = self.in_place() {
            let particles = Particles::new(positions, [0.0; 3], meta);
            return Ok(match weights.filter(|_| weighted) {
                Some(weights) => particles.with_weights(weights),
                None => particles,
            }
            .with_layers(layers));
        }
        let total = layers.last().map_or(0, |l| l.content.end);
        let width = if weighted { 4 } else { 3 };
        storage.announce("the particles as read", 4 * width as u64 * total as u64, context);
        let mut columns = storage.columns("the particles", width, total)?;
        context.begin("reading", total as u64);
        for (layer, place) in self.layers.iter().zip(&layers) {
            let parts: Vec<&mut [f32]> = columns.iter_mut().map(|c| &mut c[place.content.clone()]).collect();
            fill(layer, parts, origin, context)?;
        }
        context.end();
        Particles::from_buffers(columns, origin, meta, layers)
    }
}

/// The layers and where they lie.
fn layers(source: &LayeredParticles) -> Result<Vec<Layer<Range<usize>>>> {
    let mut end = 0usize;
    let place = |l: &ReadLayer| {
        let start = end;
        end = usize::try_from(l.layer.content)
            .ok()
            .and_then(|n| start.checked_add(n))
            .ok_or_else(|| Error::input(&source.meta.name, "too many particles for this machine"))?;
        Ok(l.layer.with(start..end))
    };
    source.layers.iter().map(place).collect()
}

/// Reads one layer into its part of the columns (x, y, z and perhaps weights).
fn fill(layer: &ReadLayer, parts: Vec<&mut [f32]>, origin: [f64; 3], context: &Context<'_>) -> Result<()> {
    let runs = layer.runs();
    let mass = layer.layer.mass.unit_or_one() as f32;
    // Runs arrive in any order from several threads: each has its place and its lock.
    let mut places: Vec<Mutex<Option<Vec<&mut [f32]>>>> = (0..runs).map(|_| Mutex::new(Some(Vec::new()))).collect();
    for part in parts {
        for (place, run) in places.iter_mut().zip(part.chunks_mut(RUN)) {
            place.get_mut().unwrap_or_else(|e| e.into_inner()).get_or_insert_default().push(run);
        }
    }
    let wrong = |message: String| Error::input(&layer.layer.name, message);
    layer.read(origin, 0..runs, context, &|run, chunk| {
        let Some(mut columns) = places[run as usize].lock().unwrap_or_else(|e| e.into_inner()).take() else {
            return Err(wrong(format!("the reader returned data chunk {run} twice")));
        };
        (0..3).for_each(|k| columns[k].copy_from_slice(chunk.position[k]));
        match (columns.get_mut(3), chunk.weight) {
            (Some(weights), Some(chunk_weights)) => weights.copy_from_slice(chunk_weights),
            (Some(weights), None) => weights.fill(mass),
            (None, _) => {}
        }
        Ok(())
    })?;
    let left = |p: Mutex<Option<_>>| p.into_inner().unwrap_or_else(|e| e.into_inner()).is_some();
    let missing = places.into_iter().map(left).filter(|left| *left).count();
    if missing > 0 {
        return Err(wrong(format!("{missing} of {runs} data chunks are missing")));
    }
    Ok(())
}
