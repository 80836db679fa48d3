//! Places of a data set's numbers: in one stretch of the file, in its description, or in chunks.

use super::container::{Container, broken, is_virtual};
use super::filters::Pipeline;
use super::packed::PackedNumber;
use crate::numbers::NumberType;
use hdf5_reader::Dataset;
use hdf5_reader::btree_v1::{BTreeV1Key, collect_btree_v1_leaves_storage};
use hdf5_reader::chunk_index::{
    ChunkEntry, collect_implicit_chunk_entries, collect_v2_chunk_entries_storage, single_chunk_entry,
};
use hdf5_reader::error::Error as Hdf5Error;
use hdf5_reader::extensible_array::collect_extensible_array_chunk_entries_storage;
use hdf5_reader::fixed_array::collect_fixed_array_chunk_entries_storage;
use hdf5_reader::io::Cursor;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::layout::{ChunkIndexing, DataLayout};
use particlegs_core::{Error, Result};

/// The largest chunk that is read, decoded. Larger ones would have to be held in memory whole.
const MAX_CHUNK: u64 = 1 << 30;

/// A data set of numbers in rows, and where they lie.
pub struct NumberTable {
    pub kind: NumberType,
    pub big_endian: bool,
    /// Layout of their bits, where they do not fill their bytes.
    pub packed: Option<PackedNumber>,
    pub rows: u64,
    pub components: u64,
    pub storage: DataSetStorage,
}

pub enum DataSetStorage {
    /// From this byte of the file, row after row; checked to end within it.
    Flat(u64),
    Compact(Vec<u8>),
    Chunked(Chunks),
}

pub struct Chunks {
    /// Rows of a chunk; the last one's may lie beyond the table's end.
    pub rows: u64,
    pub columns: u64,
    /// Chunks side by side.
    pub across: u64,
    /// Bytes of a chunk, decoded.
    pub bytes: usize,
    /// Numbers of a chunk: those of its frames before the one that is read, and whether it has others at all.
    pub before: u64,
    pub is_shared: bool,
    pub pipeline: Pipeline,
    /// Chunks, side by side first.
    pub places: Vec<ChunkLocation>,
}

impl Chunks {
    /// The first byte of chunks of whole rows that are not encoded and lie one after the other: such a table
    /// is one stretch of the file.
    fn stretch(&self, components: u64) -> Option<u64> {
        let first = self.places.first()?.offset;
        let next = |(i, p): (usize, &ChunkLocation)| {
            self.pipeline.is_plain(p.mask)
                && (i as u64).checked_mul(self.bytes as u64).is_some_and(|b| p.offset - first == b)
        };
        let ordered = self.places.windows(2).all(|w| w[0].offset < w[1].offset);
        (!self.is_shared && self.columns == components && ordered && self.places.iter().enumerate().all(next))
            .then_some(first)
    }
}

/// The place of a chunk in the file; checked to end within it.
pub struct ChunkLocation {
    pub offset: u64,
    pub size: u64,
    /// Bits of filters that were not applied.
    pub mask: u32,
}

