//! Fields of a snapshot beside positions and weights: read where they lie when particles are written.

use super::{RUN, SnapshotReader};
use particlegs_core::{Error, Hint, Result};
use particlegs_files::memory::require;
use std::fmt;
use std::sync::Arc;

/// Type of a field's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// IEEE 754, 4 bytes.
    F32,
    /// IEEE 754, 8 bytes.
    F64,
    /// Signed, 1 byte.
    I8,
    /// Signed, 2 bytes.
    I16,
    /// Signed, 4 bytes.
    I32,
    /// Signed, 8 bytes.
    I64,
    /// Unsigned, 1 byte.
    U8,
    /// Unsigned, 2 bytes.
    U16,
    /// Unsigned, 4 bytes.
    U32,
    /// Unsigned, 8 bytes.
    U64,
}

impl Number {
    /// Bytes of a number.
    pub fn bytes(self) -> u64 {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::F32 | Number::I32 | Number::U32 => 4,
            Number::F64 | Number::I64 | Number::U64 => 8,
        }
    }

    /// Whether it is a type of whole numbers.
    pub fn is_whole(self) -> bool {
        !matches!(self, Number::F32 | Number::F64)
    }

    /// The value of a stored number; one beyond 2^53 is rounded.
    pub fn value(self, stored: StoredNumber) -> f64 {
        match self {
            Number::I64 => stored.bits() as i64 as f64,
            Number::U64 => stored.bits() as f64,
            _ => stored.0,
        }
    }

    /// A number as this type has it; whole numbers lose a fraction.
    pub fn stored(self, value: f64) -> StoredNumber {
        match self {
            Number::I64 => StoredNumber(f64::from_bits(value as i64 as u64)),
            Number::U64 => StoredNumber(f64::from_bits(value as u64)),
            _ => StoredNumber(value),
        }
    }

    /// Appends a stored number, little-endian.
    pub fn append(self, stored: StoredNumber, out: &mut Vec<u8>) {
        let value = stored.0;
        match self {
            Number::F32 => out.extend((value as f32).to_le_bytes()),
            Number::F64 | Number::I64 | Number::U64 => out.extend(stored.bits().to_le_bytes()),
            Number::I8 => out.extend((value as i8).to_le_bytes()),
            Number::I16 => out.extend((value as i16).to_le_bytes()),
            Number::I32 => out.extend((value as i32).to_le_bytes()),
            Number::U8 => out.extend((value as u8).to_le_bytes()),
            Number::U16 => out.extend((value as u16).to_le_bytes()),
            Number::U32 => out.extend((value as u32).to_le_bytes()),
        }
    }
}

/// A number on its way from file to file, which keeps all bits: whole ones of 64 bits are their bits, no float64.
/// [`Number::value`] tells what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredNumber(pub(super) f64);

impl StoredNumber {
    /// The bits of a number of 64 bits.
    pub fn bits(self) -> u64 {
        self.0.to_bits()
    }
}

/// A field of a snapshot.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceField {
    /// Name as the source has it.
    pub name: String,
    /// Type of its numbers.
    pub number: Number,
    /// Numbers a particle.
    pub components: u32,
    /// Unit as text, where the source says.
    pub unit: Option<String>,
    /// Numbers that the source says about it, by name: powers of a and h, a factor.
    pub attributes: Vec<(String, f64)>,
    /// Factor to peculiar velocities in km/s or physical specific energies in (km/s)^2, where the source tells.
    pub physical: Option<PhysicalUnit>,
}

impl SourceField {
    /// Whether a field of this name, with so many numbers a particle, holds velocities, or one component of them.
    pub fn is_velocity(name: &str, components: u32) -> bool {
        let mut all = VELOCITIES.iter().filter(|names| names.len() * components as usize == 3);
        all.any(|names| names.iter().any(|n| n.eq_ignore_ascii_case(name)))
    }
}

/// The conversion of a field's values to physical ones.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalUnit {
    /// Factor of the values.
    pub factor: f64,
    /// The reason for it, for people.
    pub note: String,
}

/// The fields of a layer.
#[derive(Clone)]
pub struct LayerFields {
    /// Name, type and unit of each.
    pub fields: Vec<SourceField>,
    /// Three components each, in the order of the fields'.
    columns: Vec<Triple>,
    positions: Option<Triple>,
    /// Fields that it lacks, and why.
    absent: Vec<(String, String)>,
}

