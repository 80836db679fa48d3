//! The metadata section: tag, length, value (docs/format.md, section 2).

use super::wire::{SectionFault, WireReader};
use crate::math::each_axis;
use crate::model::{
    Cosmology, Epoch, LawKind, Mass, Metadata, Quantity, QuantityKind, Recipe, SharedSpecies, Si, Unit, Units,
};
use crate::space::{Bounds, Cell};

/// Longest text but the recipe.
const TEXT: usize = 1024;
const RECIPE_TEXT: usize = 16_384;
/// Longest name, and text of a unit, among what was kept.
const SHORT: usize = 255;
/// Tags from here on must be understood.
const REQUIRED: u8 = 128;

const LAW: u8 = 1;
const COUNT: u8 = 2;
const MASS: u8 = 3;
const BOUNDS: u8 = 4;
const CELL: u8 = 5;
const CORNER: u8 = 6;
const RADIUS: u8 = 7;
const OPACITY: u8 = 8;
const SOURCE: u8 = 9;
const HASH: u8 = 10;
const QUANTITIES: u8 = 11;
const FIELDS_HASH: u8 = 12;
const LENGTH_UNIT: u8 = 16;
const MASS_UNIT: u8 = 17;
const TIME_UNIT: u8 = 18;
const COMOVING: u8 = 19;
const COSMOLOGY: u8 = 24;
const SCALE_FACTOR: u8 = 25;
const TIME: u8 = 26;
const FRAME: u8 = 27;
const STEP: u8 = 28;
/// Traits of fields: weighted by mass, logarithmic, sums.
const TRAITS: u8 = 32;
const SPECIES: u8 = 33;
const RECIPE: u8 = 40;
const TOOL: u8 = 41;
const MASSES: u8 = 128;

/// The masses of `count` layers, of which a file has one entry or one each, or of the first `count` where some may be
/// missing; `None` where it has another number.
pub(crate) fn of_layers(masses: &[Mass], count: usize, missing: bool) -> Option<Vec<Mass>> {
    match *masses {
        [one] => Some(vec![one; count]),
        _ if missing => masses.get(..count).map(<[_]>::to_vec),
        _ => Some(masses.to_vec()).filter(|m| m.len() == count),
    }
}

/// The section's bytes: fields in the order of their tags. `layers` in the order of the file.
pub(crate) fn write(m: &Metadata, layers: &[Mass]) -> Vec<u8> {
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
    field(BOUNDS, &floats(m.bounds.min.iter().chain(&m.bounds.max)));
    if let Some(cell) = &m.cell {
        field(CELL, &cell_bytes(cell));
    }
    if let Some(cell) = m.cell.filter(|c| c.origin != [0.0; 3]) {
        field(CORNER, &floats(cell.origin.iter()));
    }
    field(RADIUS, &m.default_radius.to_le_bytes());
    field(OPACITY, &m.default_opacity.to_le_bytes());
    // Paths are not stored: they reveal details of the writer's machine.
    field(SOURCE, text(m.source.rsplit(['/', '\\']).next().unwrap_or_default(), TEXT));
    field(HASH, &m.source_hash);
    field(QUANTITIES, &quantities_bytes(m, layers));
    m.fields_hash.iter().for_each(|hash| field(FIELDS_HASH, hash));
    let Units { length, mass, time, comoving } = &m.units;
    for (tag, unit) in [(LENGTH_UNIT, length), (MASS_UNIT, mass), (TIME_UNIT, time)] {
        unit.iter().for_each(|u| field(tag, &unit_bytes(u, TEXT)));
    }
    comoving.iter().for_each(|&v| field(COMOVING, &[u8::from(v)]));
    let numbers = cosmology_of(&m.cosmology);
    if numbers.iter().any(|v| v.is_some()) {
        let known = (0..numbers.len()).map(|k| u8::from(numbers[k].is_some()) << k).sum();
        field(COSMOLOGY, &[&[known], &floats(numbers.iter().flatten())[..]].concat());
    }
    for (tag, v) in [(SCALE_FACTOR, m.epoch.scale_factor), (TIME, m.epoch.time)] {
        v.iter().for_each(|v| field(tag, &v.to_le_bytes()));
    }
    m.epoch.frame.iter().for_each(|v| field(FRAME, &v.to_le_bytes()));
    m.epoch.step.iter().for_each(|v| field(STEP, &v.to_le_bytes()));
    let traits: Vec<u8> = m
        .fields
        .iter()
        .map(|q| u8::from(q.by_mass) | u8::from(q.logarithmic) << 1 | u8::from(q.extensive) << 2)
        .collect();
    // Fields of defaults are left out: a reader takes 0 for all where there are no traits (docs/format.md, section 2).
    if traits.iter().any(|t| *t > 0) {
        field(TRAITS, &traits);
    }
    if !m.shared_species.is_empty() {
        field(SPECIES, &species_bytes(&m.shared_species));
    }
    field(RECIPE, &recipe_text(&m.recipe));
    field(TOOL, text(&m.tool_version, TEXT));
    // One entry stands for all layers where these agree (field 128).
    let alike = layers.windows(2).all(|w| w[0] == w[1]);
    let masses = if alike { &layers[..layers.len().min(1)] } else { layers };
    field(MASSES, &masses.iter().flat_map(mass_bytes).collect::<Vec<u8>>());
    out
}

