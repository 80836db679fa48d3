//! ASDF files (<https://www.asdf-format.org>) of Abacus: `pack9` and `rvint` with positions and velocities, or arrays of
//! numbers, one row a particle, in `data` or at the top.

mod abacus;
mod blocks;
mod slabs;
mod tree;

use crate::columns::one_species;
use crate::compression::refuse;
use crate::npy::layout::{mass_named, positions_named};
use crate::numbers::{Bytes, NumberType, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, PieceReader, RowBuffer};
use crate::single_file::named;
use crate::{Choice, Description, Format, Snapshot, SpeciesField, SpeciesMass, TextResult, axes};
use abacus::{AbacusHeader, PACK9, Pack9};
use blocks::{AsdfBlock, AsdfBlockHeader};
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use tree::TreeValue;

pub const FORMAT: Format = Format {
    name: "asdf",
    title: "ASDF file (Abacus)",
    detect: |head| head.begins(&[b"#ASDF "]),
    open: |paths, choice| Ok(Box::new(AsdfSnapshot::open(paths, choice)?)),
};

/// Longest tree that is read: those of Abacus have some kilobytes.
const MOST_TREE: usize = 1 << 20;
const HINT: &str = "the file is damaged or cut short: copy it again";

/// An array of numbers, one row a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AsdfArray {
    source: usize,
    /// Those of the first component.
    lane: StridedColumn,
    rows: u64,
    components: u32,
    /// Bytes from one component to the next.
    step: u64,
}

impl AsdfArray {
    /// `None` for what is no array of numbers in one or two dimensions.
    fn read(value: &TreeValue, blocks: &[AsdfBlockHeader]) -> TextResult<Option<AsdfArray>> {
        let key = |key: &str| value.get(key);
        let wholes = |value: &TreeValue| value.list()?.iter().map(TreeValue::whole).collect::<Option<Vec<u64>>>();
        let kind = key("datatype").and_then(TreeValue::text).and_then(number_type);
        let (Some(source), Some(kind), Some(shape)) = (key("source"), kind, key("shape").and_then(wholes)) else {
            return Ok(None);
        };
        let (rows, columns) = match shape[..] {
            [rows] => (rows, 1),
            [rows, columns] => (rows, columns),
            _ => return Ok(None),
        };
        let Some(source) = source.whole() else { return Err("its numbers lie in another file".into()) };
        let strides = match key("strides") {
            None => Some(vec![columns.saturating_mul(kind.bytes()), kind.bytes()]),
            Some(strides) => wholes(strides),
        };
        let strides = strides
            .filter(|s| s.len() >= shape.len() && s[0] >= kind.bytes())
            .ok_or("its strides are not supported")?;
        let big_endian = key("byteorder").and_then(TreeValue::text) == Some("big");
        let offset = key("offset").map_or(Some(0), TreeValue::whole).ok_or("its offset is damaged")?;
        let components = u32::try_from(columns).map_err(|_| "it has too many columns")?;
        let step = if shape.len() == 1 { 0 } else { strides[1] };
        let lane = StridedColumn { offset, stride: strides[0], kind, big_endian };
        let array = AsdfArray { source: usize::try_from(source).unwrap_or(usize::MAX), lane, rows, components, step };
        let block = blocks.get(array.source).ok_or_else(|| format!("there is no block {source}"))?;
        let last = array.lane(components.saturating_sub(1));
        if !last.is_some_and(|lane| lane.fits(rows, usize::try_from(block.size).unwrap_or(usize::MAX))) {
            return Err(format!(
                "{rows} rows of {columns} numbers end beyond the {} bytes of block {source}",
                block.size
            ));
        }
        Ok(Some(array))
    }

    /// The byte of the block behind its last number.
    fn end(&self) -> Option<u64> {
        let rows = self.rows.saturating_sub(1).checked_mul(self.lane.stride)?;
        let last = self.lane(self.components.saturating_sub(1))?;
        rows.checked_add(last.offset)?.checked_add(last.kind.bytes())
    }

