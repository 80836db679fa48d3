//! Particles whose fields lie at equal distances in one file or in memory, each species in records of its own or in rows
//! among those of others: binary trajectories and structures.

use crate::columns::ColumnarField;
use crate::numbers::{Bytes, NumberType, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, PieceReader, RowBuffer};
use crate::text::table::MOST_SPECIES;
use crate::{Choice, Description, Snapshot, Species, SpeciesMass, axes, wrapping};
use particlegs_core::space::{Cell, PeriodicCell};
use particlegs_core::{Error, Result};
use particlegs_particles::{InPlace, SnapshotReader};
use std::ops::Range;
use std::sync::Arc;

/// A field, and its unit as text.
pub type AtomField = (ColumnarField, Option<&'static str>);

/// A species and where it lies.
pub struct AtomSpecies {
    pub name: String,
    pub aliases: Vec<String>,
    pub mass: SpeciesMass,
    /// The first holds the positions.
    pub fields: Vec<AtomField>,
    /// Rows that the fields have.
    pub rows: u64,
    /// The rows that are the species', ascending; all by default.
    pub own: Option<Arc<[u32]>>,
}

impl AtomSpecies {
    /// All rows. A field `mass` holds the masses.
    pub fn all(fields: Vec<AtomField>, rows: u64) -> AtomSpecies {
        let mass = fields.iter().find(|f| f.0.name == "mass" && f.0.components == 1);
        let mass = mass.map_or(SpeciesMass::Unknown, |f| SpeciesMass::Field(f.0.name.clone()));
        AtomSpecies { name: "atoms".into(), aliases: Vec::new(), mass, fields, rows, own: None }
    }

    /// One for each type that there is, by the type of each row: its index in `names`, which are names and aliases. All
    /// rows where there are too many types, or where one has no name.
    pub fn by_type(self, types: &[u32], names: &[(String, Vec<String>)]) -> Vec<AtomSpecies> {
        // Rows are kept as u32 below.
        let unnamed = types.iter().any(|&t| t as usize >= names.len());
        if unnamed || names.len() > MOST_SPECIES || types.len() as u64 != self.rows || self.rows > u32::MAX.into() {
            return vec![self];
        }
        let mut species_rows: Vec<Vec<u32>> = vec![Vec::new(); names.len()];
        for (row, &one) in types.iter().enumerate() {
            species_rows[one as usize].push(row as u32);
        }
        let named_rows = names.iter().zip(species_rows).filter(|(_, rows)| !rows.is_empty());
        let species = named_rows.map(|((name, aliases), rows)| AtomSpecies {
            name: name.clone(),
            aliases: aliases.clone(),
            mass: self.mass.clone(),
            fields: self.fields.clone(),
            rows: self.rows,
            own: Some(rows.into()),
        });
        species.collect()
    }

    fn count(&self) -> u64 {
        self.own.as_ref().map_or(self.rows, |rows| rows.len() as u64)
    }

    fn described(&self) -> Species {
        let field = |(field, unit): &AtomField| {
            let mut field = field.described();
            field.unit = unit.map(String::from);
            field
        };
        Species {
            name: self.name.clone(),
            aliases: self.aliases.clone(),
            count: self.count(),
            mass: self.mass.clone(),
            positions: self.fields.first().map_or(String::new(), |f| f.0.name.clone()),
            fields: self.fields.iter().map(field).collect(),
        }
    }
}

/// Numbers one after the other from byte `base` of a file: `components` for each row.
pub fn array(name: &str, kind: NumberType, components: u32, base: u64, big_endian: bool) -> ColumnarField {
    let stride = kind.bytes() * u64::from(components);
    ColumnarField { big_endian, ..ColumnarField::in_records(name, kind, components, [base, stride, 0]) }
}

/// The cell of three lengths and the angles between b and c, c and a, a and b in degrees, its first vector along x and the
/// second in the plane of x and y.
pub fn cell_of([a, b, c]: [f64; 3], angles: [f64; 3]) -> Option<Cell> {
    // Right angles are exact.
    let cosine = |angle: f64| if angle == 90.0 { 0.0 } else { angle.to_radians().cos() };
    let [alpha, beta, gamma] = angles.map(cosine);
    let sine = (1.0 - gamma * gamma).sqrt();
    let y = c * (alpha - beta * gamma) / sine;
    let z = (c * c * (1.0 - beta * beta) - y * y).sqrt();
    Cell::stated([0.0; 3], [[a, 0.0, 0.0], [b * gamma, b * sine, 0.0], [c * beta, y, z]], [true; 3])
}

/// A number as its own few digits say it, in more of them.
pub fn widened(value: f32) -> f64 {
    value.to_string().parse().unwrap_or_else(|_| value.into())
}

pub struct AtomSnapshot {
    description: Description,
    place: String,
    bytes: Bytes,
    species: Vec<AtomSpecies>,
    wraps: bool,
}

impl AtomSnapshot {
    /// `description` without its species; the fields lie in `bytes`.
    pub fn new(mut description: Description, bytes: Bytes, mut species: Vec<AtomSpecies>) -> AtomSnapshot {
        species.retain(|one| one.count() > 0);
        let place = description.files.first().map(|f| f.display().to_string()).unwrap_or_default();
        description.species = species.iter().map(AtomSpecies::described).collect();
        AtomSnapshot { description, place, bytes, species, wraps: false }
    }

    /// Wraps positions into the periodic cell where the first ones tell that they are unwrapped; with
    /// [`Choice::keep_unwrapped`] drops the cell.
    pub fn with_unwrapped(mut self, choice: &Choice) -> Result<AtomSnapshot> {
        let mut rows = RowBuffer::default();
        if !self.species.is_empty() {
            let first = self.rows(0, &Choice::default())?;
            first.read(0..first.rows().min(wrapping::LOOKED_AT as u64), &mut rows)?;
        }
        let [x, y, z] = &rows.position;
        let positions = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]);
        self.wraps = wrapping::settle(&mut self.description, choice, |periods| wrapping::leave(periods, positions))?;
        Ok(self)
    }

    fn rows(&self, species: usize, choice: &Choice) -> Result<OwnRows> {
        let (Some(species), Some(source)) = (self.description.species.get(species), self.species.get(species)) else {
            return Err(Error::argument(format!("particle type {species} does not exist")));
        };
        let columns = axes::columns(&self.place, species, choice)?;
        let lane = |(k, wanted): (usize, &axes::FieldComponent)| {
            let column = source.fields.iter().find(|f| f.0.name == wanted.field)?.0.column(wanted.component)?;
            let kind = column.lane.kind.stored(choice.as_stored && k < 3);
            Some(StridedColumn { offset: column.base + column.lane.offset, kind, ..column.lane })
        };
        let lanes: Option<Vec<StridedColumn>> = columns.iter().enumerate().map(lane).collect();
        let lanes = lanes.ok_or_else(|| Error::input(&self.place, "a field lies beyond the file"))?;
        let inner = StridedParticles::new(&self.place, self.bytes.clone(), source.rows, &lanes)?;
        // Other fields than the positions, such as velocities, must not be wrapped.
        let moved = self.wraps && choice.positions.as_ref().is_none_or(|p| *p == species.positions);
        let cell = if moved { wrapping::cell(&self.description, choice)? } else { None };
        Ok(OwnRows { inner: Box::new(inner), own: source.own.clone(), cell })
    }
}

