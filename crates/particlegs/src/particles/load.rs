//! A snapshot opened whole from readers: one a layer.

use super::{Cell, Column, InPlace, ParticleLayer, Particles, Positions, RUN, SnapshotMeta, SnapshotReader};
use crate::memory::require;
use crate::progress::Progress;
use crate::{Error, Result};
use std::sync::Mutex;

/// A layer to be read.
pub struct LayerSource<'a> {
    /// Its name.
    pub name: String,
    /// Its particles; the reader's metadata says the mass of one.
    pub reader: &'a dyn SnapshotReader,
}

/// Reads layers into memory, one after the other; a single layer is mapped where its file's layout
/// allows it. Where one layer has weights, or the masses of their particles differ, every particle
/// gets its mass as weight, if all are known; else none is used. `NaN` and infinity stay
/// ([`super::check_values`]).
///
/// # Errors
/// [`Error::Memory`] before anything is read; those of the readers; [`Error::Cancelled`].
pub fn load(sources: &[LayerSource<'_>], progress: &dyn Progress) -> Result<Particles> {
    let first = sources.first().ok_or_else(|| Error::argument("no layer was chosen"))?;
    let meta = SnapshotMeta { particle_mass: None, ..first.reader.meta().clone() };
    let masses = Masses::of(sources);
    if let [one] = sources
        && let Some(InPlace { positions, weights }) = one.reader.in_place()
    {
        let weights = weights.filter(|_| masses == Masses::Weights);
        let mut particles = Particles { positions, weights, origin: [0.0; 3], meta, kinds: Vec::new() };
        set_kinds(&mut particles, sources, masses);
        return Ok(particles);
    }
    let total = sources.iter().try_fold(0u64, |n, s| n.checked_add(s.reader.count())).unwrap_or(u64::MAX);
    let weighted = masses == Masses::Weights;
    require("the particles", total.saturating_mul(if weighted { 16 } else { 12 }))?;
    let total = usize::try_from(total).map_err(|_| Error::input(&meta.name, "more particles than memory counts"))?;
    // One origin for all: 0 unless every layer lies far from it.
    let far = |k: usize| sources.iter().all(|s| s.reader.origin()[k] != 0.0);
    let origin = [0, 1, 2].map(|k| if far(k) { first.reader.origin()[k] } else { 0.0 });
    let mut columns = [0, 1, 2].map(|_| vec![0f32; total]).to_vec();
    if weighted {
        columns.push(vec![0f32; total]);
    }
    progress.begin("reading", total as u64);
    let mut start = 0;
    for source in sources {
        let end = start + source.reader.count() as usize;
        let parts: Vec<&mut [f32]> = columns.iter_mut().map(|c| &mut c[start..end]).collect();
        fill(source, parts, origin, progress)?;
        start = end;
    }
    progress.end();
    let mut columns = columns.into_iter().map(Column::owned);
    let mut next = || columns.next().expect("three columns at least");
    let positions = Positions::Columns([next(), next(), next()]);
    let mut particles = Particles { positions, weights: columns.next(), origin, meta, kinds: Vec::new() };
    set_kinds(&mut particles, sources, masses);
    Ok(particles)
}

/// What particles weigh.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Masses {
    /// Nothing is known of some of them.
    Unknown,
    /// All the same.
    Same(f64),
    /// Their own, or their layer's.
    Weights,
}

