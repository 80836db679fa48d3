//! Selections of particles: a region, every K-th, an exact random sample; in this order.
//!
//! Work goes by fixed chunks of the tiled snapshot ("runs"), layer by layer and tile by tile; what a
//! run keeps depends on the run's number and on whole-number sums over the runs before it, never on
//! threads.

use super::fields::{LayerFields, SourceField, StoredNumber};
use super::periodic::NearestImages;
use super::storage::CHUNK;
use super::{ChunkBuffer, Particles, SnapshotMeta, Storage, Tiling};
use particlegs_core::context::Context;
use particlegs_core::math::{Purpose, Random, each_axis};
use particlegs_core::model::Layer;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, parallel};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// The particles to keep of a tiled snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Selection {
    /// Keep positions with min <= p < max along each axis, as written (f32).
    pub crop: Option<Bounds>,
    /// Take each particle at its periodic image nearest to the middle of the crop.
    pub wrap: bool,
    /// Then keep the first of every so many, in order.
    pub every: u64,
    /// Then keep exactly so many, drawn at random; order is kept.
    pub sample: Option<u64>,
    /// Keep what the draw leaves out instead of what it takes.
    pub left_out: bool,
    /// Seed of the draw.
    pub seed: u64,
}

impl Selection {
    /// Keeps all.
    pub fn all() -> Self {
        Selection { crop: None, wrap: false, every: 1, sample: None, left_out: false, seed: 0 }
    }

    /// One of every `k` particles, the first of them, in the order of the file.
    pub fn one_in(k: u64) -> Self {
        Selection { every: k, ..Selection::all() }
    }

    /// Keeps the particles in a window about a point, across the periodic boundary.
    pub fn window(center: [f64; 3], width: [f64; 3]) -> Self {
        let (min, max) = (each_axis(|k| center[k] - 0.5 * width[k]), each_axis(|k| center[k] + 0.5 * width[k]));
        Selection { crop: Some(Bounds { min, max }), wrap: true, ..Selection::all() }
    }

    /// Checks the region.
    pub fn check(self) -> Result<Self> {
        let fine = |b: &Bounds| (0..3).all(|k| b.min[k] < b.max[k] && b.max[k].is_finite() && b.min[k].is_finite());
        if self.crop.as_ref().is_none_or(fine) {
            return Ok(self);
        }
        let message = "the region must be finite, and its lower bound must be below its upper bound on each axis";
        Err(Error::argument(message))
    }

    /// As a model's recipe says it: options of the command, such as `region`, with their values. The recipe has the seed
    /// as a key of its own.
    pub fn options(&self) -> BTreeMap<String, String> {
        let join = |v: &[f64]| v.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        // To twelve digits: bounds that were computed as a centre and half a width give back the numbers as written.
        let plain = |v: f64| format!("{v:.11e}").parse().unwrap_or(v);
        let mut options = BTreeMap::new();
        let mut option = |name: &str, value: String| options.insert(name.to_string(), value);
        match self.crop {
            Some(b) if self.wrap => {
                let center: [f64; 3] = each_axis(|k| plain(0.5 * (b.min[k] + b.max[k])));
                let width: [f64; 3] = each_axis(|k| plain(b.max[k] - b.min[k]));
                option("center", join(&center));
                option("width", join(if width == [width[0]; 3] { &width[..1] } else { &width[..] }));
            }
            Some(b) => _ = option("region", join(&[0, 1, 2].map(|k| [b.min[k], b.max[k]]).concat())),
            None => {}
        }
        if self.every != 1 {
            option("every", self.every.to_string());
        }
        self.sample.iter().for_each(|n| _ = option("sample", n.to_string()));
        if self.left_out {
            option("left-out", String::new());
        }
        options
    }

    /// Whether it keeps all as they are.
    pub fn is_all(&self) -> bool {
        *self == Selection { seed: self.seed, ..Selection::all() }
    }
}

/// A run's particles, as they are to be written; reused from run to run.
#[derive(Default)]
pub struct Run {
    /// x, y, z about [`SelectedParticles::origin`], then weights (empty where there are none).
    pub columns: [Vec<f32>; 4],
    /// x, y, z about 0; empty where [`SelectedParticles::is_wide`] is not so.
    pub positions: [Vec<f64>; 3],
    /// The numbers of the layer's fields ([`SelectedParticles::fields`]), component by component, each as [`StoredNumber`]
    /// has it.
    pub fields: Vec<Vec<f64>>,
    kept: Vec<u32>,
    buffer: ChunkBuffer,
}