/// Reads the section, with the masses that [`of_layers`] takes.
pub(crate) fn read(bytes: &[u8]) -> Result<(Metadata, Vec<Mass>), SectionFault> {
    let fields = fields(bytes)?;
    let get = |tag: u8| fields.iter().find(|f| f.0 == tag).map(|f| f.1);
    let need = |tag: u8| get(tag).ok_or_else(|| format!("metadata field {tag} is missing"));
    let real = |tag: u8| get(tag).map(|v| float(tag, v)).transpose();
    let unit = |tag: u8| get(tag).map(|v| read_unit(tag, v, TEXT)).transpose();
    let law = match need(LAW)? {
        [1] => LawKind::OpticalDepth,
        [2] => LawKind::AlphaBlend,
        [law] => return Err(SectionFault::Unknown(format!("unknown image law {law}"))),
        v => return Err(SectionFault::Corrupt(format!("the image law has {} bytes instead of 1", v.len()))),
    };
    let masses = masses(need(MASSES)?)?;
    let mut m = Metadata {
        law,
        count: u64::from_le_bytes(exact(COUNT, need(COUNT)?)?),
        mass: float(MASS, need(MASS)?)?,
        bounds: bounds(need(BOUNDS)?)?,
        cell: get(CELL).map(|v| cell(v, get(CORNER))).transpose()?,
        default_radius: float(RADIUS, need(RADIUS)?)?,
        default_opacity: float(OPACITY, need(OPACITY)?)?,
        source: string(SOURCE, need(SOURCE)?, TEXT)?,
        source_hash: exact(HASH, need(HASH)?)?,
        units: Units {
            length: unit(LENGTH_UNIT)?,
            mass: unit(MASS_UNIT)?,
            time: unit(TIME_UNIT)?,
            comoving: get(COMOVING).map(|v| flag(COMOVING, v)).transpose()?,
        },
        cosmology: get(COSMOLOGY).map_or(Ok(Cosmology::default()), cosmology)?,
        epoch: Epoch {
            scale_factor: real(SCALE_FACTOR)?,
            time: real(TIME)?,
            frame: get(FRAME).map(|v| exact(FRAME, v).map(u64::from_le_bytes)).transpose()?,
            step: get(STEP).map(|v| exact(STEP, v).map(i64::from_le_bytes)).transpose()?,
        },
        fields: Vec::new(),
        fields_hash: get(FIELDS_HASH).map(|v| exact(FIELDS_HASH, v)).transpose()?,
        shared_species: get(SPECIES).map_or(Ok(Vec::new()), shared_species)?,
        // A newer program may use other words, which are unknown here.
        recipe: serde_json::from_slice(need(RECIPE)?).unwrap_or_else(|_| Recipe::unknown()),
        tool_version: string(TOOL, need(TOOL)?, TEXT)?,
    };
    if m.count == 0 || !(m.mass > 0.0 && m.default_radius > 0.0 && m.default_opacity > 0.0 && m.default_opacity <= 1.0)
    {
        return Err(SectionFault::Corrupt("count, mass, radius or opacity out of range".into()));
    }
    // The list repeats positions and masses, which other fields imply; what follows these are the model's fields.
    let (all, required) =
        (quantities(need(QUANTITIES)?, &m.units)?, m.quantities(masses.iter().any(|m| m.is_weighted())));
    if !all.starts_with(&required) {
        return Err(SectionFault::Corrupt(
            "the list of stored fields does not start with positions and, if there are any, masses".into(),
        ));
    }
    m.fields = all[required.len()..].to_vec();
    if let Some(traits) = get(TRAITS) {
        if traits.len() != m.fields.len() {
            let message = format!("the traits of {} fields are given, but there are {}", traits.len(), m.fields.len());
            return Err(SectionFault::Corrupt(message));
        }
        for (field, v) in m.fields.iter_mut().zip(traits) {
            // Only scalars may be logarithmic or sums (section 2, field 32).
            if *v > 7 || (*v > 1 && matches!(field.kind, QuantityKind::Vector | QuantityKind::Category)) {
                return Err(SectionFault::Corrupt(format!("the traits {v} of field `{}` are not known", field.name)));
            }
            (field.by_mass, field.logarithmic, field.extensive) = (v & 1 > 0, v & 2 > 0, v & 4 > 0);
        }
    }
    Ok((m, masses))
}

