//! The metadata section: tag, length, value (docs/format.md, section 2).
//!
//! Version 1.0 knows one rule of masses for all layers; a file whose layers differ states version
//! 1.1 and a field that older programs refuse. The alpha-blend law came with version 1.3.

use super::container::ALPHA_BLEND_SINCE;
use super::wire::Reader;
use crate::math::each_axis;
use crate::model::{LawKind, Mass, Metadata, Recipe};
use crate::space::{Bounds, Cell};

/// Why metadata cannot be read.
pub(crate) enum Fault {
    /// It contradicts the format.
    Corrupt(String),
    /// It asks for something newer.
    Unknown(String),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Fault::Corrupt(what)
    }
}

/// Longest text but the recipe.
const TEXT: usize = 1024;
/// Longest recipe.
const RECIPE_TEXT: usize = 16_384;
/// Tags from here on must be understood.
const REQUIRED: u8 = 128;

const LAW: u8 = 1;
const COUNT: u8 = 2;
const MASS: u8 = 3;
const WEIGHTED: u8 = 4;
const BOUNDS: u8 = 5;
const CELL: u8 = 6;
const RADIUS: u8 = 7;
const OPACITY: u8 = 8;
const SOURCE: u8 = 9;
const HASH: u8 = 10;
const LENGTH_UNIT: u8 = 11;
const MASS_UNIT: u8 = 12;
const PARTICLE_MASS: u8 = 13;
const COMOVING: u8 = 14;
const SCALE_FACTOR: u8 = 15;
const HUBBLE: u8 = 16;
const TIME: u8 = 17;
const RECIPE: u8 = 18;
const TOOL: u8 = 19;
const CORNER: u8 = 20;
const LAYER_MASSES: u8 = 128;
/// Fields of version 1.0.
const FIRST_VERSION: std::ops::RangeInclusive<u8> = LAW..=TOOL;

/// The masses of the layers, in their order.
pub(crate) enum LayerMasses {
    /// All layers alike.
    Alike(Mass),
    /// Each its own.
    Each(Vec<Mass>),
}

impl LayerMasses {
    fn of(layers: &[Mass]) -> Self {
        match layers {
            [first, rest @ ..] if rest.iter().all(|l| l == first) => LayerMasses::Alike(*first),
            _ => LayerMasses::Each(layers.to_vec()),
        }
    }

    /// The masses of `count` layers; `None` where the section tells another number.
    pub fn expand(&self, count: usize) -> Option<Vec<Mass>> {
        match self {
            LayerMasses::Alike(mass) => Some(vec![*mass; count]),
            LayerMasses::Each(masses) => Some(masses.clone()).filter(|m| m.len() == count),
        }
    }
}

/// The lowest minor version that has what the section says.
pub(crate) fn minor_version(section: &[u8], law: LawKind) -> u8 {
    let tags: Vec<u8> = fields(section).map_or_else(|_| Vec::new(), |fields| fields.iter().map(|f| f.0).collect());
    let newer = |tag: &u8| u8::from(!FIRST_VERSION.contains(tag));
    let since = tags.iter().map(newer).max().unwrap_or(0);
    since.max(if law == LawKind::AlphaBlend { ALPHA_BLEND_SINCE } else { 0 })
}