impl Run {
    /// Position of particle `i` about 0, where columns are about `origin`.
    pub fn wide(&self, origin: [f64; 3], i: usize) -> [f64; 3] {
        each_axis(|k| self.positions[k].get(i).copied().unwrap_or_else(|| origin[k] + f64::from(self.columns[k][i])))
    }

    /// Component `column` of the layer's fields for particle `i`.
    pub fn field(&self, column: usize, i: usize) -> StoredNumber {
        StoredNumber(self.fields[column][i])
    }
}

/// The draw's place in the order of keys: a particle is drawn where its own is not above.
type Key = (u64, u64, u32);

impl Particles {
    /// The particles that a selection keeps, in columns of `storage`, about the same origin.
    pub fn select(&self, selection: Selection, storage: &Storage, context: &Context<'_>) -> Result<Particles> {
        SelectedParticles::about(self.origin, self, Tiling::single(), selection, context)?.collect(storage, context)
    }
}

/// Runs of a tiled snapshot and what each keeps: what writers are given.
pub struct SelectedParticles<'a> {
    particles: &'a Particles,
    /// The point that written positions are relative to.
    origin: [f64; 3],
    tiling: Tiling,
    selection: Selection,
    meta: SnapshotMeta,
    layers: &'a [Layer<Range<usize>>],
    /// Runs before each layer, and in all.
    layer_runs: Vec<u64>,
    images: Option<NearestImages>,
    /// Fields of each layer; none where none are carried.
    fields: Vec<LayerFields>,
    /// Particles inside the crop in the runs before each run; empty without a crop.
    cropped_before: Vec<u64>,
    /// The last key drawn.
    last_key: Option<Key>,
    /// Particles kept in the runs before each run, and in all.
    first: Vec<u64>,
}

impl<'a> SelectedParticles<'a> {
    /// Counts what every run keeps of `particles`, repeated by `tiling`.
    pub fn new(particles: &'a Particles, tiling: Tiling, selection: Selection, context: &Context<'_>) -> Result<Self> {
        let far = particles.bounds();
        let far = far.float32_origin(far.default_radius(particles.len() as u64));
        let origin = each_axis(|k| if far[k] == 0.0 { 0.0 } else { particles.origin[k] });
        Self::about(origin, particles, tiling, selection, context)
    }

    /// With the fields of each layer, read where they are written.
    ///
    /// # Panics
    /// If there are not as many of them as layers.
    pub fn with_fields(mut self, fields: Vec<LayerFields>) -> Self {
        assert!(fields.len() == self.layers.len(), "fields for every layer");
        self.fields = fields;
        self
    }

    /// The point that the columns of runs are relative to: 0 unless float32 would not hold positions there.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Whether positions are known to more digits than float32 has about 0. Runs have them as float64 then, too.
    pub fn is_wide(&self) -> bool {
        self.origin != [0.0; 3] || self.fields.iter().any(LayerFields::has_positions)
    }

    /// The fields of each layer of [`SelectedParticles::layers`]; nothing where none are carried.
    pub fn fields(&self) -> Vec<&[SourceField]> {
        let has_particles = |i: &usize| self.first(self.layer_runs[*i]) < self.first(self.layer_runs[*i + 1]);
        (0..self.fields.len()).filter(has_particles).map(|i| &self.fields[i].fields[..]).collect()
    }

    /// The same, with positions about `origin`.
    fn about(
        origin: [f64; 3],
        particles: &'a Particles,
        tiling: Tiling,
        selection: Selection,
        context: &Context<'_>,
    ) -> Result<Self> {
        particles.check_files()?;
        if selection.every == 0 {
            return Err(Error::argument("the interval between particles must be at least 1, not 0"));
        }
        let mut meta = particles.meta.clone();
        // The box of all tiles; the output has it only where nothing is cut out.
        let cell = meta.cell.take().map(|cell| tiling.cell(&cell));
        let images = match (selection.crop, selection.wrap) {
            (Some(crop), true) => Some(NearestImages::about(&crop, cell.as_ref(), &meta.name)?),
            _ => None,
        };
        if selection.crop.is_none() {
            meta.cell = cell;
        }
        let layers = particles.layers();
        let runs = layers.iter().map(|l| l.content.len().div_ceil(CHUNK) as u64 * tiling.tiles());
        let layer_runs = running_sums(runs.collect());
        let (cropped_before, last_key, first) = Default::default();
        let mut selected_particles = SelectedParticles {
            particles,
            origin,
            tiling,
            selection,
            meta,
            layers,
            layer_runs,
            images,
            fields: Vec::new(),
            cropped_before,
            last_key,
            first,
        };
        selected_particles.count(context)?;
        Ok(selected_particles)
    }