/// Finds the numbers of `name` in a group: all of them, or those of a frame, which the first axis counts.
pub fn table(container: &Container, group: &str, name: &str, frame: Option<u64>) -> Result<NumberTable> {
    let place = format!("{}: {group}/{name}", container.place);
    let (set, data) = container.set(group, name)?;
    let Some((kind, big_endian)) = set.number else {
        let message = format!("the number type {} is not f32, f64 or an integer", set.kind);
        return Err(Error::input_with(&place, message, "write it as f32 or f64, with h5py: `data[:].astype('f4')`"));
    };
    let (rows, components) = match (frame, &set.shape[..]) {
        (None, []) => (1, 1),
        (None, &[rows]) => (rows, 1),
        (None, &[rows, components]) if components > 0 => (rows, components),
        (Some(frame), &[frames]) if frame < frames => (1, 1),
        (Some(frame), &[frames, rows]) if frame < frames => (rows, 1),
        (Some(frame), &[frames, rows, components]) if frame < frames && components > 0 => (rows, components),
        _ => return Err(Error::input(&place, format!("the shape {} is not that of a table", set.shape_text()))),
    };
    let numbers = rows.checked_mul(components).and_then(|n| n.checked_mul(kind.bytes()));
    let Some(bytes) = numbers.filter(|&n| n <= i64::MAX as u64) else {
        return Err(Error::input(&place, format!("the shape {} is too large", set.shape_text())));
    };
    let header = container.file.get_or_parse_header(data.address()).map_err(|e| broken(&place, &e))?;
    let mut layout = None;
    let mut filters = &[][..];
    for message in &header.messages {
        match message {
            HdfMessage::DataLayout(l) => layout = Some(&l.layout),
            HdfMessage::FilterPipeline(p) => filters = &p.filters,
            HdfMessage::ExternalFiles(_) => {
                let hint = "put it into one file with `h5repack -l CONTI in.hdf5 out.hdf5`";
                return Err(Error::input_with(&place, "the data are in external files, which are not supported", hint));
            }
            _ => {}
        }
    }
    let finder = Finder { container, data: &data, place: &place, shape: &set.shape, element: kind.bytes(), frame };
    let storage = match layout {
        None => return Err(Error::input(&place, "damaged HDF5 file: the data set has no layout")),
        Some(DataLayout::Compact { data }) => {
            let start = frame.unwrap_or(0).saturating_mul(bytes);
            // Frames lie one behind the other, `bytes` bytes each.
            let frame_slice = usize::try_from(start).ok().and_then(|start| data.get(start..)?.get(..bytes as usize));
            let frame_bytes =
                frame_slice.ok_or_else(|| finder.short(start.saturating_add(bytes), data.len() as u64))?;
            DataSetStorage::Compact(frame_bytes.to_vec())
        }
        Some(DataLayout::Contiguous { address, size }) => finder.flat(*address, *size, bytes)?,

        // A virtual layout comes as one of chunks (see [`is_virtual`]): it is asked for before those.
        Some(layout) if is_virtual(layout) => {
            let hint = "copy it with h5py: `new[name] = old[name][:]`";
            return Err(Error::input_with(&place, "nested virtual data sets are not supported", hint));
        }
        Some(DataLayout::Chunked { address, dims, chunk_indexing, .. }) => {
            let pipeline = Pipeline::new(filters, kind.bytes() as usize, &place)?;
            let chunks = finder.chunks(*address, dims, chunk_indexing.as_ref(), pipeline)?;
            // Plain chunks that follow each other are one stretch, which is read without decoding.
            chunks.stretch(components).map_or(DataSetStorage::Chunked(chunks), DataSetStorage::Flat)
        }
    };
    Ok(NumberTable { packed: set.packed, kind, big_endian, rows, components, storage })
}

struct Finder<'a> {
    container: &'a Container,
    data: &'a Dataset,
    place: &'a str,
    shape: &'a [u64],
    element: u64,
    frame: Option<u64>,
}