/// The section's bytes: fields in the order of their tags. `layers` in the order of the file.
pub(crate) fn write(m: &Metadata, layers: &[Mass]) -> Vec<u8> {
    let masses = LayerMasses::of(layers);
    let mut out = Vec::with_capacity(512);
    let mut field = |tag: u8, value: &[u8]| {
        out.push(tag);
        out.extend((value.len() as u16).to_le_bytes());
        out.extend(value);
    };
    field(
        LAW,
        &[match m.law {
            LawKind::OpticalDepth => 1,
            LawKind::AlphaBlend => 2,
        }],
    );
    field(COUNT, &m.count.to_le_bytes());
    field(MASS, &m.mass.to_le_bytes());
    field(WEIGHTED, &[u8::from(layers.iter().any(|m| m.is_weighted()))]);
    field(BOUNDS, &floats(m.bounds.min.iter().chain(&m.bounds.max)));
    if let Some(cell) = &m.cell {
        field(CELL, &cell_bytes(cell));
    }
    field(RADIUS, &m.default_radius.to_le_bytes());
    field(OPACITY, &m.default_opacity.to_le_bytes());
    field(SOURCE, text(&m.source, TEXT));
    field(HASH, &m.source_hash);
    for (tag, v) in [(LENGTH_UNIT, &m.length_unit), (MASS_UNIT, &m.mass_unit)] {
        v.iter().for_each(|v| field(tag, text(v, TEXT)));
    }
    if let LayerMasses::Alike(mass) = masses {
        mass.unit().iter().for_each(|unit| field(PARTICLE_MASS, &unit.to_le_bytes()));
    }
    m.comoving.iter().for_each(|&v| field(COMOVING, &[u8::from(v)]));
    for (tag, v) in [(SCALE_FACTOR, m.scale_factor), (HUBBLE, m.hubble), (TIME, m.time)] {
        v.iter().for_each(|v| field(tag, &v.to_le_bytes()));
    }
    field(RECIPE, &recipe_text(&m.recipe));
    field(TOOL, text(&m.tool_version, TEXT));
    if let Some(cell) = m.cell.filter(|c| c.origin != [0.0; 3]) {
        field(CORNER, &floats(cell.origin.iter()));
    }
    if let LayerMasses::Each(masses) = masses {
        let layer = |m: &Mass| {
            let flags = u8::from(m.is_weighted()) | u8::from(m.unit().is_some()) << 1;
            std::iter::once(flags).chain(m.unit().unwrap_or(0.0).to_le_bytes()).collect::<Vec<u8>>()
        };
        field(LAYER_MASSES, &masses.iter().flat_map(layer).collect::<Vec<u8>>());
    }
    out
}

/// Reads the section.
pub(crate) fn read(bytes: &[u8]) -> Result<(Metadata, LayerMasses), Fault> {
    let fields = fields(bytes)?;
    let get = |tag: u8| fields.iter().find(|f| f.0 == tag).map(|f| f.1);
    let need = |tag: u8| get(tag).ok_or_else(|| format!("metadata field {tag} is missing"));
    let real = |tag: u8| get(tag).map(|v| float(tag, v)).transpose();
    let law = match need(LAW)? {
        [1] => LawKind::OpticalDepth,
        [2] => LawKind::AlphaBlend,
        [law] => return Err(Fault::Unknown(format!("image law {law} is not known"))),
        v => return Err(Fault::Corrupt(format!("an image law of {} bytes", v.len()))),
    };
    let m = Metadata {
        law,
        count: u64::from_le_bytes(exact(COUNT, need(COUNT)?)?),
        mass: float(MASS, need(MASS)?)?,
        bounds: bounds(need(BOUNDS)?)?,
        cell: get(CELL).map(|v| cell(v, get(CORNER))).transpose()?,
        default_radius: float(RADIUS, need(RADIUS)?)?,
        default_opacity: float(OPACITY, need(OPACITY)?)?,
        source: string(SOURCE, need(SOURCE)?, TEXT)?,
        source_hash: exact(HASH, need(HASH)?)?,
        length_unit: get(LENGTH_UNIT).map(|v| string(LENGTH_UNIT, v, TEXT)).transpose()?,
        mass_unit: get(MASS_UNIT).map(|v| string(MASS_UNIT, v, TEXT)).transpose()?,
        comoving: get(COMOVING).map(|v| flag(COMOVING, v)).transpose()?,
        scale_factor: real(SCALE_FACTOR)?,
        hubble: real(HUBBLE)?,
        time: real(TIME)?,
        // What a newer program may tell in other words is not known here.
        recipe: serde_json::from_slice(need(RECIPE)?).unwrap_or_else(|_| Recipe::unknown()),
        tool_version: string(TOOL, need(TOOL)?, TEXT)?,
    };
    if m.count == 0 || !(m.mass > 0.0 && m.default_radius > 0.0 && m.default_opacity > 0.0 && m.default_opacity <= 1.0)
    {
        return Err(Fault::Corrupt("count, mass, radius or opacity out of range".into()));
    }
    let masses = match get(LAYER_MASSES) {
        None => LayerMasses::Alike(Mass::new(flag(WEIGHTED, need(WEIGHTED)?)?, real(PARTICLE_MASS)?)),
        Some(v) => LayerMasses::Each(layer_masses(v)?),
    };
    Ok((m, masses))
}

