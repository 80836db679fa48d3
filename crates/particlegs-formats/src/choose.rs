//! From the files that a user names to the particles that a user chose.

use crate::folder::resolved;
use crate::{Description, Fields, OpenOptions, Snapshot, Species, open, spool};
use particlegs::input::{Source, Spooled, is_stream};
use particlegs::model::{Layer, Mass};
use particlegs::particles::{
    Bounds, LayerSource, Layered, ONE_LAYER, Particles, Room, Selection, SnapshotMeta, SnapshotReader, Stated,
    check_values, layers_by_mass, load, open_raw, select, settle_masses,
};
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// What to read of a snapshot.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// Format and frame.
    pub open: OpenOptions,
    /// Names, numbers or aliases of species; all by default. Each becomes a layer.
    pub species: Vec<String>,
    /// Fields.
    pub fields: Fields,
    /// Layers by mass within a species instead of one a species.
    pub by_mass: bool,
    /// Drop particles with invalid values instead of refusing them.
    pub skip_invalid: bool,
    /// What the user states over what the files say.
    pub stated: Stated,
    /// What the stream that is named has given already.
    pub spooled: Option<Arc<Spooled>>,
}

/// The files to read: those that are named, or what the stream that is named has given.
struct AtHand {
    paths: Vec<PathBuf>,
    spooled: Option<Arc<Spooled>>,
}

impl AtHand {
    fn of(paths: &[PathBuf], choice: &Choice, progress: &dyn Progress) -> Result<AtHand> {
        let spooled = match (paths, &choice.spooled) {
            ([one], None) if is_stream(one) => Some(Arc::new(spool(Source::open(one, progress)?, &choice.open)?)),
            (_, spooled) => spooled.clone(),
        };
        let paths = spooled.as_ref().map_or_else(|| paths.to_vec(), |s| vec![s.path()]);
        Ok(AtHand { paths, spooled })
    }

    /// What `read` gives, with the names that people know.
    fn named<T>(&self, read: Result<T>) -> Result<T> {
        read.map_err(|e| match &self.spooled {
            Some(spooled) => spooled.named(e),
            None => e,
        })
    }

    fn name(&self, meta: &mut SnapshotMeta) {
        if let Some(spooled) = &self.spooled {
            meta.name = spooled.place().into();
        }
    }
}

/// Reads what was chosen: raw float32 (a folder with xx.f32, yy.f32, zz.f32, or those files) or any
/// format of [`crate::FORMATS`]. What does not lie in its file as it is used is put into `room`.
///
/// # Errors
/// Those of opening and reading; [`Error::Argument`] for a species that there is not.
pub fn read(paths: &[PathBuf], choice: &Choice, room: &Room, progress: &dyn Progress) -> Result<Particles> {
    let at_hand = AtHand::of(paths, choice, progress)?;
    let mut particles = at_hand.named(read_at_hand(&at_hand.paths, choice, room, progress))?;
    at_hand.name(&mut particles.meta);
    Ok(particles)
}

fn read_at_hand(paths: &[PathBuf], choice: &Choice, room: &Room, progress: &dyn Progress) -> Result<Particles> {
    let mut particles = match is_raw(paths) && choice.open.format.is_none() {
        true => chosen_of_raw(open_raw(paths)?, choice)?,
        false => load(&species_of(&*opened(paths, choice)?, choice, progress)?, room, progress)?,
    };
    say(&choice.stated.apply(&mut particles.meta)?, progress);
    let drop = choice.skip_invalid.then_some(room);
    let particles = settle_masses(check_values(particles, &place(paths), drop)?);
    if choice.by_mass { layers_by_mass(&particles, room) } else { Ok(particles) }
}

/// [`read`], then what a selection keeps.
///
/// # Errors
/// As [`read`] and [`select`].
pub fn read_selected(
    paths: &[PathBuf],
    choice: &Choice,
    selection: Selection,
    room: &Room,
    progress: &dyn Progress,
) -> Result<Particles> {
    let particles = read(paths, choice, room, progress)?;
    if selection.is_all() { Ok(particles) } else { select(&particles, selection, room, progress) }
}

