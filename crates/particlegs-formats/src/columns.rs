//! One kind of particles whose fields lie at equal distances in stretches of a file: NumPy's
//! arrays and archives, records of splats.

use crate::affine::Affine;
use crate::numbers::{NumberType, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, PieceReader};
use crate::stored_bytes::StoredBytes;
use crate::stream_reader::{StreamColumn, StreamReader};
use crate::{Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, axes};
use particlegs_core::{Error, Hint, Result};
use particlegs_particles::SnapshotReader;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnarField {
    pub name: String,
    /// Type as text.
    pub kind_name: String,
    /// Type where it can be read as numbers.
    pub kind: Option<NumberType>,
    pub big_endian: bool,
    pub components: u32,
    /// Index of the stretch that holds it.
    pub stored: usize,
    /// Byte of the content where the records begin.
    pub base: u64,
    /// Bytes from one component's records to the next one's.
    pub base_step: u64,
    /// Bytes of a record.
    pub stride: u64,
    /// Byte of the record.
    pub offset: u64,
    /// Bytes from one component to the next in the record.
    pub offset_step: u64,
}

impl ColumnarField {
    /// Interleaved little-endian numbers in records of `stride` bytes from byte `base` on.
    pub fn in_records(
        name: &str,
        kind: NumberType,
        components: u32,
        [base, stride, offset]: [u64; 3],
    ) -> ColumnarField {
        let (name, kind_name, offset_step) = (name.into(), kind.name().into(), kind.bytes());
        let field = ColumnarField { name, kind_name, kind: Some(kind), components, ..ColumnarField::default() };
        ColumnarField { base, stride, offset, offset_step, ..field }
    }

    pub fn described(&self) -> SpeciesField {
        SpeciesField::new(&self.name, &self.kind_name, self.components)
    }

    /// A component as a column; `None` where it is not a number or would lie beyond any file.
    pub fn column(&self, component: u32) -> Option<StreamColumn> {
        let at = |start: u64, step: u64| step.checked_mul(component.into()).and_then(|s| s.checked_add(start));
        let lane = StridedColumn {
            offset: at(self.offset, self.offset_step)?,
            stride: self.stride,
            kind: self.kind?,
            big_endian: self.big_endian,
        };
        let base = at(self.base, self.base_step)?;
        // Those who read the column add the two without a check.
        base.checked_add(lane.offset)?;
        Some(StreamColumn { stored: self.stored, base, lane })
    }
}

/// The one species of a file that has no others.
pub fn one_species(
    count: u64,
    fields: &[ColumnarField],
    positions: String,
    mass: impl Fn(&[SpeciesField]) -> Option<String>,
) -> Species {
    let fields: Vec<_> = fields.iter().map(ColumnarField::described).collect();
    let mass = mass(&fields).map_or(SpeciesMass::Unknown, SpeciesMass::Field);
    Species { name: "particles".into(), aliases: vec!["0".into()], count, mass, positions, fields }
}

/// Files of one species with such fields.
pub struct ColumnarSnapshot {
    pub description: Description,
    pub place: String,
    /// Stretches that the fields lie in.
    pub stored: Vec<StoredBytes>,
    /// The species' fields, in the description's order.
    pub fields: Vec<ColumnarField>,
    /// From the file's positions to world units.
    pub world: Affine,
}

impl ColumnarSnapshot {
    fn column(&self, field: &str, component: u32) -> Result<StreamColumn> {
        let columnar_field = self.fields.iter().find(|f| f.name == field);
        columnar_field.and_then(|f| f.column(component)).ok_or_else(|| {
            let kind = columnar_field.map_or("", |f| &f.kind_name);
            Error::input(&self.place, format!("field `{field}` of type {kind} cannot be read as numbers"))
        })
    }

    /// The columns where they lie uncompressed in one file.
    fn mapped(&self, columns: &[StreamColumn], rows: u64) -> Option<Result<StridedParticles>> {
        // All stretches are of one file: the bytes of the first serve for all.
        let bytes = self.stored[columns[0].stored].plain()?.0.clone();
        let mut lanes = Vec::new();
        for column in columns {
            let stored = &self.stored[column.stored];
            let (_, start) = stored.plain()?;
            let within = StridedColumn { offset: column.base + column.lane.offset, ..column.lane };
            if !within.fits(rows, stored.size() as usize) {
                let message = format!("the header says {rows} particles, but the data end early");
                return Some(Err(Error::input(&self.place, message)));
            }
            lanes.push(StridedColumn { offset: within.offset + start, ..within });
        }
        Some(StridedParticles::new(&self.place, bytes, rows, &lanes))
    }
}

impl Snapshot for ColumnarSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = self.description.species.get(species);
        let species = species.ok_or_else(|| Error::argument("the file has only one particle type"))?;
        if species.positions.is_empty() && choice.positions.is_none() {
            let vectors = species.fields.iter().filter(|f| f.components == 3);
            let names: Vec<&str> = vectors.map(|f| &f.name[..]).collect();
            let hint = Hint::from("choose with ").option("positions", "").words(format!(": {}", names.join(", ")));
            return Err(Error::input_with(&self.place, "it is not clear which field holds positions", hint));
        }
        let mut columns = Vec::new();
        for (k, component) in axes::columns(&self.place, species, choice)?.iter().enumerate() {
            let mut column = self.column(&component.field, component.component)?;
            column.lane.kind = column.lane.kind.stored(choice.as_stored && k < 3);
            columns.push(column);
        }
        let meta = self.description.meta_of(species);
        let world = if choice.as_stored { Affine::IDENTITY } else { self.world };
        match self.mapped(&columns, species.count) {
            Some(strided) => {
                let inner = strided?;
                let piece = world.moved(inner.is_wide(), Box::new(inner));
                Ok(Box::new(PieceReader::new(meta, vec![piece], columns.len() > 3)?))
            }
            None => {
                let stored = self.stored.clone();
                Ok(Box::new(StreamReader::new(meta, &self.place, stored, &columns, species.count, world)?))
            }
        }
    }
}