/// Nine bytes a layer: flags and a mass.
fn layer_masses(v: &[u8]) -> Result<Vec<Mass>, String> {
    let layer = |v: &[u8]| {
        let mass = float(LAYER_MASSES, &v[1..])?;
        if v[0] > 3 || (v[0] & 2 == 0) != (mass == 0.0) || mass < 0.0 {
            return Err(format!("a layer's mass {mass} with flags {:#04x}", v[0]));
        }
        Ok(Mass::new(v[0] & 1 == 1, (v[0] & 2 == 2).then_some(mass)))
    };
    if v.is_empty() || !v.len().is_multiple_of(9) {
        return Err(format!("layers' masses of {} bytes", v.len()));
    }
    v.chunks_exact(9).map(layer).collect()
}

/// Splits the section; tags rise.
fn fields(bytes: &[u8]) -> Result<Vec<(u8, &[u8])>, Fault> {
    let mut r = Reader::new(bytes);
    let mut out: Vec<(u8, &[u8])> = Vec::with_capacity(32);
    while !r.is_done() {
        let (tag, length) = (r.u8()?, r.u16()?);
        let value = r.take(usize::from(length))?;
        if out.last().is_some_and(|f| f.0 >= tag) {
            return Err(Fault::Corrupt(format!("metadata field {tag} is out of order")));
        }
        if tag >= REQUIRED && tag != LAYER_MASSES {
            return Err(Fault::Unknown(format!("metadata field {tag} is not known and may not be skipped")));
        }
        out.push((tag, value));
    }
    Ok(out)
}

fn floats<'a>(values: impl Iterator<Item = &'a f64>) -> Vec<u8> {
    values.flat_map(|v| v.to_le_bytes()).collect()
}

/// Periodicity, then three lengths where the cell is orthogonal, else three vectors.
fn cell_bytes(c: &Cell) -> Vec<u8> {
    let mut out = vec![(0..3).map(|k| u8::from(c.periodic[k]) << k).sum()];
    match c.lengths() {
        Some(l) => out.extend(floats(l.iter())),
        None => out.extend(floats(c.vectors.iter().flatten())),
    }
    out
}

fn cell(v: &[u8], corner: Option<&[u8]>) -> Result<Cell, Fault> {
    let origin = match corner.map(|v| reals(CORNER, v)).transpose()?.as_deref() {
        None => [0.0; 3],
        Some(&[x, y, z]) => [x, y, z],
        Some(_) => return Err(Fault::Corrupt("the cell's corner is not three numbers".into())),
    };
    let (head, rest) = v.split_first().ok_or_else(|| "an empty cell".to_string())?;
    if *head > 7 {
        return Err(Fault::Corrupt(format!("cell periodicity {head:#04x} is reserved")));
    }
    let periodic = each_axis(|k| head >> k & 1 == 1);
    let values = reals(CELL, rest)?;
    let vectors = match values[..] {
        [x, y, z] => [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]],
        [a, b, c, d, e, f, g, h, i] => [[a, b, c], [d, e, f], [g, h, i]],
        _ => return Err(Fault::Corrupt(format!("a cell of {} bytes", v.len()))),
    };
    Ok(Cell { origin, vectors, periodic })
}