impl Finder<'_> {
    fn never_written(&self) -> Error {
        let hint = "the program that wrote the file stopped early, or wrote the data elsewhere";
        Error::input_with(self.place, "the data set was never written: it has a shape but no data", hint)
    }

    fn short(&self, wanted: u64, available: u64) -> Error {
        Error::input_with(self.place, format!("it needs {wanted} bytes but has {available}"), "copy the file again")
    }

    fn undefined(&self, address: u64) -> bool {
        Cursor::is_undefined_offset(address, self.container.file.superblock().offset_size)
    }

    /// An address of the container as a byte of the file, if `size` bytes from there are within it.
    fn within(&self, address: u64, size: u64) -> Option<u64> {
        let offset = self.container.file.superblock().base_address.checked_add(address)?;
        let end = offset.checked_add(size)?;
        (end <= self.container.map.len() as u64).then_some(offset)
    }

    fn flat(&self, address: u64, size: u64, wanted: u64) -> Result<DataSetStorage> {
        if wanted == 0 {
            return Ok(DataSetStorage::Compact(Vec::new()));
        }
        if self.undefined(address) {
            return Err(self.never_written());
        }
        let before = self.frame.unwrap_or(0).checked_mul(wanted);
        let Some((before, end)) = before.and_then(|before| Some((before, before.checked_add(wanted)?))) else {
            return Err(self.short(u64::MAX, size));
        };
        if size < end {
            return Err(self.short(end, size));
        }
        let Some(offset) = self.within(address, end) else {
            let left = (self.container.map.len() as u64).saturating_sub(address);
            return Err(self.short(end, left));
        };
        Ok(DataSetStorage::Flat(offset + before))
    }

    fn chunks(
        &self,
        address: u64,
        dims: &[u32],
        indexing: Option<&ChunkIndexing>,
        pipeline: Pipeline,
    ) -> Result<Chunks> {
        let rank = self.shape.len();
        // A last dimension, the number's size, is kept by some versions of the layout.
        let dims = dims.get(..rank).filter(|d| dims.len() <= rank + 1 && d.iter().all(|&n| n > 0));
        let Some(dims) = dims else {
            return Err(Error::input(self.place, "damaged HDF5 file: no chunk shape"));
        };
        let lead = self.lead();
        let along = |k: usize| dims.get(k).map_or(1, |&n| u64::from(n));
        let (frames, rows, columns) = (if lead == 1 { along(0) } else { 1 }, along(lead), along(lead + 1));
        let components = self.shape.get(lead + 1).copied().unwrap_or(1);
        let numbers = rows.checked_mul(columns);
        let all = numbers.and_then(|n| n.checked_mul(frames)).and_then(|n| n.checked_mul(self.element));
        let bytes = all.filter(|&n| n <= MAX_CHUNK);
        let Some(bytes) = bytes else {
            let message = format!("chunks of {rows} x {columns} numbers are larger than {} MiB each", MAX_CHUNK >> 20);
            let hint = "write smaller ones: `h5repack -l CHUNK=65536x3 in.hdf5 out.hdf5`";
            return Err(Error::input_with(self.place, message, hint));
        };
        let across = components.div_ceil(columns);
        let count = self.rows().div_ceil(rows).checked_mul(across);
        let before = self.frame.unwrap_or(0) % frames * rows * columns;
        let (bytes, is_shared, places) = (bytes as usize, frames > 1, Vec::new());
        let chunks = Chunks { rows, columns, across, bytes, before, is_shared, pipeline, places };
        // An empty table has no index and lacks nothing.
        if count == Some(0) {
            return Ok(chunks);
        }
        if self.undefined(address) {
            return Err(self.never_written());
        }
        let entries = self.entries(address, dims, indexing).map_err(|e| broken(self.place, &e))?;
        if entries.is_empty() {
            return Err(self.never_written());
        }
        // Only those of the frame; what is left of their offsets is that of its table.
        let first = |entry: &ChunkEntry| entry.offsets.first().copied().unwrap_or(0);
        let mut entries = entries;
        if let Some(frame) = self.frame {
            entries.retain(|entry| first(entry) == frame / frames * frames);
            entries.iter_mut().for_each(|entry| drop(entry.offsets.drain(..1.min(entry.offsets.len()))));
        }
        Ok(Chunks { places: self.sorted(entries, &chunks, count)?, ..chunks })
    }

    /// Axes before those of the table.
    fn lead(&self) -> usize {
        usize::from(self.frame.is_some())
    }

    fn rows(&self) -> u64 {
        self.shape.get(self.lead()).copied().unwrap_or(1)
    }

    fn entries(
        &self,
        address: u64,
        dims: &[u32],
        indexing: Option<&ChunkIndexing>,
    ) -> hdf5_reader::error::Result<Vec<ChunkEntry>> {
        let file = &self.container.file;
        let storage = file.storage();
        let (offsets, lengths) = (file.superblock().offset_size, file.superblock().length_size);
        let rank = dims.len();
        match indexing {
            // Layouts before version 4 name no kind of index: theirs is a B-tree of version 1.
            None => {
                let leaves =
                    collect_btree_v1_leaves_storage(storage, address, offsets, lengths, Some(rank as u32), dims, None)?;
                let entry = |(key, address): (BTreeV1Key, u64)| match key {
                    BTreeV1Key::RawData { chunk_size, filter_mask, mut offsets } => {
                        // Its keys have one offset more, that within an element.
                        offsets.truncate(rank);
                        Ok(ChunkEntry { address, size: u64::from(chunk_size), filter_mask, offsets })
                    }
                    BTreeV1Key::Group { .. } => Err(Hdf5Error::InvalidData("the chunk index is a group tree".into())),
                };
                leaves.into_iter().map(entry).collect()
            }
            Some(ChunkIndexing::SingleChunk { filtered_size, filters }) => {
                Ok(vec![single_chunk_entry(address, *filtered_size, *filters, rank)])
            }
            Some(ChunkIndexing::Implicit) => collect_implicit_chunk_entries(
                address,
                self.shape,
                dims,
                self.element as usize,
                None,
                self.container.map.len() as u64,
            ),
            Some(ChunkIndexing::FixedArray { .. }) => {
                collect_fixed_array_chunk_entries_storage(storage, address, offsets, lengths, self.shape, dims, None)
            }
            Some(ChunkIndexing::ExtensibleArray { .. }) => collect_extensible_array_chunk_entries_storage(
                storage,
                address,
                offsets,
                lengths,
                self.shape,
                self.data.max_dims(),
                dims,
                None,
            ),
            Some(ChunkIndexing::BTreeV2) => {
                collect_v2_chunk_entries_storage(storage, address, offsets, lengths, rank as u32, dims, None)
            }
        }
    }

    /// Places of `count` chunks in order, each there once and within the file; those beyond the table's end are
    /// left over from when it was longer.
    fn sorted(&self, entries: Vec<ChunkEntry>, chunks: &Chunks, count: Option<u64>) -> Result<Vec<ChunkLocation>> {
        let &Chunks { rows, columns, across, .. } = chunks;
        let bytes = chunks.bytes as u64;
        let mut places: Vec<(u64, ChunkLocation)> = Vec::with_capacity(entries.len());
        for entry in &entries {
            let at = |k: usize| entry.offsets.get(k).copied().unwrap_or(0);
            let beyond = self.shape.get(self.lead() + 1).is_some_and(|&n| at(1) >= n);
            if at(0) >= self.rows() || beyond || self.undefined(entry.address) {
                continue;
            }
            if !at(0).is_multiple_of(rows) || !at(1).is_multiple_of(columns) {
                return Err(Error::input(self.place, "damaged HDF5 file: a chunk overlaps others"));
            }
            let plain = chunks.pipeline.is_plain(entry.filter_mask);
            let size = if plain { bytes } else { entry.size };
            // Some kinds of index state no size of plain chunks.
            if plain && entry.size != 0 && entry.size != bytes {
                return Err(self.short(bytes, entry.size));
            }
            let Some(offset) = self.within(entry.address, size) else {
                let message = format!("the chunk at row {} ends beyond the file", at(0));
                return Err(Error::input_with(self.place, message, "the file is cut short: copy it again"));
            };
            // Chunks are numbered in the table's order: a gap or a repeat shows once they are sorted.
            let index = at(0) / rows * across + at(1) / columns;
            places.push((index, ChunkLocation { offset, size, mask: entry.filter_mask }));
        }
        places.sort_by_key(|p| p.0);
        if let Some(i) = (0..places.len()).find(|&i| places[i].0 != i as u64) {
            if i > 0 && places[i].0 == places[i - 1].0 {
                return Err(Error::input(self.place, "damaged HDF5 file: a chunk is listed twice"));
            }
            return Err(self.hole(i as u64 / across * rows));
        }
        if Some(places.len() as u64) != count {
            return Err(self.hole(places.len() as u64 / across * rows));
        }
        Ok(places.into_iter().map(|p| p.1).collect())
    }

    fn hole(&self, row: u64) -> Error {
        let message = format!("rows from {row} on were never written, of {}", self.rows());
        Error::input_with(self.place, message, "the program that wrote the file stopped early")
    }
}
