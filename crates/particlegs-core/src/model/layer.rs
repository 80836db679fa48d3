//! A species or mass class: its name, what its particles weigh, and whatever there is of it. Names of particle types are
//! those of files, as `PartType0`, and those of people, as gas.

use super::{Quantity, QuantityKind};

/// Masses of a layer's particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mass {
    /// Not known: particles are counted.
    #[default]
    Unknown,
    /// Each has this one, in the snapshot's unit of mass.
    Each(f64),
    /// Each has a weight of its own; a weight of 1 is this mass, where that is known.
    Weights(Option<f64>),
}

impl Mass {
    /// Of particles with weights of their own, or without; `unit` = the mass of weight 1, where known.
    pub fn new(weighted: bool, unit: Option<f64>) -> Self {
        match (weighted, unit) {
            (true, unit) => Mass::Weights(unit),
            (false, Some(each)) => Mass::Each(each),
            (false, None) => Mass::Unknown,
        }
    }

    /// Whether particles have weights of their own.
    pub fn is_weighted(self) -> bool {
        matches!(self, Mass::Weights(_))
    }

    /// Mass of a particle of weight 1, where it is known.
    pub fn unit(self) -> Option<f64> {
        match self {
            Mass::Unknown => None,
            Mass::Each(unit) => Some(unit),
            Mass::Weights(unit) => unit,
        }
    }

    /// [`Mass::unit`], or 1 where it is not known: particles are counted.
    pub fn unit_or_one(self) -> f64 {
        self.unit().unwrap_or(1.0)
    }

    /// The same unit without weights.
    pub fn without_weights(self) -> Self {
        Mass::new(false, self.unit())
    }

    /// Of particles that all have this weight.
    pub fn all_of_weight(self, weight: f32) -> Self {
        Mass::Each(self.unit_or_one() * f64::from(weight))
    }

    /// Columns of its particles: x, y, z and the weight, where they have one.
    pub fn columns(self) -> usize {
        if self.is_weighted() { 4 } else { 3 }
    }

    /// Bytes of a particle as float32 columns.
    pub fn particle_bytes(self) -> u64 {
        4 * self.columns() as u64
    }
}

/// A species or mass class: blocks of a model, particles of a snapshot, coded blocks of a file, ...
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Layer<T> {
    /// Name, e.g. `dm`; at most 255 bytes in a file, where names differ.
    pub name: String,
    /// Masses of its particles.
    pub mass: Mass,
    /// Its content.
    pub content: T,
}

impl<T> Layer<T> {
    /// The same layer, of something else.
    pub fn with<U>(&self, content: U) -> Layer<U> {
        Layer { name: self.name.clone(), mass: self.mass, content }
    }

    /// The same layer, of what `f` makes of its content.
    pub fn map<U>(self, f: impl FnOnce(T) -> U) -> Layer<U> {
        Layer { name: self.name, mass: self.mass, content: f(self.content) }
    }
}

/// By type, in the order of Gadget's format and those that follow it: what a legend calls it, nothing where that depends
/// on the simulation, and names that choose it.
const TYPES: [(&str, &[&str]); 7] = [
    ("gas", &["gas"]),
    ("dark matter", &["dm", "halo", "darkmatter"]),
    ("", &["dm2", "disk"]),
    ("", &["dm3", "bulge", "tracers"]),
    ("stars", &["stars", "star"]),
    ("black holes", &["bh", "blackholes", "bndry"]),
    ("neutrinos", &["neutrinos"]),
];

/// One of several species of particles that share the Gaussians of a layer, each with a share of them of its own.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SharedSpecies {
    /// Name; that of the layer is the names of all, joined by `+`.
    pub name: String,
    /// Its particles.
    pub count: u64,
    /// Mass of a particle in the snapshot's unit of mass, where it is known.
    pub mass: Option<f64>,
}

impl SharedSpecies {
    /// Species of a layer at most.
    pub const MOST: usize = 16;