/// A field as a user names it.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FieldColumns {
    /// Unit as text, where the source says.
    pub unit: Option<String>,
    /// The columns of a run that are its components.
    pub columns: Vec<usize>,
    /// The names that the source has for it.
    pub sources: Vec<String>,
    /// Whether values need more digits than a float32 has.
    pub wide: bool,
    /// Factors of the values of each component to be in `unit`.
    pub factors: Vec<f64>,
    /// Whether all components have that unit.
    pub has_one_unit: bool,
    /// The source of the factors, for people.
    pub note: Option<String>,
    /// Of temperatures that are computed from the one column.
    pub temperature: Option<GasTemperature>,
    /// Whether particles may lack a value (NaN).
    pub may_lack: bool,
    /// Whether values are whole numbers of few bits.
    #[serde(default)]
    pub whole: bool,
    /// Of a class of a category: the value of its particles. Values are then 1 for these, else 0.
    #[serde(default)]
    pub class: Option<f64>,
}

impl FieldColumns {
    /// Component `k` of the particles of a run, whose columns these are; NaN where they lack them.
    pub fn values<'a>(&'a self, run: &'a [Vec<f64>], k: usize) -> impl Iterator<Item = f64> + 'a {
        let factor = self.factors[k];
        run[self.columns[k]].iter().enumerate().map(move |(i, v)| match (&self.temperature, self.class) {
            (Some(gas), _) => gas.of(factor * v, run, i),
            (_, Some(class)) => f64::from(u8::from(*v == class)),
            _ => factor * v,
        })
    }

    /// The temperature of star-forming gas.
    pub fn star_forming(&self) -> StarFormingGas {
        self.temperature.as_ref().map_or(StarFormingGas::Keep, |t| t.star_forming)
    }

    /// Whether this column of a run is needed.
    pub fn needs(&self, column: usize) -> bool {
        let of_gas = self.temperature.as_ref().is_some_and(|t| [t.electrons, t.star_formation].contains(&Some(column)));
        of_gas || self.columns.contains(&column)
    }
}

/// Temperatures from specific energies.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GasTemperature {
    /// Column of electrons over hydrogen nuclei; without it the gas is fully ionised.
    electrons: Option<usize>,
    /// Column of star formation rates.
    star_formation: Option<usize>,
    star_forming: StarFormingGas,
}

/// The temperature of star-forming gas, whose energy stands for an effective equation of state.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum StarFormingGas {
    /// That of its energy.
    #[default]
    Keep,
    /// None: it does not count.
    Omit,
    /// This one, in K.
    Temperature(f64),
}

impl fmt::Display for StarFormingGas {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StarFormingGas::Keep => f.write_str("keep"),
            StarFormingGas::Omit => f.write_str("drop"),
            StarFormingGas::Temperature(kelvin) => write!(f, "{kelvin}"),
        }
    }
}

impl std::str::FromStr for StarFormingGas {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match (text, text.parse::<f64>()) {
            ("keep", _) => Ok(StarFormingGas::Keep),
            ("drop", _) => Ok(StarFormingGas::Omit),
            (_, Ok(kelvin)) if kelvin > 0.0 && kelvin.is_finite() => Ok(StarFormingGas::Temperature(kelvin)),
            _ => Err("use `keep`, `drop`, or a temperature in K above 0".into()),
        }
    }
}

/// Share of hydrogen in the mass of primordial gas.
const HYDROGEN: f64 = 0.76;
/// Mass of a proton times 1 (km/s)^2 over Boltzmann's constant, in K (CODATA 2018).
const KELVIN: f64 = 121.147_35;

impl GasTemperature {
    /// That of particle `i` of a run, of specific energy `energy` in (km/s)^2.
    fn of(&self, energy: f64, run: &[Vec<f64>], i: usize) -> f64 {
        let is_forming = self.star_formation.is_some_and(|c| run[c][i] > 0.0);
        match self.star_forming {
            StarFormingGas::Omit if is_forming => return f64::NAN,
            StarFormingGas::Temperature(kelvin) if is_forming => return kelvin,
            _ => {}
        }
        let electrons = self.electrons.map_or((1.0 + HYDROGEN) / (2.0 * HYDROGEN), |c| run[c][i]);
        let weight = 4.0 / (1.0 + 3.0 * HYDROGEN + 4.0 * HYDROGEN * electrons);
        2.0 / 3.0 * energy * weight * KELVIN
    }
}

