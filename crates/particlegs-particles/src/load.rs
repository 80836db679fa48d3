//! A snapshot opened whole from readers: one a layer.

use super::{InPlace, LayeredParticles, Particles, RUN, ReadLayer, Storage};
use particlegs_core::context::Context;
use particlegs_core::model::Layer;
use particlegs_core::{Error, Result};
use std::ops::Range;
use std::sync::Mutex;

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