/// What was chosen, to be read where it lies, in parts and in any order; `None` where that cannot be:
/// for streams, and where particles are dropped, selected or sorted by mass ([`read_selected`] does
/// those). Values are not checked.
///
/// # Errors
/// Those of opening; [`Error::Argument`] for a species that there is not.
pub fn read_later(
    paths: &[PathBuf],
    choice: &Choice,
    selection: Selection,
    progress: &dyn Progress,
) -> Result<Option<Layered>> {
    if choice.skip_invalid || choice.by_mass || !selection.is_all() || paths.iter().any(|p| is_stream(p)) {
        return Ok(None);
    }
    let mut source = match is_raw(paths) && choice.open.format.is_none() {
        true => Layered::of(&chosen_of_raw(open_raw(paths)?, choice)?),
        false => species_of(&*opened(paths, choice)?, choice, progress)?,
    };
    say(&choice.stated.apply(&mut source.meta)?, progress);
    Ok(source.random_access().then_some(source))
}

fn say(notes: &[String], progress: &dyn Progress) {
    notes.iter().for_each(|note| progress.message(&format!("note: {note}")));
}

/// How errors name what was named.
fn place(paths: &[PathBuf]) -> String {
    paths.first().map(|p| p.display().to_string()).unwrap_or_default()
}

/// What the files say, with what a user states, and if wanted the bounds of each species.
///
/// # Errors
/// Those of opening and, for the bounds, reading.
pub fn describe(
    paths: &[PathBuf],
    choice: &Choice,
    bounds: bool,
    progress: &dyn Progress,
) -> Result<(Description, Vec<Bounds>)> {
    let at_hand = AtHand::of(paths, choice, progress)?;
    let (mut description, bounds) = at_hand.named(describe_at_hand(&at_hand.paths, choice, bounds, progress))?;
    at_hand.name(&mut description.meta);
    if at_hand.spooled.is_some() {
        description.files = paths.to_vec();
    }
    Ok((description, bounds))
}

fn describe_at_hand(
    paths: &[PathBuf],
    choice: &Choice,
    bounds: bool,
    progress: &dyn Progress,
) -> Result<(Description, Vec<Bounds>)> {
    if is_raw(paths) && choice.open.format.is_none() {
        return describe_raw(paths, choice);
    }
    let snapshot = opened(paths, choice)?;
    let mut description = snapshot.description().clone();
    let wanted = if bounds { 0..description.species.len() } else { 0..0 };
    let bounds = wanted
        .map(|index| bounds_of(&*snapshot.reader(index, &choice.fields)?, progress))
        .collect::<Result<Vec<_>>>()?;
    let notes = choice.stated.apply(&mut description.meta)?;
    description.notes.extend(notes);
    Ok((description, bounds))
}

/// Opens files of a format; a frame is asked for only where there are frames.
fn opened(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let snapshot = open(&resolved(paths, &choice.open)?, &choice.open)?;
    if choice.open.frame.is_some() && snapshot.description().frames.is_none() {
        return Err(no_frames(&snapshot.description().meta.name));
    }
    Ok(snapshot)
}

fn no_frames(name: &str) -> Error {
    Error::argument(format!("{name} is one snapshot: it has no frames to choose from"))
}

/// Bounds of what a reader reads, invalid positions apart.
fn bounds_of(reader: &dyn SnapshotReader, progress: &dyn Progress) -> Result<Bounds> {
    let all = std::sync::Mutex::new(Bounds::empty());
    let origin = reader.origin();
    let runs = reader.count().div_ceil(particlegs::particles::RUN as u64);
    reader.read(0..runs, progress, &|_, chunk| {
        let ends = chunk.position.map(|c| {
            let finite = c.iter().filter(|v| v.is_finite());
            finite.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)))
        });
        let own = Bounds {
            min: std::array::from_fn(|k| origin[k] + f64::from(ends[k].0)),
            max: std::array::from_fn(|k| origin[k] + f64::from(ends[k].1)),
        };
        let mut all = all.lock().unwrap_or_else(|e| e.into_inner());
        *all = all.union(&own);
        Ok(())
    })?;
    Ok(all.into_inner().unwrap_or_else(|e| e.into_inner()))
}

/// Raw data have no head: a folder with columns, or columns that no format claims.
fn is_raw(paths: &[PathBuf]) -> bool {
    match paths {
        [folder] => folder.join("xx.f32").exists(),
        [x, ..] => (3..=4).contains(&paths.len()) && crate::detect(x).is_err(),
        [] => false,
    }
}

