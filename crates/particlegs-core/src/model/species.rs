//! Names of particle types: those of files, as `PartType0`, and those of people, as gas.

use super::{Quantity, QuantityKind};

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