impl Snapshot for AtomSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let rows = self.rows(species, choice)?;
        let species = &self.description.species[species];
        let weighted = species.weight_field(&self.place, &choice.weights)?.is_some();
        Ok(Box::new(PieceReader::new(self.description.meta_of(species), vec![Box::new(rows)], weighted)?))
    }
}

/// Rows so far apart are read together.
const CLOSE: u32 = 64;

/// Rows of one species, ascending, or all, wrapped into a cell where there is one.
pub struct OwnRows {
    pub inner: Box<dyn ParticlePiece>,
    pub own: Option<Arc<[u32]>>,
    pub cell: Option<PeriodicCell>,
}

impl ParticlePiece for OwnRows {
    fn rows(&self) -> u64 {
        self.own.as_ref().map_or(self.inner.rows(), |rows| rows.len() as u64)
    }

    fn is_wide(&self) -> bool {
        self.inner.is_wide()
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        let start = out.position[0].len();
        match &self.own {
            None => self.inner.read(rows, out)?,
            Some(own_rows) => {
                // Neighbours together, with what lies between those that are close.
                let mut between = RowBuffer::default();
                for near in own_rows[rows.start as usize..rows.end as usize].chunk_by(|a, b| b - a <= CLOSE) {
                    let (first, end) = (near[0], near[near.len() - 1] + 1);
                    if near.len() == (end - first) as usize {
                        self.inner.read(first.into()..end.into(), out)?;
                        continue;
                    }
                    between.clear();
                    self.inner.read(first.into()..end.into(), &mut between)?;
                    // The fourth column holds the weights, and is empty where none are read.
                    for which in 0..4 {
                        let all = std::mem::take(between.column(which));
                        out.column(which).extend(near.iter().filter_map(|row| all.get((row - first) as usize)));
                    }
                }
            }
        }
        if let Some(cell) = &self.cell {
            let [x, y, z] = &mut out.position;
            for ((x, y), z) in x.iter_mut().zip(y).zip(z).skip(start) {
                [*x, *y, *z] = cell.image([*x, *y, *z]);
            }
        }
        Ok(())
    }

    fn in_place(&self) -> Option<InPlace> {
        if self.own.is_none() && self.cell.is_none() { self.inner.in_place() } else { None }
    }
}

/// Fields in memory, one array behind the other.
#[derive(Default)]
pub struct FieldBuffer {
    bytes: Vec<u8>,
    fields: Vec<AtomField>,
}

impl FieldBuffer {
    /// Numbers row by row.
    pub fn add(&mut self, name: &str, components: u32, unit: Option<&'static str>, values: &[f64]) {
        let start = self.bytes.len() as u64;
        self.fields.push((array(name, NumberType::F64, components, start, false), unit));
        values.iter().for_each(|v| self.bytes.extend_from_slice(&v.to_le_bytes()));
    }

    pub fn add_whole(&mut self, name: &str, values: &[i64]) {
        let start = self.bytes.len() as u64;
        self.fields.push((array(name, NumberType::I64, 1, start, false), None));
        values.iter().for_each(|v| self.bytes.extend_from_slice(&v.to_le_bytes()));
    }

    pub fn finish(self) -> (Bytes, Vec<AtomField>) {
        (Bytes::Owned(Arc::new(self.bytes)), self.fields)
    }
}