fn species_of(snapshot: &dyn Snapshot, choice: &Choice, progress: &dyn Progress) -> Result<Layered> {
    let description = snapshot.description();
    let chosen = chosen(&description.species, &choice.species, &description.meta.name)?;
    say(&description.notes, progress);
    let layer = |i: usize| {
        let reader = snapshot.reader(i, &choice.fields)?.into();
        Ok(LayerSource { name: description.species[i].name.clone(), reader })
    };
    Layered::new(chosen.into_iter().map(layer).collect::<Result<_>>()?)
}

/// Indices of the species that `names` choose, each once; all without names.
fn chosen(species: &[Species], names: &[String], place: &str) -> Result<Vec<usize>> {
    if species.is_empty() {
        return Err(Error::input(place, "no particles"));
    }
    if names.is_empty() {
        return Ok((0..species.len()).collect());
    }
    let mut chosen = Vec::new();
    for name in names {
        let lower = name.to_lowercase();
        let fits = |s: &Species| s.name.to_lowercase() == lower || s.aliases.contains(&lower);
        let index = species.iter().position(fits).ok_or_else(|| {
            let there: Vec<String> = species.iter().map(called).collect();
            Error::input_hint(
                place,
                format!("no particles of type `{name}`"),
                format!("there are: {}", there.join(", ")),
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

/// The layers chosen of raw data, and their weights or none.
fn chosen_of_raw(mut particles: Particles, choice: &Choice) -> Result<Particles> {
    if choice.open.frame.is_some() {
        return Err(no_frames(&particles.meta.name));
    }
    if let Some(name) = choice.fields.positions.as_deref().filter(|name| *name != "xx,yy,zz") {
        return Err(Error::argument(format!("raw data have no field `{name}`: positions are in xx, yy and zz")));
    }
    match &choice.fields.weights {
        crate::Weights::Auto => {}
        crate::Weights::None => {
            let counted = |l: &Layer<_>| Layer { mass: Mass::Unknown, ..l.clone() };
            let layers: Vec<_> = particles.layers().iter().map(counted).collect();
            let one_kind = layers.len() == 1 && layers[0].name == ONE_LAYER;
            particles = particles.without_weights().with_layers(if one_kind { Vec::new() } else { layers });
        }
        crate::Weights::Field(name) if name == "ww" || name == "ww.f32" => {}
        crate::Weights::Field(name) => {
            return Err(Error::argument(format!("raw data have no field `{name}`: weights are in ww.f32")));
        }
    }
    if choice.species.is_empty() {
        return Ok(particles);
    }
    let layers = particles.layers();
    match &choice.species[..] {
        [name] => match layers.iter().find(|l| l.name == *name) {
            Some(layer) => Ok(particles.of_layer(layer)),
            None => {
                let there: Vec<&str> = layers.iter().map(|l| &l.name[..]).collect();
                Err(Error::argument(format!("no particles of type `{name}`; there are: {}", there.join(", "))))
            }
        },
        _ => Err(Error::argument("raw data give all their layers or one: name one --particle-type")),
    }
}

fn describe_raw(paths: &[PathBuf], choice: &Choice) -> Result<(Description, Vec<Bounds>)> {
    let mut particles = open_raw(paths)?;
    let notes = choice.stated.apply(&mut particles.meta)?;
    let scalar = |name: &str| crate::Field { name: name.into(), kind: "f32".into(), components: 1, unit: None };
    let mut fields = vec![scalar("xx"), scalar("yy"), scalar("zz")];
    if particles.weights().is_some() {
        fields.push(scalar("ww"));
    }
    let species = |l: &Layer<Range<usize>>| Species {
        name: l.name.clone(),
        aliases: Vec::new(),
        count: l.content.len() as u64,
        mass: match l.mass {
            Mass::Weights(_) => crate::Mass::Field("ww".into()),
            Mass::Each(m) => crate::Mass::Each(m),
            Mass::Unknown => crate::Mass::Unknown,
        },
        positions: "xx,yy,zz".into(),
        fields: fields.clone(),
    };
    let layers = particles.layers();
    let description = Description {
        format: "raw float32 columns, little-endian".into(),
        files: paths.to_vec(),
        meta: particles.meta.clone(),
        species: layers.iter().map(species).collect(),
        frames: None,
        notes,
    };
    Ok((description, layers.iter().map(|l| particles.of_layer(l).bounds()).collect()))
}