    fn lane(&self, component: u32) -> Option<StridedColumn> {
        let offset = self.step.checked_mul(component.into())?.checked_add(self.lane.offset)?;
        Some(StridedColumn { offset, ..self.lane })
    }
}

fn number_type(name: &str) -> Option<NumberType> {
    Some(match name {
        "float16" => NumberType::F16,
        "float32" => NumberType::F32,
        "float64" => NumberType::F64,
        "int8" => NumberType::I8,
        "int16" => NumberType::I16,
        "int32" => NumberType::I32,
        "int64" => NumberType::I64,
        "uint8" => NumberType::U8,
        "uint16" => NumberType::U16,
        "uint32" => NumberType::U32,
        "uint64" => NumberType::U64,
        _ => return None,
    })
}

/// The source of a field's numbers.
#[derive(Clone)]
enum AsdfSource {
    Array(AsdfArray),
    /// Positions, or velocities.
    Rvint(AsdfArray, bool),
    Pack9(Arc<Pack9>, bool),
}

struct AsdfField {
    described: SpeciesField,
    source: AsdfSource,
}

/// A file, its header read.
struct AsdfFile {
    path: PathBuf,
    bytes: Bytes,
    headers: Vec<AsdfBlockHeader>,
    /// Those that were used.
    blocks: Vec<Mutex<Option<Arc<AsdfBlock>>>>,
    /// Files that share the memory for what is decompressed.
    sharers: usize,
    abacus: AbacusHeader,
    /// Name of the packed array of positions, where there is one.
    packed: Option<&'static str>,
    arrays: Vec<(String, AsdfArray)>,
}

impl AsdfFile {
    fn open(path: &Path) -> Result<AsdfFile> {
        refuse(path, FORMAT.title)?;
        let bytes = Bytes::from_filled_file(path)?;
        let fault = |message: String| Error::input_with(path, message, HINT);
        let head = &bytes[..bytes.len().min(MOST_TREE)];
        let end = [&b"\n...\n"[..], b"\n...\r\n"].iter().filter_map(|end| memchr::memmem::find(head, end)).min();
        let end = end.ok_or_else(|| fault(format!("its tree has no end within {} bytes", head.len())))?;
        let tree = tree::parse(&head[..end + 1]).map_err(fault)?;
        let headers = blocks::headers(&bytes, end).map_err(fault)?;
        let (mut arrays, mut packed) = (Vec::new(), None);
        let data = tree.get("data").filter(|data| matches!(data, TreeValue::Map(_))).unwrap_or(&tree);
        if let TreeValue::Map(entries) = data {
            for (name, value) in entries {
                let array =
                    AsdfArray::read(value, &headers).map_err(|message| fault(format!("array {name}: {message}")))?;
                arrays.extend(array.map(|array| (name.clone(), array)));
            }
        }
        for (name, columns, is_kind) in PACKED {
            let Some((_, array)) = arrays.iter().find(|a| a.0 == name) else { continue };
            if packed.replace(name).is_some() {
                return Err(Error::input(path, "it has positions both in pack9 and in rvint"));
            }
            let packed = array.components == columns && (columns == 3 || array.lane.stride == PACK9 && array.step == 1);
            if !packed || !is_kind(array.lane.kind) {
                return Err(fault(format!("array {name} has not the type and shape of Abacus's {name}")));
            }
        }
        let blocks = headers.iter().map(|_| Mutex::default()).collect();
        let abacus = tree.get("header").map(AbacusHeader::read).unwrap_or_default();
        Ok(AsdfFile { path: path.into(), bytes, headers, blocks, sharers: 1, abacus, packed, arrays })
    }

    fn block(&self, number: usize) -> Result<Arc<AsdfBlock>> {
        // The lock is held while the block is decompressed, so that two readers do not do it twice.
        let mut slot = self.blocks[number].lock().unwrap_or_else(|e| e.into_inner());
        if let Some(block) = &*slot {
            return Ok(block.clone());
        }
        let block_arrays = self.arrays.iter().map(|(_, array)| array).filter(|array| array.source == number);
        let needed = block_arrays.filter_map(AsdfArray::end).max().unwrap_or(0);
        let block = AsdfBlock::open(&self.path, &self.bytes, (number, needed), &self.headers[number], self.sharers)?;
        Ok(slot.insert(Arc::new(block)).clone())
    }

