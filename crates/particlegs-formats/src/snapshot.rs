//! A snapshot's files, opened: what they say before any particle is read.

use crate::choice::{Choice, Weights};
use crate::physical::VelocityConvention;
use particlegs_core::model::{Epoch, WeightKind};
use particlegs_core::{Error, Hint, Result};
use particlegs_particles::{Particles, SnapshotMeta, SnapshotReader};
use std::path::PathBuf;

/// Files of one snapshot.
pub trait Snapshot: Send + Sync {
    /// The files' description of themselves.
    fn description(&self) -> &Description;

    /// A reader of species `species` (an index into the description's) with the fields chosen.
    /// Its metadata is the description's, with the species' particle mass.
    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>>;

    /// Numbers that the files say about a field, by name: powers of a and h, a factor to CGS.
    fn attributes(&self, _species: usize, _field: &str) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// The convention of velocities and energies whose fields do not say more.
    fn convention(&self) -> VelocityConvention {
        VelocityConvention::default()
    }

    /// Some species, at least one, where they lie in the files as they would in memory, one after the
    /// other: mapped, not copied. `None` where they do not; their readers serve always.
    fn in_place(&self, _species: &[usize], _choice: &Choice) -> Result<Option<Particles>> {
        Ok(None)
    }
}

/// The files' description of themselves. `None` = they do not say; nothing is guessed.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Description {
    /// The format in words, e.g. `Gadget-2 binary, format 2, big-endian`.
    pub format: String,
    /// The files read, in order.
    #[serde(serialize_with = "paths_as_text")]
    pub files: Vec<PathBuf>,
    /// Cell, units, cosmology.
    pub meta: SnapshotMeta,
    /// Kinds of particles; those without particles are left out.
    pub species: Vec<Species>,
    /// Frames, where the format can hold several.
    pub frames: Option<TrajectoryFrames>,
    /// Fields that other frames have.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub absent: Vec<AbsentField>,
    /// Notes for the user: features not read, values that contradict each other.
    pub notes: Vec<String>,
}

impl Description {
    /// The note about splats.
    pub(crate) const SPLATS: &str = "Gaussian splats: only their centres are read, as points";

    /// Of files that say nothing else yet.
    pub(crate) fn new(format: impl Into<String>, files: &[PathBuf], meta: SnapshotMeta) -> Description {
        Description { format: format.into(), files: files.to_vec(), meta, ..Description::default() }
    }

    /// Of a reader of a species.
    pub(crate) fn meta_of(&self, species: &Species) -> SnapshotMeta {
        let mut meta = self.meta.clone();
        if let SpeciesMass::Each(mass) = species.mass {
            meta.particle_mass = Some(mass);
        }
        meta
    }
}

/// Bytes of a path that are no UTF-8 are replaced.
fn paths_as_text<S: serde::Serializer>(paths: &[PathBuf], to: S) -> std::result::Result<S::Ok, S::Error> {
    to.collect_seq(paths.iter().map(|p| p.to_string_lossy()))
}

/// A field that the frame lacks and other frames have.
#[derive(Clone, Debug, serde::Serialize)]
pub struct AbsentField {
    /// Name as the file has it.
    pub name: String,
    /// The frame, the field, and which frames have it: a sentence for people.
    pub why: String,
}

impl AbsentField {
    /// The field `name`, which frame `chosen` lacks; `has` tells of each frame whether it has it.
    pub(crate) fn new(name: &str, chosen: u64, has: &[bool]) -> AbsentField {
        let with: Vec<usize> = (0..has.len()).filter(|&i| has[i]).collect();
        // 0 stands for unequal distances.
        let even = with.windows(2).map(|w| w[1] - w[0]).reduce(|a, b| if a == b { a } else { 0 });
        let stored = match (&with[..], even) {
            ([], _) => "at other steps than positions".into(),
            ([first, .., last], Some(step)) if step > 1 && *first < step && last + step >= has.len() => {
                let ending = match (step % 100, step % 10) {
                    (11..=13, _) => "th",
                    (_, 1) => "st",
                    (_, 2) => "nd",
                    (_, 3) => "rd",
                    _ => "th",
                };
                let from = if *first == 0 { String::new() } else { format!(", from frame {first} on") };
                format!("for every {step}{ending} frame{from}")
            }
            ([only], _) => format!("for frame {only} alone"),
            _ => format!("for {} of {} frames", with.len(), has.len()),
        };
        AbsentField { name: name.into(), why: format!("frame {chosen} has no {name}: the file stores it {stored}") }
    }
}

/// Frames of a trajectory.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct TrajectoryFrames {
    /// Number of frames in the file.
    pub count: u64,
    /// The one described and read, from 0.
    pub chosen: u64,
    /// Its step, as the file numbers it.
    pub step: Option<i64>,
}