/// The bits of a layer's flags: particles have weights of their own; the mass of weight 1 is known.
const WEIGHTED: u8 = 1;
const HAS_UNIT: u8 = 2;
/// Means and shapes weigh particles by mass; without it every particle counts alike.
const BY_MASS: u8 = 4;

fn mass_bytes(m: &Mass) -> Vec<u8> {
    let flags = if m.is_weighted() { WEIGHTED } else { 0 } | if m.unit().is_some() { HAS_UNIT } else { 0 };
    std::iter::once(flags).chain(m.unit().iter().flat_map(|u| u.to_le_bytes())).collect()
}

/// Flags a layer and, where they say so, a mass.
fn masses(v: &[u8]) -> Result<Vec<Mass>, SectionFault> {
    let mut r = WireReader::new(v);
    let mut out = Vec::new();
    while !r.is_done() {
        let flags = r.u8()?;
        if flags & BY_MASS != 0 {
            return Err(SectionFault::Unknown("Gaussians weighted by mass are not supported".into()));
        }
        if flags >= BY_MASS {
            return Err(SectionFault::Corrupt(format!("a layer mass has unknown flags {flags:#04x}")));
        }
        let unit = if flags & HAS_UNIT != 0 { Some(float(MASSES, r.take(8)?)?) } else { None };
        if unit.is_some_and(|u| u <= 0.0) {
            return Err(SectionFault::Corrupt("a layer mass is not positive".into()));
        }
        out.push(Mass::new(flags & WEIGHTED != 0, unit));
    }
    if out.is_empty() { Err(SectionFault::Corrupt("the layer masses are missing".into())) } else { Ok(out) }
}

/// The factor (0 where it is not known), the exponents of a and h, and the text.
fn unit_bytes(u: &Unit, longest: usize) -> Vec<u8> {
    let si = u.si.unwrap_or(Si { factor: 0.0, a: 0.0, h: 0.0 });
    let numbers = si.factor.to_le_bytes().into_iter().chain(si.a.to_le_bytes()).chain(si.h.to_le_bytes());
    numbers.chain(text(&u.text, longest).iter().copied()).collect()
}

fn read_unit(tag: u8, v: &[u8], longest: usize) -> Result<Unit, String> {
    let mut r = WireReader::new(v);
    let factor = float(tag, r.take(8)?)?;
    let [a, h] = [r.f32()?, r.f32()?];
    let known = factor > 0.0;
    if factor < 0.0 || !a.is_finite() || !h.is_finite() || !known && (a, h) != (0.0, 0.0) {
        return Err(format!("a unit has an invalid factor {factor} or exponents {a} and {h}"));
    }
    // The text follows the factor of 8 bytes and two exponents of 4.
    Ok(Unit { text: string(tag, &v[16..], longest)?, si: known.then_some(Si { factor, a, h }) })
}

/// A unit among those of the file: 1 to 3 of length, mass and time.
fn common_units(units: &Units) -> [&Option<Unit>; 3] {
    [&units.length, &units.mass, &units.time]
}
/// A quantity has a unit of its own.
const OWN_UNIT: u8 = 255;