    fn required(&self, value: Option<f64>, name: &str) -> Result<f64> {
        let missing = || Error::input_with(&self.path, format!("its header has no {name}, a number above 0"), HINT);
        value.ok_or_else(missing)
    }

    /// Particles, and their fields.
    fn particles(&self) -> Result<(u64, Vec<AsdfField>)> {
        let abacus = &self.abacus;
        let both = |source: &dyn Fn(bool) -> AsdfSource| {
            [("pos", None, false), ("vel", Some("km/s"), true)].map(|(name, unit, is_velocity)| AsdfField {
                described: SpeciesField { unit: unit.map(String::from), ..SpeciesField::new(name, "f32", 3) },
                source: source(is_velocity),
            })
        };
        let packed = self.packed.and_then(|name| self.arrays.iter().find(|a| a.0 == name));
        let (rows, mut fields) = match packed {
            Some((name, array)) if name == "pack9" => {
                let box_size = self.required(abacus.box_size, "BoxSize")?;
                let velocity = self.required(abacus.velocity, "VelZSpace_to_kms")?;
                let block = self.block(array.source)?;
                let pack = Arc::new(Pack9::open(block, array.lane.offset, array.rows, box_size, velocity)?);
                (pack.particles(), Vec::from(both(&|is_velocity| AsdfSource::Pack9(pack.clone(), is_velocity))))
            }
            Some((_, array)) => {
                self.required(abacus.box_size, "BoxSize")?;
                (array.rows, Vec::from(both(&|is_velocity| AsdfSource::Rvint(*array, is_velocity))))
            }
            None => (self.rows(), Vec::new()),
        };
        let others = self.arrays.iter().filter(|(name, array)| {
            array.rows == rows && Some(&name[..]) != self.packed && fields.iter().all(|f| f.described.name != *name)
        });
        let others = others.map(|(name, array)| AsdfField {
            described: SpeciesField::new(name, array.lane.kind.name(), array.components),
            source: AsdfSource::Array(*array),
        });
        let others: Vec<AsdfField> = others.collect();
        fields.extend(others);
        Ok((rows, fields))
    }

    /// Rows of the arrays of positions, else of the first array.
    fn rows(&self) -> u64 {
        let described = |(name, array): &(String, AsdfArray)| SpeciesField::new(name, "", array.components);
        let fields: Vec<SpeciesField> = self.arrays.iter().map(described).collect();
        let positions = positions_named(&fields);
        let first = positions.as_deref().and_then(|names| names.split(',').next());
        let array = first.and_then(|first| self.arrays.iter().find(|a| a.0 == first)).or(self.arrays.first());
        array.map_or(0, |a| a.1.rows)
    }
}

/// Arrays of Abacus with positions and velocities: names, columns, and whether a type is theirs.
const PACKED: [(&str, u32, fn(NumberType) -> bool); 2] = [
    ("pack9", PACK9 as u32, |kind| matches!(kind, NumberType::I8 | NumberType::U8)),
    ("rvint", 3, |kind| kind == NumberType::I32),
];

/// A file with its particles.
struct AsdfPart {
    file: AsdfFile,
    rows: u64,
    fields: Vec<AsdfField>,
}

struct AsdfSnapshot {
    description: Description,
    parts: Vec<AsdfPart>,
}