impl TrajectoryFrames {
    /// The moment of the frame chosen: its number where there are several to choose from, and its step.
    pub(crate) fn epoch(&self) -> Epoch {
        Epoch { frame: (self.count > 1).then_some(self.chosen), step: self.step, ..Epoch::default() }
    }
}

/// One kind of particles.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Species {
    /// Name as the file has it, e.g. `PartType1`.
    pub name: String,
    /// Other names that choose it, lower case, e.g. `1`, `dm`.
    pub aliases: Vec<String>,
    /// Number of particles.
    pub count: u64,
    /// Their masses.
    pub mass: SpeciesMass,
    /// Name of the field that holds positions unless another is chosen.
    pub positions: String,
    /// All fields.
    pub fields: Vec<SpeciesField>,
}

/// Masses of a species.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SpeciesMass {
    /// The file does not say.
    #[default]
    Unknown,
    /// Every particle has this one, in the file's unit of mass.
    Each(f64),
    /// Each has its own, in this field.
    Field(String),
}

/// A column of a species.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SpeciesField {
    /// Name as the file has it.
    pub name: String,
    /// Type of its numbers, e.g. `f32`, `i64`, `text`.
    pub kind: String,
    /// Numbers a particle.
    pub components: u32,
    /// Unit as text, where the file says.
    pub unit: Option<String>,
}

impl SpeciesField {
    /// One whose unit the file does not say.
    pub(crate) fn new(name: impl Into<String>, kind: impl Into<String>, components: u32) -> SpeciesField {
        SpeciesField { name: name.into(), kind: kind.into(), components, unit: None }
    }
}

impl Species {
    /// The field that weights are read from, where there is one.
    pub(crate) fn weight_field(&self, place: &str, weights: &Weights) -> Result<Option<String>> {
        match weights {
            Weights::None => Ok(None),
            Weights::Auto => Ok(match &self.mass {
                SpeciesMass::Field(name) => Some(name.clone()),
                _ => None,
            }),
            Weights::Field(name) => match self.fields.iter().find(|f| f.name == *name && f.components == 1) {
                Some(field) => match self.weight_kind(field) {
                    WeightKind::Intensive(values) => {
                        let message = format!("`{name}` cannot be weights: a sum of {values} is meaningless");
                        let hint = Hint::from("omit ").option("mass-field", "").words(" to weigh by mass, or give ");
                        let hint = hint.option("mass-field", "none").words(" to count particles");
                        Err(Error::input_with(place, message, hint))
                    }
                    _ => Ok(Some(field.name.clone())),
                },
                None => {
                    let scalar = self.fields.iter().filter(|f| f.components == 1).map(|f| &f.name[..]);
                    Err(self.missing(place, name, scalar))
                }
            },
        }
    }

    /// The kind of weights that a field holds; the field of masses holds masses by any name.
    fn weight_kind(&self, field: &SpeciesField) -> WeightKind {
        match &self.mass {
            SpeciesMass::Field(masses) if *masses == field.name => WeightKind::Mass,
            _ => WeightKind::from_name(&field.name, field.unit.as_deref()),
        }
    }

    /// The field of weights that `weights` choose, where it is not that of the species' masses, and what it is.
    pub(crate) fn other_weights(&self, weights: &Weights) -> Option<(&SpeciesField, WeightKind)> {
        let Weights::Field(name) = weights else { return None };
        let field = self.fields.iter().find(|f| f.name == *name)?;
        (self.mass != SpeciesMass::Field(name.clone())).then(|| (field, self.weight_kind(field)))
    }

    /// The error for a field that `name` asks for and the species has not.
    pub(crate) fn missing<'a>(&self, place: &str, name: &str, fields: impl Iterator<Item = &'a str>) -> Error {
        let field_names: Vec<&str> = fields.collect();
        let hint = if field_names.is_empty() {
            "there are no fields".into()
        } else {
            format!("the fields are: {}", field_names.join(", "))
        };
        Error::input_with(place, format!("{} has no field `{name}`", self.name), hint)
    }
}

#[cfg(test)]
mod tests {
    use super::AbsentField;

    #[test]
    fn a_field_that_a_frame_lacks_says_which_have_it() {
        let why = |has: &[u8]| AbsentField::new("velocity", 1, &has.iter().map(|h| *h == 1).collect::<Vec<_>>()).why;
        let stored = |text: &str| format!("frame 1 has no velocity: the file stores it {text}");
        assert_eq!(why(&[1, 0, 1, 0, 1]), stored("for every 2nd frame"));
        assert_eq!(why(&[0, 0, 1, 0, 0, 1, 0]), stored("for every 3rd frame, from frame 2 on"));
        assert_eq!(why(&[1, 0, 0, 0]), stored("for frame 0 alone"));
        assert_eq!(why(&[1, 0, 1, 1, 0]), stored("for 3 of 5 frames"));
        assert_eq!(why(&[]), stored("at other steps than positions"));
    }
}