fn quantities_bytes(m: &Metadata, layers: &[Mass]) -> Vec<u8> {
    let mut out = Vec::new();
    for q in m.quantities(layers.iter().any(|m| m.is_weighted())) {
        let name = text(&q.name, SHORT);
        out.push(name.len() as u8);
        out.extend(name);
        out.push(q.kind as u8 + 1);
        out.extend(q.bytes.to_le_bytes());
        match (common_units(&m.units).into_iter().position(|u| *u == q.unit), q.unit) {
            (_, None) => out.push(0),
            (Some(k), _) => out.push(k as u8 + 1),
            (None, Some(unit)) => {
                let unit = unit_bytes(&unit, SHORT);
                out.push(OWN_UNIT);
                out.extend((unit.len() as u16).to_le_bytes());
                out.extend(unit);
            }
        }
    }
    out
}

fn quantities(v: &[u8], units: &Units) -> Result<Vec<Quantity>, String> {
    let mut r = WireReader::new(v);
    let mut out = Vec::new();
    while !r.is_done() {
        let length = usize::from(r.u8()?);
        let name = string(QUANTITIES, r.take(length)?, SHORT)?;
        let kind = usize::from(r.u8()?).checked_sub(1).and_then(|k| QuantityKind::ALL.get(k).copied());
        let kind = kind.ok_or_else(|| format!("`{name}` has an unknown kind"))?;
        let bytes = r.u16()?;
        let unit = match r.u8()? {
            0 => None,
            OWN_UNIT => {
                let length = usize::from(r.u16()?);
                Some(read_unit(QUANTITIES, r.take(length)?, SHORT)?)
            }
            k => {
                let unit = common_units(units).get(usize::from(k) - 1).and_then(|u| u.as_ref());
                Some(unit.ok_or_else(|| format!("`{name}` refers to unit {k}, which does not exist"))?.clone())
            }
        };
        out.push(Quantity { unit, bytes, ..Quantity::new(name, kind) });
    }
    check_classes(&out)?;
    Ok(out)
}

/// Checks that the classes of categories are called so, and side by side, 2 to 16 of each.
fn check_classes(all: &[Quantity]) -> Result<(), String> {
    let category = |q: &Quantity| q.class().map(|(category, _)| category.to_string());
    let mut before: Vec<String> = Vec::new();
    for classes in all.chunk_by(|a, b| category(a) == category(b)) {
        match (classes[0].kind, category(&classes[0])) {
            (QuantityKind::Category, None) => return Err(format!("`{}` is no class of a category", classes[0].name)),
            (QuantityKind::Category, Some(name)) => {
                if !(2..=SharedSpecies::MOST).contains(&classes.len()) || before.contains(&name) {
                    return Err(format!("the classes of `{name}` are not 2 to 16 side by side"));
                }
                before.push(name);
            }
            _ => {}
        }
    }
    Ok(())
}

fn species_bytes(all: &[SharedSpecies]) -> Vec<u8> {
    let mut out = Vec::new();
    for species in all {
        let name = text(&species.name, SHORT);
        out.push(name.len() as u8);
        out.extend(name);
        out.extend(species.count.to_le_bytes());
        out.extend(species.mass.unwrap_or(0.0).to_le_bytes());
    }
    out
}

fn shared_species(v: &[u8]) -> Result<Vec<SharedSpecies>, String> {
    let mut r = WireReader::new(v);
    let mut out: Vec<SharedSpecies> = Vec::new();
    while !r.is_done() {
        let length = usize::from(r.u8()?);
        let name = string(SPECIES, r.take(length)?, SHORT)?;
        let (count, mass) = (r.u64()?, float(SPECIES, r.take(8)?)?);
        if count == 0 || mass < 0.0 || out.iter().any(|s| s.name == name) {
            return Err(format!("species `{name}` is listed twice, or has no particles or a negative mass"));
        }
        out.push(SharedSpecies { name, count, mass: Some(mass).filter(|m| *m > 0.0) });
    }
    if !(2..=SharedSpecies::MOST).contains(&out.len()) {
        return Err(format!("{} species share Gaussians instead of 2 to 16", out.len()));
    }
    Ok(out)
}

/// The numbers of a cosmology in the order of their bits.
fn cosmology_of(c: &Cosmology) -> [Option<f64>; 4] {
    [c.hubble, c.omega_matter, c.omega_lambda, c.omega_baryon]
}

