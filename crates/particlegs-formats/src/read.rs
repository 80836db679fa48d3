//! From the files that a user names to the particles that a user chose.

use crate::folder::resolved;
use crate::open::spool;
use crate::single_file::named;
use crate::{Choice, Description, Snapshot, Species, SpeciesField, fields, raw};
use particlegs_core::context::Context;
use particlegs_core::model::{Dimension, Unit, UnitSystem, Units, WeightKind, is_species};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};
use particlegs_files::input::{Source, SpoolFile, is_stream};
use particlegs_particles::{
    LayerFields, LayeredParticles, Particles, Selection, SnapshotMeta, SnapshotReader, Storage,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl Choice {
    /// Puts what the user states over what the files say; gives notes for the user.
    fn state(&self, meta: &mut SnapshotMeta) -> Result<Vec<String>> {
        meta.state(self.box_lengths, [self.length_unit.as_deref(), self.mass_unit.as_deref()])
    }

    /// Whether numbers may be converted to units that the user states.
    fn converts(&self) -> bool {
        self.convert_units && (self.length_unit.is_some() || self.mass_unit.is_some())
    }

    /// The particles in the units that the user states, where they are to be converted.
    fn converted(&self, particles: Particles, storage: &Storage) -> Result<Particles> {
        if !self.converts() {
            return Ok(particles);
        }
        let said = &particles.meta.units;
        let length = self.length_unit.as_deref().filter(|_| said.length.is_some());
        let mass = self.mass_unit.as_deref().filter(|_| said.mass.is_some());
        let units = said.replaced(&Units::new(length, mass, said.comoving));
        let to = UnitSystem { units: &units, ..particles.meta.unit_system() };
        // The choice that the user made needs no note.
        particles.clone().in_units(&to, storage, &Context::SILENT)
    }

    /// The selection, where it leaves anything out.
    fn kept(&self) -> Option<Selection> {
        self.selection.filter(|s| !s.is_all())
    }

    /// Keeps what a pipe or device gives, to be read in place of its name: it gives its data once.
    pub fn spool(&mut self, source: Source<'_>) -> Result<()> {
        self.spooled = Some(Arc::new(spool(source, self)?));
        Ok(())
    }

    /// Reads what was chosen: raw float32 (a folder with xx.f32, yy.f32, zz.f32, or those files) or any
    /// of [`Choice::formats`]. Columns that do not lie in their file as they are used are put into `storage`.
    pub fn read(&self, paths: &[PathBuf], storage: &Storage, context: &Context<'_>) -> Result<Particles> {
        let at_hand = InputFiles::new(paths, self, context)?;
        Ok(self.read_at_hand(&at_hand, storage, context, false)?.0)
    }

    /// The same, with the fields of each layer, which are read where they are written: none where particles are
    /// dropped, selected or sorted by mass.
    pub fn read_fields(
        &mut self,
        paths: &[PathBuf],
        storage: &Storage,
        context: &Context<'_>,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        let at_hand = InputFiles::new(paths, self, context)?;
        // What a stream has given must be there as long as its fields are.
        self.spooled.clone_from(&at_hand.spooled);
        self.read_at_hand(&at_hand, storage, context, true)
    }

    fn read_at_hand(
        &self,
        at_hand: &InputFiles,
        storage: &Storage,
        context: &Context<'_>,
        with_fields: bool,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        let read = self.read_paths(&at_hand.paths, storage, context, with_fields);
        let (mut particles, fields) = at_hand.named(read)?;
        at_hand.name(&mut particles.meta);
        match self.kept() {
            None => Ok((particles, fields)),
            Some(selection) => Ok((particles.select(selection, storage, context)?, Vec::new())),
        }
    }

    fn read_paths(
        &self,
        paths: &[PathBuf],
        storage: &Storage,
        context: &Context<'_>,
        with_fields: bool,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        let (particles, mut fields) = match SpeciesData::open(paths, self, context, with_fields)? {
            SpeciesData::InPlace(particles, fields) => (particles, fields),
            SpeciesData::Readers(layers, fields) => (layers.load(storage, context)?, fields),
        };
        let count = particles.len();
        let mut particles = self.converted(particles, storage)?;
        say(&self.state(&mut particles.meta)?, context);
        let drop = self.skip_invalid.then_some(storage);
        let particles = particles.checked(&place(paths), drop)?.settle_masses();
        // Fields are as they lie in the files: not where numbers are converted.
        if self.by_mass || self.converts() || particles.len() != count {
            fields.clear();
        }
        Ok((if self.by_mass { particles.layers_by_mass(storage)? } else { particles }, fields))
    }

    /// The particles chosen, to be read where they lie, in parts and in any order; `None` where that cannot be:
    /// for streams, and where particles are dropped, selected, converted or sorted by mass ([`Choice::read`] does those).
    /// Values are not checked. The layers come with their fields if they are wanted.
    pub fn read_later(
        &self,
        paths: &[PathBuf],
        with_fields: bool,
        context: &Context<'_>,
    ) -> Result<Option<LayeredParticles>> {
        let selected = self.skip_invalid || self.by_mass || self.converts() || self.kept().is_some();
        if selected || paths.iter().any(|p| is_stream(p)) {
            return Ok(None);
        }
        let mut source = match SpeciesData::open(paths, self, context, with_fields)? {
            SpeciesData::InPlace(particles, fields) => LayeredParticles::from_particles(&particles).with_fields(fields),
            SpeciesData::Readers(layers, fields) => layers.with_fields(fields),
        };
        say(&self.state(&mut source.meta)?, context);
        Ok(source.random_access().then_some(source))
    }

    /// The description of the files, with what a user states, and if wanted the bounds of each species.
    ///
    /// # Errors
    /// Errors of opening and, for the bounds, of reading.
    pub fn describe(
        &self,
        paths: &[PathBuf],
        bounds: bool,
        context: &Context<'_>,
    ) -> Result<(Description, Vec<Bounds>)> {
        let at_hand = InputFiles::new(paths, self, context)?;
        let (mut description, bounds) = at_hand.named(self.describe_paths(&at_hand.paths, bounds, context))?;
        at_hand.name(&mut description.meta);
        if at_hand.spooled.is_some() {
            // Not the file that the stream was put into.
            description.files = paths.to_vec();
        }
        Ok((description, bounds))
    }

    fn describe_paths(
        &self,
        paths: &[PathBuf],
        bounds: bool,
        context: &Context<'_>,
    ) -> Result<(Description, Vec<Bounds>)> {
        let snapshot = opened(paths, self)?;
        let mut description = snapshot.description().clone();
        let wanted = if bounds { 0..description.species.len() } else { 0..0 };
        let bounds =
            wanted.map(|index| bounds_of(&*snapshot.reader(index, self)?, context)).collect::<Result<Vec<_>>>()?;
        let notes = self.state(&mut description.meta)?;
        description.notes.extend(notes);
        Ok((description, bounds))
    }
}

/// The files to read: those that are named, or what the stream that is named has given.
struct InputFiles {
    paths: Vec<PathBuf>,
    spooled: Option<Arc<SpoolFile>>,
}

impl InputFiles {
    fn new(paths: &[PathBuf], choice: &Choice, context: &Context<'_>) -> Result<InputFiles> {
        let spooled = match (paths, &choice.spooled) {
            ([one], None) if is_stream(one) => Some(Arc::new(spool(Source::open(one, context)?, choice)?)),
            (_, spooled) => spooled.clone(),
        };
        let paths = spooled.as_ref().map_or_else(|| paths.to_vec(), |s| vec![s.path()]);
        Ok(InputFiles { paths, spooled })
    }

    /// The result of reading, with errors that name what people know.
    fn named<T>(&self, read: Result<T>) -> Result<T> {
        read.map_err(|e| match &self.spooled {
            Some(spooled) => spooled.named(e),
            None => e,
        })
    }

    fn name(&self, meta: &mut SnapshotMeta) {
        if let Some(spooled) = &self.spooled {
            meta.name = named(Path::new(spooled.place())).name;
        }
    }
}

/// The species chosen, before a particle is read.
enum SpeciesData {
    /// As they lie in the files.
    InPlace(Particles, Vec<LayerFields>),
    /// Each by its reader, with its fields where they are wanted.
    Readers(LayeredParticles, Vec<LayerFields>),
}

impl SpeciesData {
    fn open(paths: &[PathBuf], choice: &Choice, context: &Context<'_>, with_fields: bool) -> Result<SpeciesData> {
        let snapshot = opened(paths, choice)?;
        let description = snapshot.description();
        let chosen = chosen(&description.species, &choice.species, &description.meta.name)?;
        say(&description.notes, context);
        let weights = chosen.iter().find_map(|&i| description.species[i].other_weights(&choice.weights));
        let wanted = if with_fields { &chosen[..] } else { &[] };
        let fields = || wanted.iter().map(|&i| fields::fields_of(&*snapshot, i, choice)).collect::<Result<_>>();
        let other_fields = || {
            let mut names: Vec<String> = Vec::new();
            for name in chosen.iter().flat_map(|&i| fields::others(&description.species[i], choice)) {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            names
        };
        if let Some(mut particles) = snapshot.in_place(&chosen, choice)? {
            weigh(&mut particles.meta, weights);
            particles.meta.fields = other_fields();
            return Ok(SpeciesData::InPlace(particles, fields()?));
        }
        let layer = |i: usize| Ok((description.species[i].name.clone(), snapshot.reader(i, choice)?.into()));
        let mut layers = LayeredParticles::new(chosen.iter().copied().map(layer).collect::<Result<_>>()?)?;
        weigh(&mut layers.meta, weights);
        layers.meta.fields = other_fields();
        Ok(SpeciesData::Readers(layers, fields()?))
    }
}

/// Says what weights are of a field that is not the species' own masses. Of what is no mass the unit of weights is that
/// of mass, and its name where it states none.
fn weigh(meta: &mut SnapshotMeta, field: Option<(&SpeciesField, WeightKind)>) {
    let Some((SpeciesField { name, unit, .. }, kind)) = field else { return };
    let other = (kind == WeightKind::Additive).then_some(name);
    meta.weight_name = other.cloned();
    if let Some(text) = unit.as_ref().or(other) {
        meta.units.mass = Some(Unit::parse(text, Dimension::Mass));
    }
}

fn say(notes: &[String], context: &Context<'_>) {
    notes.iter().for_each(|note| context.note(note));
}

/// The name of the files in errors: that of the first.
fn place(paths: &[PathBuf]) -> String {
    paths.first().map(|p| p.display().to_string()).unwrap_or_default()
}

/// Opens raw columns or files of a format; a frame is asked for only where there are frames.
fn opened(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let snapshot = match choice.format.is_none() && raw::is_raw(paths) {
        true => choice.fits("raw", &place(paths)).and_then(|()| raw::open(paths))?,
        false => choice.open(&resolved(paths, choice)?)?,
    };
    let description = snapshot.description();
    if choice.frame.is_some() && description.frames.is_none() {
        let name = &description.meta.name;
        return Err(Error::argument(format!("{name} is a single snapshot without frames")));
    }
    if choice.keep_unwrapped && description.frames.is_none() {
        return Err(Error::input(place(paths), "unwrapped positions are only stored in trajectories"));
    }
    Ok(snapshot)
}

/// Bounds of what a reader reads, invalid positions apart.
fn bounds_of(reader: &dyn SnapshotReader, context: &Context<'_>) -> Result<Bounds> {
    let all = std::sync::Mutex::new(Bounds::empty());
    let origin = reader.origin();
    let runs = reader.count().div_ceil(particlegs_particles::RUN as u64);
    reader.read(0..runs, context, &|_, chunk| {
        let ends = chunk.position.map(|c| {
            let finite = c.iter().filter(|v| v.is_finite());
            finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)))
        });
        let run_bounds = Bounds {
            min: std::array::from_fn(|k| origin[k] + f64::from(ends[k].0)),
            max: std::array::from_fn(|k| origin[k] + f64::from(ends[k].1)),
        };
        let mut all = all.lock().unwrap_or_else(|e| e.into_inner());
        *all = all.union(&run_bounds);
        Ok(())
    })?;
    Ok(all.into_inner().unwrap_or_else(|e| e.into_inner()))
}

/// Indices of the species that `names` choose, each once; all without names.
fn chosen(species: &[Species], names: &[String], place: &str) -> Result<Vec<usize>> {
    if species.is_empty() {
        return Err(Error::input(place, "it holds no particles"));
    }
    if names.is_empty() {
        return Ok((0..species.len()).collect());
    }
    let mut chosen = Vec::new();
    for name in names {
        let lower = name.to_lowercase();
        let fits = |s: &Species| is_species(&s.name, name) || s.aliases.contains(&lower);
        let index = species.iter().position(fits).ok_or_else(|| {
            let type_names: Vec<String> = species.iter().map(called).collect();
            Error::input_with(
                place,
                format!("there are no particles of type `{name}`"),
                format!("the types are: {}", type_names.join(", ")),
            )
        })?;
        if !chosen.contains(&index) {
            chosen.push(index);
        }
    }
    Ok(chosen)
}

/// A species as people choose it: `PartType1 (1, dm)`.
fn called(s: &Species) -> String {
    if s.aliases.is_empty() { s.name.clone() } else { format!("{} ({})", s.name, s.aliases.join(", ")) }
}