impl AsdfSnapshot {
    fn open(paths: &[PathBuf], choice: &Choice) -> Result<AsdfSnapshot> {
        let files = slabs::open(paths)?;
        let sharers = files.len();
        let part = |file: AsdfFile| {
            let file = AsdfFile { sharers, ..file };
            let (rows, fields) = file.particles()?;
            Ok(AsdfPart { file, rows, fields })
        };
        let mut parts: Vec<AsdfPart> = files.into_iter().map(part).collect::<Result<_>>()?;
        let described = |part: &AsdfPart| part.fields.iter().map(|f| f.described.clone()).collect::<Vec<_>>();
        let all: Vec<Vec<SpeciesField>> = parts.iter().map(described).collect();
        let (path, abacus) = (paths[0].clone(), parts[0].file.abacus.clone());
        // A field is read through all files: one that a file lacks cannot be offered.
        parts[0].fields.retain(|f| all.iter().all(|fields| fields.contains(&f.described)));
        let count = parts.iter().try_fold(0u64, |sum, p| sum.checked_add(p.rows));
        let count = count.ok_or_else(|| Error::input(&path, "too many particles to count"))?;
        if count == 0 {
            return Err(Error::input(&path, "it holds no particles"));
        }
        let fields: Vec<SpeciesField> = parts[0].fields.iter().map(|f| f.described.clone()).collect();
        let positions = positions_named(&fields);
        if positions.is_none() && choice.positions.is_none() {
            let names = fields.iter().map(|f| &f.name[..]).collect::<Vec<_>>().join(", ");
            let message = format!("it has no positions (pack9, rvint, pos or x, y, z); its arrays are: {names}");
            return Err(Error::input_with(&path, message, "name the file with positions, such as field_rv_A_000.asdf"));
        }
        let (mut meta, mut notes) = (named(&path), Vec::new());
        // Arrays by other names need not be in the unit of the box: those of haloes have a box of length 1.
        if positions.is_some() && choice.positions.is_none() || parts[0].file.packed.is_some() {
            abacus.complete(&mut meta, &mut notes);
        }
        if let Some(all) = abacus.particles.filter(|&all| all > count) {
            notes.push(format!("it has {count} of the simulation's {all} particles"));
        }
        let mut species = one_species(count, &[], positions.unwrap_or_default(), |_| None);
        species.mass = match (mass_named(&fields), abacus.particle_mass) {
            (Some(name), _) => SpeciesMass::Field(name),
            (None, Some(mass)) => SpeciesMass::Each(mass),
            _ => SpeciesMass::Unknown,
        };
        species.fields = fields;
        let packed = parts[0].file.packed.map(|name| format!(", Abacus's {name}")).unwrap_or_default();
        let files: Vec<_> = parts.iter().map(|p| p.file.path.clone()).collect();
        let format = format!("ASDF{packed}");
        let description = Description { species: vec![species], notes, ..Description::new(format, &files, meta) };
        Ok(AsdfSnapshot { description, parts })
    }
}

impl Snapshot for AsdfSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = self.description.species.get(species);
        let species = species.ok_or_else(|| Error::argument("the file has only one particle type"))?;
        let place = self.parts[0].file.path.display().to_string();
        let columns = axes::columns(&place, species, choice)?;
        let mut pieces: Vec<Box<dyn ParticlePiece>> = Vec::new();
        for part in &self.parts {
            let column = |(k, column): (usize, &axes::FieldComponent)| {
                let field = part.fields.iter().find(|f| f.described.name == column.field);
                let missing = || Error::input(&part.file.path, format!("there is no array {}", column.field));
                part.file.column(&field.ok_or_else(missing)?.source, column.component, choice.as_stored && k < 3)
            };
            let columns = columns.iter().enumerate().map(column).collect::<Result<Vec<AsdfColumn>>>()?;
            pieces.push(piece(&part.file.path, part.rows, columns)?);
        }
        let meta: SnapshotMeta = self.description.meta_of(species);
        Ok(Box::new(PieceReader::new(meta, pieces, columns.len() > 3)?))
    }

    /// Velocities of Abacus are peculiar ones in km/s.
    fn attributes(&self, _: usize, field: &str) -> Vec<(String, f64)> {
        let is_own = field == "vel" && self.parts[0].file.packed.is_some();
        let all = [("a_scaling", 0.0), ("h_scaling", 0.0), ("to_cgs", 1e5)];
        all.into_iter().filter(|_| is_own).map(|(name, value)| (name.into(), value)).collect()
    }
}