/// Bits say which numbers there are; those of further bits are not known here.
fn cosmology(v: &[u8]) -> Result<Cosmology, String> {
    let (known, numbers) = v.split_first().ok_or("the cosmology is empty")?;
    let numbers = reals(COSMOLOGY, numbers)?;
    // Numbers of bits that only a newer program knows are there, too, and are passed over.
    if numbers.len() != known.count_ones() as usize {
        return Err(format!("the cosmology has {} numbers, which does not match its bits {known:#04x}", numbers.len()));
    }
    let mut numbers = numbers.into_iter();
    let [hubble, omega_matter, omega_lambda, omega_baryon] =
        [0, 1, 2, 3].map(|k| if known >> k & 1 == 1 { numbers.next() } else { None });
    Ok(Cosmology { hubble, omega_matter, omega_lambda, omega_baryon })
}

/// Splits the section; tags rise.
fn fields(bytes: &[u8]) -> Result<Vec<(u8, &[u8])>, SectionFault> {
    let mut r = WireReader::new(bytes);
    let mut out: Vec<(u8, &[u8])> = Vec::with_capacity(32);
    while !r.is_done() {
        let (tag, length) = (r.u8()?, r.u16()?);
        let value = r.take(usize::from(length))?;
        if out.last().is_some_and(|f| f.0 >= tag) {
            return Err(SectionFault::Corrupt(format!("metadata field {tag} is out of order")));
        }
        if tag >= REQUIRED && tag != MASSES {
            return Err(SectionFault::Unknown(format!("metadata field {tag} is unknown and required")));
        }
        out.push((tag, value));
    }
    Ok(out)
}

/// The fields of a frame that differ from those of its keyframe; `None` where the keyframe has one that the frame lacks.
pub(crate) fn difference(key: &[u8], frame: &[u8]) -> Option<Vec<u8>> {
    let (key, frame) = (fields(key).ok()?, fields(frame).ok()?);
    if key.iter().any(|(tag, _)| frame.iter().all(|f| f.0 != *tag)) {
        return None;
    }
    Some(joined(frame.into_iter().filter(|f| !key.contains(f))))
}

/// The fields of a frame: those that are given, and the keyframe's others.
pub(crate) fn changed(key: &[u8], change: &[u8]) -> Result<Vec<u8>, SectionFault> {
    let changes = fields(change)?;
    let mut all = fields(key)?;
    all.retain(|f| changes.iter().all(|g| g.0 != f.0));
    all.extend(changes);
    all.sort_by_key(|f| f.0);
    Ok(joined(all.into_iter()))
}

fn joined<'a>(fields: impl Iterator<Item = (u8, &'a [u8])>) -> Vec<u8> {
    let mut out = Vec::new();
    for (tag, value) in fields {
        out.push(tag);
        out.extend((value.len() as u16).to_le_bytes());
        out.extend(value);
    }
    out
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

fn cell(v: &[u8], corner: Option<&[u8]>) -> Result<Cell, SectionFault> {
    let origin = match corner.map(|v| reals(CORNER, v)).transpose()?.as_deref() {
        None => [0.0; 3],
        Some(&[x, y, z]) => [x, y, z],
        Some(_) => return Err(SectionFault::Corrupt("the cell's corner is not three numbers".into())),
    };
    let (head, rest) = v.split_first().ok_or_else(|| "the cell is empty".to_string())?;
    if *head > 7 {
        return Err(SectionFault::Corrupt(format!("cell periodicity {head:#04x} is reserved")));
    }
    let periodic = each_axis(|k| head >> k & 1 == 1);
    let values = reals(CELL, rest)?;
    let vectors = match values[..] {
        [x, y, z] => [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]],
        [a, b, c, d, e, f, g, h, i] => [[a, b, c], [d, e, f], [g, h, i]],
        _ => return Err(SectionFault::Corrupt(format!("the cell has a wrong size: {} bytes", v.len()))),
    };
    Ok(Cell { origin, vectors, periodic })
}

fn bounds(v: &[u8]) -> Result<Bounds, String> {
    match reals(BOUNDS, v)?[..] {
        [a, b, c, d, e, f] if a <= d && b <= e && c <= f => Ok(Bounds { min: [a, b, c], max: [d, e, f] }),
        _ => Err("bounds are not six ordered numbers".into()),
    }
}