    fn count(&mut self, context: &Context<'_>) -> Result<()> {
        if self.selection.crop.is_some() {
            // `every` counts particles inside the crop, through all runs.
            self.cropped_before = running_sums(self.map_runs(context, |id, run| {
                self.fill(id, run)?;
                Ok(self.inside(run).count() as u64)
            })?);
        }
        if let Some(wanted) = self.selection.sample {
            self.last_key = self.draw(wanted, context)?;
        }
        // Where all are kept, the sizes of runs are known without a pass.
        self.first = if self.selection.is_all() {
            running_sums((0..self.runs()).map(|id| self.range(id).len() as u64).collect())
        } else {
            running_sums(self.map_runs(context, |id, run| {
                self.keep(id, run)?;
                Ok(run.kept.len() as u64)
            })?)
        };
        if self.total() == 0 {
            return Err(Error::argument("the selection contains no particles"));
        }
        Ok(())
    }

    /// Metadata of the particles kept: a crop has no cell.
    pub fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    /// The snapshot and the selection, for people.
    pub fn notes(&self) -> serde_json::Value {
        let s = &self.selection;
        serde_json::json!({
            "snapshot": self.particles.meta.name,
            "particles": self.particles.len(),
            "tiles": self.tiling.tiles(),
            "crop": s.crop,
            "wrap": s.wrap,
            "every": s.every,
            "sample": s.sample,
            "left_out": s.left_out,
            "seed": s.sample.map(|_| s.seed),
        })
    }

    /// Whether there are weights.
    pub fn weighted(&self) -> bool {
        self.particles.weights().is_some()
    }

    /// The layers that keep particles, and their particles in the output: each a contiguous part of it.
    pub fn layers(&self) -> Vec<Layer<Range<u64>>> {
        let range = |i: usize| self.first(self.layer_runs[i])..self.first(self.layer_runs[i + 1]);
        let layers = self.layers.iter().enumerate().map(|(i, l)| l.with(range(i)));
        layers.filter(|l| !l.content.is_empty()).collect()
    }

    /// The layer (an index into [`SelectedParticles::layers`]) that run `id` lies in; a run may keep nothing.
    pub fn layer_of(&self, id: u64) -> usize {
        let index = self.layer_runs.partition_point(|&r| r <= id) - 1;
        (0..index).filter(|&i| self.first(self.layer_runs[i]) < self.first(self.layer_runs[i + 1])).count()
    }

    /// Number of runs.
    pub fn runs(&self) -> u64 {
        self.layer_runs[self.layer_runs.len() - 1]
    }

    /// Number of particles kept.
    pub fn total(&self) -> u64 {
        self.first.last().copied().unwrap_or(0)
    }

    /// The first particle of run `id` in the output; the number of all for the run after the last.
    pub fn first(&self, id: u64) -> u64 {
        self.first[id as usize]
    }

    /// The particles kept, in columns.
    fn collect(&self, storage: &Storage, context: &Context<'_>) -> Result<Particles> {
        let columns = if self.weighted() { 4 } else { 3 };
        storage.announce("the particles chosen", 4 * columns as u64 * self.total(), context);
        let mut values = storage.columns("the particles chosen", columns, self.total() as usize)?;
        let mut places: Vec<Vec<&mut [f32]>> = (0..self.runs()).map(|_| Vec::new()).collect();
        for column in &mut values {
            let mut rest = &mut column[..];
            for (id, place) in places.iter_mut().enumerate() {
                let (part, after) = rest.split_at_mut((self.first[id + 1] - self.first[id]) as usize);
                place.push(part);
                rest = after;
            }
        }
        let places: Vec<_> = places.into_iter().map(Mutex::new).collect();
        self.for_each_run(context, &|id, run| {
            let mut place = places[id as usize].lock().unwrap_or_else(|e| e.into_inner());
            place.iter_mut().zip(&run.columns).for_each(|(to, from)| to.copy_from_slice(from));
            Ok(())
        })?;
        let layers = self.layers().into_iter().map(|l| l.map(|r| r.start as usize..r.end as usize)).collect();
        Particles::from_buffers(values, self.origin, self.meta.clone(), layers)
    }

    /// Calls `each` with the number of every run and what it keeps, in parallel.
    pub fn for_each_run(
        &self,
        context: &Context<'_>,
        each: &(dyn Fn(u64, &mut Run) -> Result<()> + Sync),
    ) -> Result<()> {
        self.map_runs(context, |id, run| {
            self.load(id, run)?;
            each(id, run)
        })
        .map(drop)
    }