    /// The layer of such species.
    pub fn layer_name(all: &[SharedSpecies]) -> String {
        all.iter().map(|s| &s.name[..]).collect::<Vec<_>>().join("+")
    }

    /// Whether they share the Gaussians of the layer of this name.
    pub fn share_layer(all: &[SharedSpecies], name: &str) -> bool {
        !all.is_empty() && name == SharedSpecies::layer_name(all)
    }

    /// Name of its shares among the fields of the layer's Gaussians.
    pub fn field_name(&self) -> String {
        format!("species={}", self.name)
    }

    /// Its shares as a field.
    pub fn quantity(&self) -> Quantity {
        Quantity::new(self.field_name(), QuantityKind::Category)
    }
}

/// Begins the names of types in files.
const GROUP: &str = "parttype";

/// Names that choose a type, its number first, in lower case.
pub fn species_aliases(kind: usize) -> Vec<String> {
    let names = TYPES.get(kind).map_or(&[][..], |t| t.1);
    std::iter::once(kind.to_string()).chain(names.iter().map(ToString::to_string)).collect()
}

/// A species or layer as people say it: `dark matter` of `PartType1`; other names are themselves.
pub fn species_title(name: &str) -> String {
    let (first, rest) = name.split_at(name.find(' ').unwrap_or(name.len()));
    match kind_of(first).map(|kind| TYPES[kind].0) {
        Some(title) if !title.is_empty() => format!("{title}{rest}"),
        _ => name.into(),
    }
}

/// Whether `query` means the species or layer `name`, in capitals or not, with blanks or without: by its name, by
/// another of its type's, by its type alone where the name goes on (`PartType1 m=2`), or by its number (of `type 1`).
pub fn is_species(name: &str, query: &str) -> bool {
    let plain = |text: &str| text.to_lowercase().replace(' ', "");
    let (first, last) = (name.split(' ').next().unwrap_or(name), name.rsplit(' ').next().unwrap_or(name));
    let kind = kind_of(first);
    let plain_query = plain(query);
    plain(name) == plain_query
        || kind.is_some() && kind == kind_of(&plain_query)
        || kind.is_none() && plain(last) == plain_query
}

/// The type of a plain name.
fn kind_of(name: &str) -> Option<usize> {
    let name = name.to_lowercase();
    let number = name.strip_prefix(GROUP).unwrap_or(&name);
    (0..TYPES.len()).find(|kind| number == kind.to_string() || TYPES[*kind].1.contains(&&name[..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn species_are_called_as_people_call_them() {
        let all =
            ["PartType0", "gas", "PartType1", "PartType1 m=0.5", "PartType2", "PartType4", "type 1", "O", "particles"];
        let titles =
            ["gas", "gas", "dark matter", "dark matter m=0.5", "PartType2", "stars", "type 1", "O", "particles"];
        assert_eq!(all.map(species_title), titles);
        let called = |query: &str| all.into_iter().filter(|name| is_species(name, query)).collect::<Vec<_>>();
        for query in ["gas", "Gas", "0", "PartType0", "parttype0"] {
            assert_eq!(called(query), ["PartType0", "gas"], "{query}");
        }
        for query in ["dm", "dark matter", "DarkMatter", "halo", "PartType1"] {
            assert_eq!(called(query), ["PartType1", "PartType1 m=0.5"], "{query}");
        }
        assert_eq!(called("1"), ["PartType1", "PartType1 m=0.5", "type 1"]);
        assert_eq!(
            (called("type1"), called("stars"), called("disk")),
            (vec!["type 1"], vec!["PartType4"], vec!["PartType2"])
        );
        assert_eq!((called("PartType1 m=0.5"), called("o")), (vec!["PartType1 m=0.5"], vec!["O"]));
        assert!(called("").is_empty() && called("PartType").is_empty() && called("7").is_empty());
        assert_eq!(species_aliases(1), ["1", "dm", "halo", "darkmatter"]);
        assert_eq!(species_aliases(7), ["7"]);
    }
}