fn reals(tag: u8, v: &[u8]) -> Result<Vec<f64>, String> {
    // No field has more than the nine numbers of a cell.
    if !v.len().is_multiple_of(8) || v.len() > 72 {
        return Err(format!("metadata field {tag} has a wrong size: {} bytes", v.len()));
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
    v.try_into().map_err(|_| format!("metadata field {tag} has {} bytes, not {N}", v.len()))
}

fn string(tag: u8, v: &[u8], longest: usize) -> Result<String, String> {
    if v.len() > longest {
        return Err(format!("metadata field {tag} has {} bytes; at most {longest} are allowed", v.len()));
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
    use crate::model::{Dimension, Target};
    use proptest::prelude::*;

    /// Units that are texts alone, and such that were stated with any numbers.
    fn unit() -> impl Strategy<Value = Option<Unit>> {
        let si = (1e-30f64..1e30, -3f32..3.0, -3f32..3.0).prop_map(|(factor, a, h)| Si { factor, a, h });
        proptest::option::of(("\\PC{0,20}", proptest::option::of(si)).prop_map(|(text, si)| Unit { text, si }))
    }

    prop_compose! {
        fn quantity()(name in "\\PC{0,20}", kind in 0usize..4, unit in unit(), bytes in any::<u16>(), by_mass in any::<bool>()) -> Quantity {
            let kind = QuantityKind::ALL[kind];
            let plain = matches!(kind, QuantityKind::Vector | QuantityKind::Category);
            Quantity { name, kind, unit, bytes, by_mass, logarithmic: !by_mass && !plain, extensive: by_mass && !plain }
        }
    }

    prop_compose! {
        fn metadata()(
            (count, source, hash, fields_hash) in (1u64.., "[^/\\\\]{0,20}", any::<[u8; 32]>(), any::<Option<[u8; 16]>>()),
            (length, mass, time, comoving) in (unit(), unit(), unit(), any::<Option<bool>>()),
            numbers in proptest::array::uniform6(proptest::option::of(1e-6f64..1e6)),
            (frame, step) in any::<(Option<u64>, Option<i64>)>(),
            corner in -2f64..2.0,
            cell in any::<Option<[bool; 3]>>(),
            fields in proptest::collection::vec(quantity(), 0..4),
            species in proptest::collection::btree_map("\\PC{0,20}", (1u64.., proptest::option::of(1e-9f64..1e9)), 0..4),
        ) -> Metadata {
            let [hubble, omega_matter, omega_lambda, omega_baryon, scale_factor, time_now] = numbers;
            let bounds = Bounds { min: [corner; 3], max: [corner + 1.0; 3] };
            Metadata {
                cell: cell.map(|periodic| Cell { origin: [corner; 3], periodic, ..Cell::orthogonal([2.0; 3]) }),
                source,
                source_hash: hash,
                units: Units { length, mass, time, comoving },
                cosmology: Cosmology { hubble, omega_matter, omega_lambda, omega_baryon },
                epoch: Epoch { scale_factor, time: time_now, frame, step },
                fields: with_classes(fields),
                fields_hash,
                shared_species: species_list(species),
                ..Metadata::new(LawKind::OpticalDepth, count, bounds)
            }
        }
    }

    /// The same with two classes in the place of each category.
    fn with_classes(fields: Vec<Quantity>) -> Vec<Quantity> {
        let classes = |(i, q): (usize, Quantity)| match q.kind {
            QuantityKind::Category => {
                ["a", "b=c"].map(|class| Quantity { name: format!("kind {i}={class}"), ..q.clone() }).to_vec()
            }
            _ => vec![q],
        };
        fields.into_iter().enumerate().flat_map(classes).collect()
    }

    fn species_list(named: std::collections::BTreeMap<String, (u64, Option<f64>)>) -> Vec<SharedSpecies> {
        let list: Vec<_> = named.into_iter().map(|(name, (count, mass))| SharedSpecies { name, count, mass }).collect();
        if list.len() < 2 { Vec::new() } else { list }
    }

    prop_compose! {
        fn mass()(weighted in any::<bool>(), unit in proptest::option::of(1e-9f64..1e9)) -> Mass {
            Mass::new(weighted, unit)
        }
    }

    proptest! {
        #[test]
        fn metadata_comes_back(m in metadata(), layers in proptest::collection::vec(mass(), 1..4)) {
            let (back, masses) = read(&write(&m, &layers)).ok().unwrap();
            prop_assert_eq!(back, m);
            prop_assert_eq!(of_layers(&masses, layers.len(), false), Some(layers));
        }

        /// Bytes that are damaged or any are refused or read, and what is read can be written.
        #[test]
        fn any_bytes_are_read_or_refused(
            m in metadata(),
            damage in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 0..6),
            any_bytes in proptest::collection::vec(any::<u8>(), 0..64),
        ) {
            let mut bytes = write(&m, &[Mass::Unknown]);
            for (at, value) in damage {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            for bytes in [bytes, any_bytes] {
                if let Ok((m, masses)) = read(&bytes) {
                    prop_assert!(read(&write(&m, &masses)).is_ok());
                }
            }
        }
    }

    #[test]
    fn what_must_be_understood_is_refused_by_older_programs() {
        let m = Metadata::new(LawKind::OpticalDepth, 8, Bounds { min: [0.0; 3], max: [1.0; 3] });
        let section = write(&m, &[Mass::Unknown]);
        let fault = |bytes: &[u8]| match read(bytes) {
            Ok(_) => "none",
            Err(SectionFault::Corrupt(_)) => "corrupt",
            Err(SectionFault::Unknown(_)) => "unknown",
        };
        let with = |tail: &[u8]| [&section[..], tail].concat();
        assert_eq!(fault(&with(&[129, 0, 0])), "unknown");
        let (rest, end) = section.split_at(section.len() - 4);
        assert_eq!(end, [MASSES, 1, 0, 0]);
        let flags = |flags| [rest, &[MASSES, 1, 0, flags]].concat();
        assert_eq!([0, 1, 2, 4, 8].map(|f| fault(&flags(f))), ["none", "corrupt", "corrupt", "unknown", "corrupt"]);
        assert_eq!(fault(rest), "corrupt");
        // Skipped: a tag below 128.
        assert_eq!(fault(&[rest, &[127, 1, 0, 7], end].concat()), "none");
    }

    #[test]
    fn paths_of_sources_are_left_out() {
        let mut m = Metadata::new(LawKind::OpticalDepth, 8, Bounds { min: [0.0; 3], max: [1.0; 3] });
        for path in ["/home/me/snap.hdf5", "C:\\me\\snap.hdf5", "snap.hdf5"] {
            m.source = path.into();
            assert_eq!(read(&write(&m, &[Mass::Unknown])).ok().unwrap().0.source, "snap.hdf5");
        }
    }

    #[test]
    fn recipes_come_back_and_what_is_none_says_nothing() {
        let with = |recipe| Metadata {
            recipe,
            ..Metadata::new(LawKind::OpticalDepth, 8, Bounds { min: [0.0; 3], max: [1.0; 3] })
        };
        let recipe_of = |section: &[u8]| read(section).ok().unwrap().0.recipe;
        let some = Recipe { target: Target::Ratio(0.1), seed: u64::MAX, ..Recipe::default() };
        let long = Recipe { read: [("species".into(), "x".repeat(RECIPE_TEXT))].into(), ..some.clone() };
        for (recipe, expected) in [(some.clone(), some.clone()), (long, Recipe::unknown())] {
            assert_eq!(recipe_of(&write(&with(recipe), &[Mass::Unknown])), expected);
        }
        let mut section = write(&with(some), &[Mass::Unknown]);
        let at = section.windows(7).position(|w| w == b"default").unwrap();
        section[at] = b'D';
        assert_eq!(recipe_of(&section), Recipe::unknown());
    }

    #[test]
    fn a_quantity_may_share_a_unit_of_the_file() {
        let mut m = Metadata::new(LawKind::OpticalDepth, 8, Bounds { min: [0.0; 3], max: [1.0; 3] });
        let bytes = |m: &Metadata| write(m, &[Mass::Weights(None)]).len();
        let without = bytes(&m);
        m.units.length = Some(Unit::parse("Mpc/h", Dimension::Length));
        assert_eq!(bytes(&m) - without, 3 + 16 + 5);
    }
}