    /// Fills `run` with what run `id` keeps.
    pub fn load(&self, id: u64, run: &mut Run) -> Result<()> {
        self.keep(id, run)?;
        self.load_wide(id, run)?;
        if run.kept.len() < run.columns[0].len() {
            let indices = &run.kept;
            run.columns.iter_mut().for_each(|c| thin_out(c, indices));
            run.positions.iter_mut().chain(&mut run.fields).for_each(|c| thin_out(c, indices));
        }
        Ok(())
    }

    /// Fills positions as float64 and fields, where there are.
    fn load_wide(&self, id: u64, run: &mut Run) -> Result<()> {
        let (_, tile, chunk) = self.place(id);
        let index = self.layer_runs.partition_point(|&r| r <= id) - 1;
        let fields = self.fields.get(index);
        match fields {
            Some(layer_fields) => layer_fields.read_stored(chunk as u64, |_| true, &mut run.fields)?,
            None => run.fields.clear(),
        }
        let Run { positions, columns, .. } = run;
        positions.iter_mut().for_each(Vec::clear);
        if !self.is_wide() {
            return Ok(());
        }
        // Full positions come from the source anew: the columns are rounded already.
        if fields.is_some_and(LayerFields::has_positions) {
            fields.map_or(Ok(()), |layer_fields| layer_fields.read_positions(chunk as u64, positions))?;
            let shift = self.tiling.shift(tile);
            let [x, y, z] = positions;
            for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
                let moved: [f64; 3] = each_axis(|k| [*x, *y, *z][k] + shift[k]);
                [*x, *y, *z] = self.images.as_ref().map_or(moved, |images| images.nearest_to(moved));
            }
        } else {
            for k in 0..3 {
                positions[k].extend(columns[k].iter().map(|&v| self.origin[k] + f64::from(v)));
            }
        }
        Ok(())
    }

    /// Layer, tile and chunk of run `id`.
    fn place(&self, id: u64) -> (&Layer<Range<usize>>, u64, usize) {
        let index = self.layer_runs.partition_point(|&r| r <= id) - 1;
        let layer = &self.layers[index];
        let chunks = layer.content.len().div_ceil(CHUNK) as u64;
        let layer_run = id - self.layer_runs[index];
        (layer, layer_run / chunks, (layer_run % chunks) as usize)
    }

    fn range(&self, id: u64) -> Range<usize> {
        let (layer, _, chunk) = self.place(id);
        let start = layer.content.start + chunk * CHUNK;
        start..layer.content.end.min(start + CHUNK)
    }

    /// All particles of run `id`, shifted to their tile and rounded to f32.
    fn fill(&self, id: u64, run: &mut Run) -> Result<()> {
        let shift = self.tiling.shift(self.place(id).1);
        let chunk = self.particles.chunk(self.range(id), &mut run.buffer);
        run.columns.iter_mut().for_each(Vec::clear);
        // Offsets are added in f64, and the sum is rounded once.
        let offset: [f64; 3] = each_axis(|k| self.particles.origin[k] + shift[k]);
        match &self.images {
            Some(images) => images.nearest(&chunk, offset, self.origin, &mut run.columns),
            None => (0..3).for_each(|k| {
                let offset = self.particles.origin[k] - self.origin[k] + shift[k];
                run.columns[k].extend(chunk.position[k].iter().map(|&v| (f64::from(v) + offset) as f32));
            }),
        }
        if run.columns[..3].iter().flatten().any(|v| !v.is_finite()) {
            return Err(Error::input(&self.particles.meta.name, "some positions are too large for float32"));
        }
        run.columns[3].extend_from_slice(chunk.weight.unwrap_or(&[]));
        Ok(())
    }

    /// The particles of a filled run that are inside the crop.
    fn inside<'r>(&self, run: &'r Run) -> impl Iterator<Item = u32> + use<'r> {
        let (crop, origin) = (self.selection.crop, self.origin);
        let [x, y, z, _] = &run.columns;
        (0..x.len() as u32).filter(move |&i| {
            // As written: the rounded position decides, so that no output lies outside its crop.
            let local = [x, y, z].map(|c| f64::from(c[i as usize]));
            let p: [f64; 3] = each_axis(|k| local[k] + origin[k]);
            crop.is_none_or(|b| (0..3).all(|k| b.min[k] <= p[k] && p[k] < b.max[k]))
        })
    }

    /// Fills run `id` and lists what survives crop and thinning, before any draw.
    fn thin(&self, id: u64, run: &mut Run) -> Result<()> {
        self.fill(id, run)?;
        let before = self.cropped_before.get(id as usize).copied();
        // Without a crop the particle's own number counts.
        let before = before.unwrap_or_else(|| {
            let (layer, tile, _) = self.place(id);
            let layers_before = self.tiling.tiles() * layer.content.start as u64;
            layers_before + tile * layer.content.len() as u64 + (self.range(id).start - layer.content.start) as u64
        });
        let mut indices = std::mem::take(&mut run.kept);
        indices.clear();
        let every = self.selection.every;
        indices.extend((before..).zip(self.inside(run)).filter(|(rank, _)| rank % every == 0).map(|(_, i)| i));
        run.kept = indices;
        Ok(())
    }

    /// Fills run `id` and lists what it keeps.
    fn keep(&self, id: u64, run: &mut Run) -> Result<()> {
        self.thin(id, run)?;
        if let Some(last) = self.last_key {
            let keys = self.keys(id);
            run.kept.retain(|&i| ((keys[i as usize], id, i) <= last) != self.selection.left_out);
        }
        Ok(())
    }

    fn keys(&self, id: u64) -> Vec<u64> {
        let mut random = Random::from_purpose(Purpose::ParticleSample, self.selection.seed, id);
        // For every particle of the run, inside the crop or not: its key depends on the seed and its place alone.
        self.range(id).map(|_| random.bits()).collect()
    }

    /// The largest of the `wanted` smallest keys: a histogram of their leading bits, then an exact
    /// look at the one bin in which it lies. `None` where all are wanted.
    fn draw(&self, wanted: u64, context: &Context<'_>) -> Result<Option<Key>> {
        const SHIFT: u32 = 64 - 16;
        // Keys are drawn anew in each pass: kept, they would take eight bytes a particle.
        let bins: Vec<AtomicU64> = (0..1 << 16).map(|_| AtomicU64::new(0)).collect();
        self.map_runs(context, |id, run| {
            self.thin(id, run)?;
            let keys = self.keys(id);
            for &i in &run.kept {
                bins[(keys[i as usize] >> SHIFT) as usize].fetch_add(1, Ordering::Relaxed);
            }
            Ok(())
        })?;
        let histogram: Vec<u64> = bins.into_iter().map(AtomicU64::into_inner).collect();
        let available: u64 = histogram.iter().sum();
        if wanted == 0 || wanted > available {
            return Err(Error::argument(format!(
                "the sample must be 1 to {available} (the number of particles), not {wanted}"
            )));
        }
        let mut left = wanted;
        // Ends at the bin of the last key drawn; `left` then counts the keys drawn within it.
        let bin = histogram.iter().position(|&n| {
            let here = left <= n;
            left -= if here { 0 } else { n };
            here
        });
        let bin = bin.unwrap_or(histogram.len() - 1) as u64;
        let parts: Vec<Vec<Key>> = self.map_runs(context, |id, run| {
            self.thin(id, run)?;
            let keys = self.keys(id);
            let run_keys = run.kept.iter().map(|&i| (keys[i as usize], id, i));
            Ok(run_keys.filter(|k| k.0 >> SHIFT == bin).collect())
        })?;
        let mut keys: Vec<Key> = parts.into_iter().flatten().collect();
        // Run and number decide between equal keys, so that exactly as many as wanted are drawn.
        keys.sort_unstable();
        Ok(keys.get(left as usize - 1).copied())
    }

    /// Calls `each` with the number of every run, in parallel, with scratch space for [`SelectedParticles::load`];
    /// gives its results in the order of the runs.
    pub fn map_runs<R: Send>(
        &self,
        context: &Context<'_>,
        each: impl Fn(u64, &mut Run) -> Result<R> + Sync,
    ) -> Result<Vec<R>> {
        let scratch = parallel::Scratch::<Run>::default();
        parallel::try_map(0..self.runs(), |id| {
            context.check()?;
            scratch.with(|run| each(id, run))
        })
    }
}

/// Keeps the numbers at these places, where there are any numbers.
fn thin_out<T: Copy>(column: &mut Vec<T>, indices: &[u32]) {
    if !column.is_empty() {
        // In place: indices ascend, so that no number is overwritten before it is moved.
        indices.iter().enumerate().for_each(|(to, &from)| column[to] = column[from as usize]);
        column.truncate(indices.len());
    }
}

/// 0, a, a + b, ...: one longer than the input.
fn running_sums(counts: Vec<u64>) -> Vec<u64> {
    let mut sums = vec![0];
    let mut sum = 0;
    sums.extend(counts.iter().map(|c| {
        sum += c;
        sum
    }));
    sums
}
