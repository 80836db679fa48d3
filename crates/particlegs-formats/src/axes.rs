//! Fields that hold the positions: one of three components, or three scalar ones.

use crate::{Choice, Species, SpeciesField};
use particlegs_core::Result;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldComponent {
    pub field: String,
    /// Index of the component in the field, from 0.
    pub component: u32,
}

/// The components that hold x, y and z of a species: of the fields chosen, else of its own.
pub fn axes(place: &str, species: &Species, choice: &Choice) -> Result<[FieldComponent; 3]> {
    let chosen = choice.positions.as_deref().unwrap_or(&species.positions);
    if species.fields.iter().any(|f| f.name == chosen && f.components == 3) {
        return Ok([0, 1, 2].map(|component| FieldComponent { field: chosen.to_string(), component }));
    }
    let names: Vec<&str> = chosen.split(',').map(str::trim).collect();
    let components: Vec<FieldComponent> = names.iter().filter_map(|n| axis(species, n)).collect();
    match <[FieldComponent; 3]>::try_from(components) {
        Ok(three) if names.len() == 3 => Ok(three),
        _ => {
            let fits = |f: &&SpeciesField| f.components == 3 || f.components == 1;
            Err(species.missing(place, chosen, species.fields.iter().filter(fits).map(|f| &f.name[..])))
        }
    }
}

/// The components that hold x, y, z and, where they are chosen, weights: three or four.
pub fn columns(place: &str, species: &Species, choice: &Choice) -> Result<Vec<FieldComponent>> {
    let axes = axes(place, species, choice)?;
    let weight = species.weight_field(place, &choice.weights)?;
    Ok(axes.into_iter().chain(weight.map(|field| FieldComponent { field, component: 0 })).collect())
}

/// A scalar field, or component k of the field `name` as `name[k]`.
pub fn axis(species: &Species, text: &str) -> Option<FieldComponent> {
    let find = |name: &str| species.fields.iter().find(|f| f.name == name);
    if let Some(field) = find(text).filter(|f| f.components == 1) {
        return Some(FieldComponent { field: field.name.clone(), component: 0 });
    }
    let (name, component) = text.strip_suffix(']')?.rsplit_once('[')?;
    let component = component.parse().ok()?;
    find(name).filter(|f| component < f.components).map(|f| FieldComponent { field: f.name.clone(), component })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_and_three_scalars_are_found_and_others_named() {
        let field = |name: &str, components| SpeciesField::new(name, "f32", components);
        let species = Species {
            positions: "x,y,z".into(),
            fields: vec![field("x", 1), field("y", 1), field("z", 1), field("v", 3)],
            ..Species::default()
        };
        assert_eq!(
            axes("f", &species, &Choice::default()).unwrap()[2],
            FieldComponent { field: "z".into(), component: 0 }
        );
        let by = |name: &str| axes("f", &species, &Choice { positions: Some(name.into()), ..Choice::default() });
        assert_eq!(by("v").unwrap()[1], FieldComponent { field: "v".into(), component: 1 });
        assert!(by("w").unwrap_err().hint().to_string().contains("x, y, z, v"));
        assert!(by("x,y").is_err());
        let part = |field: &str, component| FieldComponent { field: field.into(), component };
        assert_eq!(by("v[2],x,v[0]").unwrap(), [part("v", 2), part("x", 0), part("v", 0)]);
        assert!(by("v[3],x,y").is_err() && by("v[],x,y").is_err());
    }
}