const TEMPERATURE: &str = "temperature";
const VELOCITY: &str = "velocity";
/// The unit of peculiar velocities.
pub const KM_S: &str = "km/s";
/// Names of velocities in formats, as one field or three.
const VELOCITIES: &[&[&str]] = &[
    &[VELOCITY],
    &["velocities"],
    &["vel"],
    &["vx", "vy", "vz"],
    &["vel_x", "vel_y", "vel_z"],
    &["velocity_x", "velocity_y", "velocity_z"],
];

/// Three columns.
#[derive(Clone)]
enum Triple {
    Reader(Arc<dyn SnapshotReader>),
    /// Columns of a stream, which cannot be read run by run.
    Memory(Arc<[Vec<f64>; 3]>),
}

impl LayerFields {
    /// `fields`, of whose components each of `readers` gives three as positions, and the layer's own positions, where the
    /// source has them to more digits than float32.
    pub fn new(
        fields: Vec<SourceField>,
        readers: Vec<Arc<dyn SnapshotReader>>,
        positions: Option<Arc<dyn SnapshotReader>>,
    ) -> Result<Self> {
        let columns = readers.into_iter().map(Triple::from_reader).collect::<Result<_>>()?;
        let positions = positions.map(Triple::from_reader).transpose()?;
        Ok(LayerFields { fields, columns, positions, absent: Vec::new() })
    }

    /// The same, with names of fields that the layer lacks, and why.
    pub fn with_absent(self, absent: Vec<(String, String)>) -> Self {
        LayerFields { absent, ..self }
    }

    /// Fields of real numbers that are in memory, a column for each component; vectors first.
    pub fn from_columns(fields: Vec<SourceField>, mut columns: Vec<Vec<f64>>) -> LayerFields {
        // Readers hand over columns in threes, and so must this; the surplus ones are empty.
        columns.resize_with(columns.len().next_multiple_of(3), Vec::new);
        let mut columns = columns.into_iter();
        let mut triples = Vec::new();
        while let (Some(a), Some(b), Some(c)) = (columns.next(), columns.next(), columns.next()) {
            triples.push(Triple::Memory(Arc::new([a, b, c])));
        }
        LayerFields { fields, columns: triples, positions: None, absent: Vec::new() }
    }

    /// The values of field `number` of the layer's `count` particles, a column for each component.
    pub fn values(&self, number: usize, count: usize) -> Result<Vec<Vec<f64>>> {
        let first: usize = self.fields[..number].iter().map(|f| f.components as usize).sum();
        let components = self.fields[number].components as usize;
        let mut all = vec![Vec::with_capacity(count); components];
        let mut run = Vec::new();
        for id in 0..count.div_ceil(RUN) {
            self.read_some(id as u64, |c| (first..first + components).contains(&c), &mut run)?;
            all.iter_mut().zip(&run[first..]).for_each(|(all, part)| all.extend_from_slice(part));
        }
        Ok(all)
    }

    /// The bits of a field of whole numbers, one per particle, of the layer's `count` particles: equal where these are.
    pub fn identities(&self, number: usize, count: usize) -> Result<Vec<u64>> {
        let column: usize = self.fields[..number].iter().map(|f| f.components as usize).sum();
        let (mut all, mut run) = (Vec::with_capacity(count), Vec::new());
        for id in 0..count.div_ceil(RUN) {
            self.read_stored(id as u64, |c| c == column, &mut run)?;
            all.extend(run[column].iter().map(|v| v.to_bits()));
        }
        Ok(all)
    }

    pub(super) fn has_positions(&self) -> bool {
        self.positions.is_some()
    }

    /// The numbers of the columns that are `wanted` in run `run` of the layer; the others are empty or not.
    pub fn read_some(&self, run: u64, wanted: impl Fn(usize) -> bool, out: &mut Vec<Vec<f64>>) -> Result<()> {
        self.read_stored(run, &wanted, out)?;
        let numbers = self.fields.iter().flat_map(|f| std::iter::repeat_n(f.number, f.components as usize));
        for (column, (number, values)) in numbers.zip(out).enumerate() {
            if matches!(number, Number::I64 | Number::U64) && wanted(column) {
                values.iter_mut().for_each(|v| *v = number.value(StoredNumber(*v)));
            }
        }
        Ok(())
    }

    /// The same, each as [`StoredNumber`] has it.
    pub(super) fn read_stored(&self, run: u64, wanted: impl Fn(usize) -> bool, out: &mut Vec<Vec<f64>>) -> Result<()> {
        let count: u32 = self.fields.iter().map(|f| f.components).sum();
        out.resize_with(count as usize, Vec::new);
        let mut three = <[Vec<f64>; 3]>::default();
        for (number, (triple, part)) in self.columns.iter().zip(out.chunks_mut(3)).enumerate() {
            if !(3 * number..3 * number + part.len()).any(&wanted) {
                continue;
            }
            triple.read(run, &mut three)?;
            // Swapped, so that the old columns serve as buffers of the next three.
            part.iter_mut().zip(&mut three).for_each(|(to, from)| std::mem::swap(to, from));
        }
        Ok(())
    }

