//! Arrays as fields of particles.

use super::header::{NpyElement, NpyHeader, NpyScalar};
use crate::SpeciesField;
use crate::columns::ColumnarField;
use particlegs_core::{Error, Result};

/// Columns that are listed one by one, where an array has more than three.
const MOST_COLUMNS: u64 = 64;
const MOST_COMPONENTS: u64 = 1 << 16;

/// Names of positions, most usual first.
const POSITIONS: [&str; 9] =
    ["pos", "position", "positions", "coordinates", "coords", "coord", "xyz", "points", "centers"];
/// Names of their components.
const AXES: [[&str; 3]; 6] = [
    ["x", "y", "z"],
    ["xx", "yy", "zz"],
    ["pos_x", "pos_y", "pos_z"],
    ["posx", "posy", "posz"],
    ["position_x", "position_y", "position_z"],
    ["fof_halo_center_x", "fof_halo_center_y", "fof_halo_center_z"],
];
const MASSES: [&str; 4] = ["mass", "masses", "weight", "weights"];

/// The field or three fields whose names say that they hold positions.
pub fn positions_named(fields: &[SpeciesField]) -> Option<String> {
    let find = |name: &str, components: u32| {
        fields.iter().find(|f| f.components == components && f.name.eq_ignore_ascii_case(name)).map(|f| &f.name[..])
    };
    let three = |names: [&str; 3]| Some(names.map(|n| find(n, 1)).into_iter().collect::<Option<Vec<_>>>()?.join(","));
    POSITIONS.iter().find_map(|n| find(n, 3).map(String::from)).or_else(|| AXES.into_iter().find_map(three))
}

/// The scalar field whose name says that it holds masses.
pub fn mass_named(fields: &[SpeciesField]) -> Option<String> {
    let find = |name: &&str| fields.iter().find(|f| f.components == 1 && f.name.eq_ignore_ascii_case(name));
    MASSES.iter().find_map(find).map(|f| f.name.clone())
}

pub fn check_numbers(place: &str, header: &NpyHeader) -> Result<()> {
    match &header.element {
        NpyElement::Plain(scalar) if scalar.kind.is_none() => {
            let message = format!("the numbers are {}, but positions must be floating-point numbers", scalar.name);
            Err(Error::input_with(place, message, "save x, y and z as float32 or float64"))
        }
        _ => Ok(()),
    }
}

/// An array's sides without those of 1 beyond the first two.
fn sides(header: &NpyHeader) -> Vec<u64> {
    let mut sides = header.shape.clone();
    while sides.len() > 2 {
        match sides.iter().position(|&s| s == 1) {
            Some(at) => drop(sides.remove(at)),
            None => break,
        }
    }
    sides
}

/// Particles of an array that holds positions by itself: N x 3, 3 x N, or records.
pub fn rows_of_positions(header: &NpyHeader) -> Option<u64> {
    match (&header.element, &sides(header)[..]) {
        (NpyElement::Record { .. }, [n] | [n, 1] | [1, n]) => Some(*n),
        (NpyElement::Plain(scalar), [n, 3] | [3, n]) if scalar.kind.is_some() => Some(*n),
        _ => None,
    }
}

/// Particles of a table of more than three columns, one a row or one a column.
pub fn rows_of_table(header: &NpyHeader) -> Option<u64> {
    match (&header.element, &sides(header)[..]) {
        (NpyElement::Plain(scalar), &[a, b]) if scalar.kind.is_some() => match (a, b) {
            // Where both sides are short, only at least as many rows as columns are clear.
            (n, 4..=MOST_COLUMNS) if n > MOST_COLUMNS || n >= b => Some(n),
            (4..=MOST_COLUMNS, n) if n > MOST_COLUMNS => Some(n),
            _ => None,
        },
        _ => None,
    }
}

/// An array's fields, where it has `rows` rows: one by its own name, or a record's.
pub fn fields(name: &str, stored: usize, header: &NpyHeader, rows: u64) -> Vec<ColumnarField> {
    match &header.element {
        NpyElement::Plain(scalar) => plain(name, stored, header, scalar, rows).into_iter().collect(),
        NpyElement::Record { fields, bytes } => {
            if !matches!(sides(header)[..], [n] | [n, 1] | [1, n] if n == rows) {
                return Vec::new();
            }
            let some = fields.iter().filter(|f| (1..=MOST_COMPONENTS).contains(&f.count));
            some.map(|f| ColumnarField {
                name: f.name.clone(),
                offset: f.offset,
                offset_step: f.scalar.bytes,
                ..field(stored, header.data, &f.scalar, f.count, *bytes)
            })
            .collect()
        }
    }
}

/// The columns of a table as fields `0`, `1`, ...
pub fn table(stored: usize, header: &NpyHeader, rows: u64) -> Vec<ColumnarField> {
    let NpyElement::Plain(scalar) = &header.element else { return Vec::new() };
    let Some(whole) = plain("", stored, header, scalar, rows) else { return Vec::new() };
    let columns = 0..u64::from(whole.components);
    columns
        .map(|c| ColumnarField {
            name: c.to_string(),
            components: 1,
            base: whole.base + c * whole.base_step,
            offset: whole.offset + c * whole.offset_step,
            ..whole.clone()
        })
        .collect()
}

fn field(stored: usize, base: u64, scalar: &NpyScalar, components: u64, stride: u64) -> ColumnarField {
    let (kind_name, kind, big_endian) = (scalar.name.clone(), scalar.kind, scalar.big_endian);
    let components = components as u32;
    ColumnarField { kind_name, kind, big_endian, components, stored, base, stride, ..ColumnarField::default() }
}

fn plain(name: &str, stored: usize, header: &NpyHeader, scalar: &NpyScalar, rows: u64) -> Option<ColumnarField> {
    // A field's components lie side by side, or one after the other.
    let (components, beside) = match sides(header)[..] {
        [n] if n == rows => (1, true),
        [n, k] if n == rows => (k, !header.fortran),
        [k, n] if n == rows => (k, header.fortran),
        _ => return None,
    };
    if !(1..=MOST_COMPONENTS).contains(&components) {
        return None;
    }
    let field = ColumnarField { name: name.into(), ..field(stored, header.data, scalar, components, scalar.bytes) };
    Some(if beside {
        ColumnarField { stride: components.checked_mul(scalar.bytes)?, offset_step: scalar.bytes, ..field }
    } else {
        ColumnarField { base_step: rows.checked_mul(scalar.bytes)?, ..field }
    })
}