fn bounds(v: &[u8]) -> Result<Bounds, String> {
    match reals(BOUNDS, v)?[..] {
        [a, b, c, d, e, f] if a <= d && b <= e && c <= f => Ok(Bounds { min: [a, b, c], max: [d, e, f] }),
        _ => Err("bounds are not six ordered numbers".into()),
    }
}

/// Finite numbers.
fn reals(tag: u8, v: &[u8]) -> Result<Vec<f64>, String> {
    if !v.len().is_multiple_of(8) || v.len() > 72 {
        return Err(format!("metadata field {tag} of {} bytes", v.len()));
    }
    v.chunks_exact(8).map(|c| float(tag, c)).collect()
}

fn float(tag: u8, v: &[u8]) -> Result<f64, String> {
    let value = f64::from_le_bytes(exact(tag, v)?);
    if value.is_finite() { Ok(value) } else { Err(format!("metadata field {tag} is not finite")) }
}

fn flag(tag: u8, v: &[u8]) -> Result<bool, String> {
    match v {
        [0] => Ok(false),
        [1] => Ok(true),
        _ => Err(format!("metadata field {tag} is neither 0 nor 1")),
    }
}

fn exact<const N: usize>(tag: u8, v: &[u8]) -> Result<[u8; N], String> {
    v.try_into().map_err(|_| format!("metadata field {tag} of {} bytes, not {N}", v.len()))
}

fn string(tag: u8, v: &[u8], longest: usize) -> Result<String, String> {
    if v.len() > longest {
        return Err(format!("metadata field {tag} of {} bytes, at most {longest}", v.len()));
    }
    std::str::from_utf8(v).map(str::to_string).map_err(|_| format!("metadata field {tag} is not UTF-8"))
}

/// A recipe as JSON; one that does not fit says nothing.
fn recipe_text(recipe: &Recipe) -> Vec<u8> {
    let json = |recipe: &Recipe| serde_json::to_vec(recipe).expect("plain data");
    Some(json(recipe)).filter(|text| text.len() <= RECIPE_TEXT).unwrap_or_else(|| json(&Recipe::unknown()))
}

/// The longest beginning of a text that fits.
fn text(s: &str, longest: usize) -> &[u8] {
    let mut end = s.len().min(longest);
    while !s.is_char_boundary(end) {
        end -= 1;
    }
    &s.as_bytes()[..end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Target;

    fn metadata(recipe: Recipe) -> Metadata {
        Metadata {
            law: LawKind::OpticalDepth,
            count: 8,
            mass: 8.0,
            bounds: Bounds { min: [0.0; 3], max: [1.0; 3] },
            cell: None,
            default_radius: 0.1,
            default_opacity: 0.05,
            source: "box".into(),
            source_hash: [7; 32],
            length_unit: None,
            mass_unit: None,
            comoving: None,
            scale_factor: None,
            hubble: None,
            time: None,
            recipe,
            tool_version: String::new(),
        }
    }

    #[test]
    fn recipes_come_back_and_what_is_none_says_nothing() {
        let back = |section: &[u8]| read(section).ok().unwrap().0.recipe;
        let some = Recipe { target: Target::Ratio(0.1), seed: u64::MAX, ..Recipe::default() };
        let long = Recipe { read: [("species".into(), "x".repeat(RECIPE_TEXT))].into(), ..some.clone() };
        for (recipe, expected) in [(some.clone(), some.clone()), (long, Recipe::unknown())] {
            assert_eq!(back(&write(&metadata(recipe), &[Mass::Unknown])), expected);
        }
        let mut section = write(&metadata(some), &[Mass::Unknown]);
        let at = section.windows(7).position(|w| w == b"default").unwrap();
        section[at] = b'D';
        assert_eq!(back(&section), Recipe::unknown());
    }
}