    /// The field that a user names: a scalar, a vector, `velocity` for what formats call it, which may be three columns, or
    /// `temperature`, which is computed where there are specific energies alone.
    pub fn find(&self, name: &str, star_forming: StarFormingGas) -> Result<FieldColumns> {
        if let Some(temperature) = self.temperature(name, star_forming) {
            return Ok(temperature);
        }
        let names: &[&[&str]] = if name.eq_ignore_ascii_case(VELOCITY) { VELOCITIES } else { &[] };
        let single_name = [name];
        let Some(field_columns) =
            std::iter::once(&single_name[..]).chain(names.iter().copied()).find_map(|n| self.columns_of(n))
        else {
            let is_it = |absent: &str| {
                let called = |names: &[&str]| matches!(names, [one] if one.eq_ignore_ascii_case(absent));
                absent.eq_ignore_ascii_case(name) || names.iter().any(|names| called(names))
            };
            if let Some((_, why)) = self.absent.iter().find(|(absent, _)| is_it(absent)) {
                return Err(Error::argument_with(why, Hint::from("choose other frames, or omit the field")));
            }
            let field_names = self.real_fields();
            let hint = match field_names.is_empty() {
                true => "it has only positions and masses".to_string(),
                false => format!("its fields: {}", field_names.join(", ")),
            };
            return Err(Error::argument_with(format!("the snapshot has no field `{name}`"), hint));
        };
        match field_columns.columns.len() {
            _ if !field_columns.has_one_unit => Err(Error::argument_with(
                format!("the columns {} of field `{name}` are in different units", field_columns.sources.join(", ")),
                "write them in one unit",
            )),
            1 | 3 => Ok(field_columns),
            n => Err(Error::argument_with(
                format!("field `{name}` has {n} numbers per particle, but a model stores 1 or 3"),
                "choose another field",
            )),
        }
    }

    /// The fields of these names, one after the other.
    fn columns_of(&self, names: &[&str]) -> Option<FieldColumns> {
        let mut field_columns = FieldColumns { has_one_unit: true, ..FieldColumns::default() };
        for name in names {
            let mut first = 0;
            let (field, columns) = self.fields.iter().find_map(|f| {
                let column_range = first..first + f.components as usize;
                first = column_range.end;
                f.name.eq_ignore_ascii_case(name).then_some((f, column_range))
            })?;
            field_columns.sources.push(field.name.clone());
            field_columns.wide |= field.number != Number::F32;
            field_columns.whole = field.number.is_whole();
            let is_velocity = names.len() * field.components as usize == 3;
            let is_energy = field.components == 1 && !SourceField::is_velocity(&field.name, 1);
            let (unit, factor) = match field.physical.clone().filter(|_| is_velocity || is_energy) {
                Some(PhysicalUnit { factor, note }) => {
                    field_columns.note = Some(note);
                    (Some(if is_velocity { KM_S } else { "(km/s)^2" }.into()), factor)
                }
                None => (field.unit.clone(), 1.0),
            };
            field_columns.has_one_unit &= field_columns.columns.is_empty() || field_columns.unit == unit;
            field_columns.unit = unit;
            field_columns.factors.extend(columns.clone().map(|_| factor));
            field_columns.columns.extend(columns);
        }
        Some(field_columns)
    }