impl Masses {
    fn of(sources: &[LayerSource<'_>]) -> Self {
        let each = |s: &LayerSource<'_>| s.reader.meta().particle_mass;
        let first = sources.first().and_then(each);
        if !sources.iter().all(|s| s.reader.has_weights() || each(s).is_some()) {
            Masses::Unknown
        } else if sources.iter().any(|s| s.reader.has_weights() || each(s) != first) {
            Masses::Weights
        } else {
            first.map_or(Masses::Unknown, Masses::Same)
        }
    }
}

/// Names the layers and says what is known of their masses.
fn set_kinds(particles: &mut Particles, sources: &[LayerSource<'_>], masses: Masses) {
    let mut end = 0;
    let kind = |s: &LayerSource<'_>| {
        let start = end;
        end += s.reader.count() as usize;
        let weighted = masses == Masses::Weights && s.reader.has_weights();
        // A weight of its own is the mass; the layer's is in the weights too, for who reads all.
        let particle_mass = s.reader.meta().particle_mass.filter(|_| masses != Masses::Unknown && !weighted);
        ParticleLayer { name: s.name.clone(), range: start..end, particle_mass, weighted }
    };
    particles.kinds = sources.iter().map(kind).collect();
    if let Masses::Same(mass) = masses {
        particles.meta.particle_mass = Some(mass);
    }
}

/// Reads one layer into its part of the columns (x, y, z and perhaps weights).
fn fill(source: &LayerSource<'_>, parts: Vec<&mut [f32]>, origin: [f64; 3], progress: &dyn Progress) -> Result<()> {
    let reader = source.reader;
    let runs = reader.count().div_ceil(RUN as u64);
    let shift: [f64; 3] = std::array::from_fn(|k| reader.origin()[k] - origin[k]);
    let mass = reader.meta().particle_mass.unwrap_or(1.0) as f32;
    // Runs arrive in any order from several threads: each has its place and its lock.
    let mut places: Vec<Mutex<Option<Vec<&mut [f32]>>>> = (0..runs).map(|_| Mutex::new(Some(Vec::new()))).collect();
    for part in parts {
        for (place, run) in places.iter_mut().zip(part.chunks_mut(RUN)) {
            place.get_mut().unwrap_or_else(|e| e.into_inner()).get_or_insert_default().push(run);
        }
    }
    let wrong = |what: String| Error::input(&source.name, what);
    reader.read(0..runs, progress, &|run, chunk| {
        let place = places.get(run as usize).ok_or_else(|| wrong(format!("run {run} of {runs}")))?;
        let Some(mut columns) = place.lock().unwrap_or_else(|e| e.into_inner()).take() else {
            return Err(wrong(format!("run {run} came twice")));
        };
        if chunk.len() != columns[0].len() {
            return Err(wrong(format!("{} particles in run {run}, {} were told", chunk.len(), columns[0].len())));
        }
        for k in 0..3 {
            match shift[k] {
                0.0 => columns[k].copy_from_slice(chunk.position[k]),
                s => columns[k].iter_mut().zip(chunk.position[k]).for_each(|(o, v)| *o = (f64::from(*v) + s) as f32),
            }
        }
        match (columns.get_mut(3), chunk.weight) {
            (Some(weights), Some(own)) => weights.copy_from_slice(own),
            (Some(weights), None) => weights.fill(mass),
            (None, _) => {}
        }
        Ok(())
    })?;
    let left = |p: Mutex<Option<_>>| p.into_inner().unwrap_or_else(|e| e.into_inner()).is_some();
    let missing = places.into_iter().map(left).filter(|left| *left).count();
    if missing > 0 {
        return Err(wrong(format!("{missing} of {runs} runs are missing")));
    }
    Ok(())
}

/// What a user states about a snapshot, over what its files say.
#[derive(Clone, Debug, Default)]
pub struct Stated {
    /// Periodic box lengths.
    pub box_lengths: Option<[f64; 3]>,
    /// Unit of length.
    pub length_unit: Option<String>,
    /// Unit of mass.
    pub mass_unit: Option<String>,
}

impl Stated {
    /// Writes it over what the files say. The corner of a stated box is the file's, else 0.
    ///
    /// # Errors
    /// [`Error::Argument`] for lengths that are not positive.
    pub fn apply(&self, meta: &mut SnapshotMeta) -> Result<()> {
        if let Some(lengths) = self.box_lengths {
            if !lengths.iter().all(|l| *l > 0.0 && l.is_finite()) {
                return Err(Error::argument(format!("box lengths {lengths:?} must be positive")));
            }
            let origin = meta.cell.map_or([0.0; 3], |c| c.origin);
            meta.cell = Some(Cell { origin, ..Cell::orthogonal(lengths) });
        }
        if let Some(unit) = &self.length_unit {
            meta.length_unit = Some(unit.clone());
        }
        if let Some(unit) = &self.mass_unit {
            meta.mass_unit = Some(unit.clone());
        }
        Ok(())
    }
}