/// A column that is read.
enum AsdfColumn {
    Numbers(Arc<AsdfBlock>, StridedColumn),
    /// The length of the box, for positions.
    Rvint(Arc<AsdfBlock>, StridedColumn, Option<f64>),
    Pack9(Arc<Pack9>, usize),
}

impl AsdfFile {
    fn column(&self, source: &AsdfSource, component: u32, as_stored: bool) -> Result<AsdfColumn> {
        let lane = |array: &AsdfArray| {
            let lane =
                array.lane(component).ok_or_else(|| Error::input_with(&self.path, "an array is too long", HINT))?;
            Ok((self.block(array.source)?, StridedColumn { kind: lane.kind.stored(as_stored), ..lane }))
        };
        Ok(match source {
            AsdfSource::Array(array) => lane(array).map(|(block, lane)| AsdfColumn::Numbers(block, lane))?,
            AsdfSource::Rvint(array, is_velocity) => {
                let (block, lane) = lane(array)?;
                AsdfColumn::Rvint(block, lane, self.abacus.box_size.filter(|_| !is_velocity))
            }
            AsdfSource::Pack9(pack, is_velocity) => {
                AsdfColumn::Pack9(pack.clone(), component as usize + 3 * usize::from(*is_velocity))
            }
        })
    }
}

/// Columns where they lie uncompressed in the file, or unpacked as they are read.
fn piece(path: &Path, rows: u64, columns: Vec<AsdfColumn>) -> Result<Box<dyn ParticlePiece>> {
    let plain = |column: &AsdfColumn| match column {
        AsdfColumn::Numbers(block, lane) => {
            // All columns must lie in the same bytes: mapped blocks do, decompressed ones have bytes of their own.
            let (bytes, start) = block.plain().filter(|plain| matches!(plain.0, Bytes::Mapped(_)))?;
            Some((bytes.clone(), StridedColumn { offset: lane.offset + start, ..*lane }))
        }
        _ => None,
    };
    match columns.iter().map(plain).collect::<Option<Vec<_>>>() {
        Some(plain) => {
            let lanes: Vec<StridedColumn> = plain.iter().map(|p| p.1).collect();
            let bytes = plain[0].0.clone();
            Ok(Box::new(StridedParticles::new(&path.display().to_string(), bytes, rows, &lanes)?))
        }
        None => Ok(Box::new(AsdfPiece { rows, columns })),
    }
}

struct AsdfPiece {
    rows: u64,
    columns: Vec<AsdfColumn>,
}

impl ParticlePiece for AsdfPiece {
    fn rows(&self) -> u64 {
        self.rows
    }

    fn is_wide(&self) -> bool {
        // Packed positions become f32 as they are unpacked.
        self.columns.iter().take(3).any(|c| matches!(c, AsdfColumn::Numbers(_, lane) if lane.kind.is_wide()))
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        for (index, column) in self.columns.iter().enumerate() {
            let out = out.column(index);
            match column {
                AsdfColumn::Numbers(block, lane) => append(block, lane, rows.clone(), out)?,
                AsdfColumn::Rvint(block, lane, box_size) => {
                    let start = out.len();
                    append(block, lane, rows.clone(), out)?;
                    out[start..].iter_mut().for_each(|v| *v = abacus::unpack_rvint(*v, *box_size));
                }
                AsdfColumn::Pack9(pack, component) => pack.append(rows.clone(), *component, out)?,
            }
        }
        Ok(())
    }
}

/// Appends rows of a lane, which the block holds.
fn append(block: &AsdfBlock, lane: &StridedColumn, rows: Range<u64>, out: &mut Vec<f64>) -> Result<()> {
    let mut row = rows.start;
    while row < rows.end {
        let end = rows.end.min(row.saturating_add(blocks::rows_at_once(lane.stride)));
        let start = lane.offset + row * lane.stride;
        // The last row need not have a whole stride behind it.
        let bytes = block.read(start..start + (end - 1 - row) * lane.stride + lane.kind.bytes())?;
        StridedColumn { offset: 0, ..*lane }.append(&bytes, 0..end - row, out);
        row = end;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