    /// Temperatures in K from specific energies, where there is no field of that name.
    fn temperature(&self, name: &str, star_forming: StarFormingGas) -> Option<FieldColumns> {
        let column = |names: &[&str]| names.iter().find_map(|n| self.columns_of(&[n])).filter(|c| c.columns.len() == 1);
        if !name.eq_ignore_ascii_case(TEMPERATURE) || column(&[TEMPERATURE, "temperatures"]).is_some() {
            return None;
        }
        let energy = column(&["InternalEnergy", "InternalEnergies"])?;
        let [electrons, star_formation] =
            [&["ElectronAbundance"][..], &["StarFormationRate", "StarFormationRates"]].map(column);
        let unit = self.fields.iter().find(|f| f.name == energy.sources[0])?.physical.clone();
        let unit = unit.unwrap_or(PhysicalUnit { factor: 1.0, note: "energies are taken as (km/s)^2".into() });
        let mut note = format!(
            "K, computed from {}: T = (gamma - 1) u mu m_p / k_B with gamma = 5/3, mu = 4 / (1 + 3 X + 4 X x_e), X = {HYDROGEN}, {}; {}",
            energy.sources[0],
            if electrons.is_some() { "x_e from ElectronAbundance" } else { "fully ionised (x_e = 1.158)" },
            unit.note
        );
        note += match (&star_formation, star_forming) {
            (None, _) => "",
            (_, StarFormingGas::Keep) => "; star-forming gas keeps the temperature of its equation of state",
            (_, StarFormingGas::Omit) => "; star-forming gas has none",
            (_, StarFormingGas::Temperature(_)) => "; star-forming gas has the temperature that you chose",
        };
        let sources = [Some(&energy), electrons.as_ref(), star_formation.as_ref()];
        let sources = sources.into_iter().flatten().flat_map(|c| c.sources.clone()).collect();
        let first = |c: &Option<FieldColumns>| c.as_ref().map(|c| c.columns[0]);
        let (electrons, star_formation) = (first(&electrons), first(&star_formation));
        let may_lack = star_formation.is_some() && star_forming == StarFormingGas::Omit;
        let temperature = Some(GasTemperature { electrons, star_formation, star_forming });
        let factors = vec![unit.factor];
        Some(FieldColumns {
            unit: Some("K".into()),
            columns: energy.columns,
            sources,
            factors,
            has_one_unit: true,
            note: Some(note),
            temperature,
            may_lack,
            wide: true,
            ..FieldColumns::default()
        })
    }

    /// Names for [`LayerFields::find`] of all fields of real numbers, one or three per particle.
    pub fn real_fields(&self) -> Vec<String> {
        let velocity = VELOCITIES.iter().filter(|names| names.len() == 3).find_map(|names| self.columns_of(names));
        let joined = velocity.map_or(Vec::new(), |v| v.sources);
        let is_real =
            |f: &&SourceField| !f.number.is_whole() && matches!(f.components, 1 | 3) && !joined.contains(&f.name);
        let velocity = (!joined.is_empty()).then(|| VELOCITY.to_string());
        velocity.into_iter().chain(self.fields.iter().filter(is_real).map(|f| f.name.clone())).collect()
    }

    /// Those names of scalars, without masses; a temperature that is computed comes first.
    pub fn scalars(&self) -> Vec<String> {
        let keep = StarFormingGas::Keep;
        let computed = self.temperature(TEMPERATURE, keep).map(|_| TEMPERATURE.to_string());
        let is_mass = |name: &str| ["mass", "masses"].iter().any(|mass| name.eq_ignore_ascii_case(mass));
        let is_one = |name: &String| !is_mass(name) && self.find(name, keep).is_ok_and(|f| f.columns.len() == 1);
        computed.into_iter().chain(self.real_fields().into_iter().filter(is_one)).collect()
    }

    pub(super) fn read_positions(&self, run: u64, out: &mut [Vec<f64>; 3]) -> Result<()> {
        self.positions.as_ref().map_or(Ok(()), |p| p.read(run, out))
    }
}

impl Triple {
    fn from_reader(reader: Arc<dyn SnapshotReader>) -> Result<Triple> {
        if reader.random_access() {
            return Ok(Triple::Reader(reader));
        }
        require("the fields of a compressed file", reader.count().saturating_mul(24))?;
        let mut all = <[Vec<f64>; 3]>::default();
        reader.read_wide(0..reader.count().div_ceil(RUN as u64), &mut |_, part| {
            all.iter_mut().zip(part).for_each(|(all, part)| all.extend_from_slice(part));
            Ok(())
        })?;
        Ok(Triple::Memory(Arc::new(all)))
    }

    fn read(&self, run: u64, out: &mut [Vec<f64>; 3]) -> Result<()> {
        let mut copy = |part: [&[f64]; 3]| {
            out.iter_mut().zip(part).for_each(|(out, part)| {
                out.clear();
                out.extend_from_slice(part);
            });
        };
        match self {
            Triple::Reader(reader) => reader.read_wide(run..run + 1, &mut |_, part| {
                copy(part);
                Ok(())
            }),
            Triple::Memory(all) => {
                let start = run as usize * RUN;
                copy([0, 1, 2].map(|k| &all[k][start.min(all[k].len())..all[k].len().min(start + RUN)]));
                Ok(())
            }
        }
    }
}
