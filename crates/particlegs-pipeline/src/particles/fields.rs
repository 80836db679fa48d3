//! Fields of a snapshot beside positions and weights: read where they lie when particles are written.

use super::{RUN, SnapshotReader};
use crate::{Error, Result};
use particlegs_files::memory::require;
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

    /// Appends a number of a [`super::Run`]'s fields, little-endian.
    pub fn append(self, value: f64, out: &mut Vec<u8>) {
        match self {
            Number::F32 => out.extend((value as f32).to_le_bytes()),
            // Whole numbers of 64 bits come as their bits.
            Number::F64 | Number::I64 | Number::U64 => out.extend(value.to_bits().to_le_bytes()),
            Number::I8 => out.extend((value as i8).to_le_bytes()),
            Number::I16 => out.extend((value as i16).to_le_bytes()),
            Number::I32 => out.extend((value as i32).to_le_bytes()),
            Number::U8 => out.extend((value as u8).to_le_bytes()),
            Number::U16 => out.extend((value as u16).to_le_bytes()),
            Number::U32 => out.extend((value as u32).to_le_bytes()),
        }
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
    /// The factor that makes velocities peculiar, in km/s, and why it is that; where the source tells.
    pub peculiar: Option<(f64, String)>,
}

/// The fields of a layer.
#[derive(Clone)]
pub struct LayerFields {
    /// Name, type and unit of each.
    pub fields: Vec<SourceField>,
    /// Three components each, in the order of the fields'.
    columns: Vec<Triple>,
    positions: Option<Triple>,
}

/// A field as a user names it.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FieldColumns {
    /// Unit as text, where the source says.
    pub unit: Option<String>,
    /// Which columns of a run are its components.
    pub columns: Vec<usize>,
    /// The names that the source has for it.
    pub sources: Vec<String>,
    /// Do values need more digits than a float32 has?
    pub wide: bool,
    /// What values are multiplied by to be in `unit`.
    pub factor: f64,
    /// Where that comes from, for people.
    pub note: Option<String>,
}

const VELOCITY: &str = "velocity";
const KM_S: &str = "km/s";
/// What formats call velocities, as one field or three.
const VELOCITIES: &[&[&str]] = &[
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
        Ok(LayerFields { fields, columns, positions: positions.map(Triple::from_reader).transpose()? })
    }

    /// Fields whose values are in memory, a column for each component; vectors first.
    pub fn from_columns(fields: Vec<SourceField>, mut columns: Vec<Vec<f64>>) -> LayerFields {
        columns.resize_with(columns.len().next_multiple_of(3), Vec::new);
        let mut columns = columns.into_iter();
        let mut triples = Vec::new();
        while let (Some(a), Some(b), Some(c)) = (columns.next(), columns.next(), columns.next()) {
            triples.push(Triple::Memory(Arc::new([a, b, c])));
        }
        LayerFields { fields, columns: triples, positions: None }
    }

    /// The values of field `number` of the layer's `count` particles, a column for each component.
    pub fn values(&self, number: usize, count: usize) -> Result<Vec<Vec<f64>>> {
        let first: usize = self.fields[..number].iter().map(|f| f.components as usize).sum();
        let components = self.fields[number].components as usize;
        let mut all = vec![Vec::with_capacity(count); components];
        let mut run = Vec::new();
        for id in 0..count.div_ceil(RUN) {
            self.read(id as u64, &mut run)?;
            all.iter_mut().zip(&run[first..]).for_each(|(all, part)| all.extend_from_slice(part));
        }
        Ok(all)
    }

    pub(super) fn has_positions(&self) -> bool {
        self.positions.is_some()
    }

    /// Every component of every field in run `run` of the layer.
    pub(crate) fn read(&self, run: u64, out: &mut Vec<Vec<f64>>) -> Result<()> {
        let count: u32 = self.fields.iter().map(|f| f.components).sum();
        out.resize_with(count as usize, Vec::new);
        let mut three = <[Vec<f64>; 3]>::default();
        for (triple, part) in self.columns.iter().zip(out.chunks_mut(3)) {
            triple.read(run, &mut three)?;
            part.iter_mut().zip(&mut three).for_each(|(to, from)| std::mem::swap(to, from));
        }
        Ok(())
    }

    /// The field that a user names: a scalar, a vector, or `velocity` for what formats call it, which may be three columns.
    pub(crate) fn find(&self, name: &str) -> Result<FieldColumns> {
        let names: &[&[&str]] = if name.eq_ignore_ascii_case(VELOCITY) { VELOCITIES } else { &[] };
        let own = [name];
        let Some(found) = std::iter::once(&own[..]).chain(names.iter().copied()).find_map(|n| self.columns_of(n))
        else {
            let there = self.real_fields();
            let hint = match there.is_empty() {
                true => "it has only positions and masses".to_string(),
                false => format!("its fields: {}", there.join(", ")),
            };
            return Err(Error::argument_with(format!("the snapshot has no field `{name}`"), hint));
        };
        match found.columns.len() {
            1 | 3 => Ok(found),
            n => Err(Error::argument_with(
                format!("field `{name}` has {n} numbers per particle, but a model stores 1 or 3"),
                "choose another field",
            )),
        }
    }

    /// The fields of these names, one after the other.
    fn columns_of(&self, names: &[&str]) -> Option<FieldColumns> {
        let mut found = FieldColumns::default();
        for name in names {
            let mut first = 0;
            let (field, columns) = self.fields.iter().find_map(|f| {
                let own = first..first + f.components as usize;
                first = own.end;
                f.name.eq_ignore_ascii_case(name).then_some((f, own))
            })?;
            found.sources.push(field.name.clone());
            found.wide |= field.number != Number::F32;
            (found.unit, found.factor) = (field.unit.clone(), 1.0);
            if let Some((factor, why)) = field.peculiar.clone() {
                (found.unit, found.factor, found.note) = (Some(KM_S.into()), factor, Some(why));
            }
            found.columns.extend(columns);
        }
        Some(found)
    }

    /// Names for [`LayerFields::find`] of all fields of real numbers, one or three per particle.
    pub(crate) fn real_fields(&self) -> Vec<String> {
        let velocity = VELOCITIES.iter().filter(|names| names.len() == 3).find_map(|names| self.columns_of(names));
        let joined = velocity.map_or(Vec::new(), |v| v.sources);
        let is_real = |f: &&SourceField| {
            matches!(f.number, Number::F32 | Number::F64) && matches!(f.components, 1 | 3) && !joined.contains(&f.name)
        };
        let velocity = (!joined.is_empty()).then(|| VELOCITY.to_string());
        velocity.into_iter().chain(self.fields.iter().filter(is_real).map(|f| f.name.clone())).collect()
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
