//! Which fields hold the positions: one of three components, or three scalar ones.

use crate::{Choice, Field, Species};
use particlegs::Result;

/// A component of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// The field's name.
    pub field: String,
    /// Which of its numbers, from 0.
    pub component: u32,
}

/// Where x, y and z of a species are found: the fields chosen, else its own.
///
/// # Errors
/// [`particlegs::Error::Input`] naming the fields there are, where a chosen one is missing.
pub fn axes(place: &str, species: &Species, choice: &Choice) -> Result<[Axis; 3]> {
    let chosen = choice.positions.as_deref().unwrap_or(&species.positions);
    let has = |name: &str, components| species.fields.iter().any(|f| f.name == name && f.components == components);
    if has(chosen, 3) {
        return Ok([0, 1, 2].map(|component| Axis { field: chosen.to_string(), component }));
    }
    let names: Vec<&str> = chosen.split(',').map(str::trim).collect();
    match names[..] {
        [x, y, z] if [x, y, z].iter().all(|n| has(n, 1)) => {
            Ok([x, y, z].map(|n| Axis { field: n.to_string(), component: 0 }))
        }
        _ => {
            let fits = |f: &&Field| f.components == 3 || f.components == 1;
            Err(species.missing(place, chosen, species.fields.iter().filter(fits).map(|f| &f.name[..])))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_and_three_scalars_are_found_and_others_named() {
        let field = |name: &str, components| Field { name: name.into(), kind: "f32".into(), components, unit: None };
        let species = Species {
            positions: "x,y,z".into(),
            fields: vec![field("x", 1), field("y", 1), field("z", 1), field("v", 3)],
            ..Species::default()
        };
        assert_eq!(axes("f", &species, &Choice::default()).unwrap()[2], Axis { field: "z".into(), component: 0 });
        let by = |name: &str| axes("f", &species, &Choice { positions: Some(name.into()), ..Choice::default() });
        assert_eq!(by("v").unwrap()[1], Axis { field: "v".into(), component: 1 });
        assert!(by("w").unwrap_err().remedy().to_string().contains("x, y, z, v"));
        assert!(by("x,y").is_err());
    }
}
