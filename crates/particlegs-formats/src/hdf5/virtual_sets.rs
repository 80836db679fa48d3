//! Virtual data sets: their rows lie in data sets of other files.

use super::container::{Container, DataSet, TOP, broken, is_virtual};
use hdf5_reader::error::Result as Hdf5Result;
use hdf5_reader::global_heap::GlobalHeapCollection;
use hdf5_reader::io::Cursor;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::layout::DataLayout;
use particlegs_core::{Error, Result};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The largest list of sources that is read; thousands of files need less than 1 MiB.
const MAX_LIST: u64 = 4 << 20;

/// Rows of a virtual data set that lie in one data set of another file.
pub struct VirtualExtent {
    pub rows: Range<u64>,
    pub source: VirtualSource,
    /// Rows and numbers of a row there; `None` for all.
    pub there: Option<[Range<u64>; 2]>,
}

#[derive(Clone)]
pub struct VirtualSource {
    pub file: Arc<Path>,
    set: Arc<str>,
}

impl VirtualSource {
    /// The data set's group, and its name there.
    pub fn name(&self) -> [&str; 2] {
        let set = self.set.trim_start_matches('/');
        set.rsplit_once('/').map_or([TOP, set], |(group, name)| [group, name])
    }
}

/// The extents of a virtual data set's rows, in order and without gaps; `None` for one that is not virtual.
pub fn extents(container: &Container, group: &str, set: &DataSet) -> Result<Option<Vec<VirtualExtent>>> {
    let place = format!("{}: {group}/{}", container.place, set.name);
    let file = &container.file;
    let (_, data) = container.set(group, &set.name)?;
    let header = file.get_or_parse_header(data.address()).map_err(|e| broken(&place, &e))?;
    let layout = header.messages.iter().find_map(|message| match message {
        HdfMessage::DataLayout(l) if is_virtual(&l.layout) => Some(&l.layout),
        _ => None,
    });
    let Some(DataLayout::Chunked { address, .. }) = layout else { return Ok(None) };
    // The rewritten layout's address is that of the heap and, in the last 16 bits, the number of its object.
    let list = list(container, address >> 16, (address & 0xffff) as u16).map_err(|e| broken(&place, &e))?;
    let Some(list) = list else {
        return Err(Error::input(&place, "damaged HDF5 file: no list of sources"));
    };
    let lengths = file.superblock().length_size;
    let mut extents = Entries { place: &place, path: &container.path, set, lengths }.read(&list)?;
    extents.sort_by_key(|e| e.rows.start);
    let mut end = 0;
    let rows = set.shape.first().copied().unwrap_or(0);
    if extents.iter().any(|e| e.rows.end > rows) {
        return Err(Error::input_with(&place, "the sources of this virtual data set have more rows than it has", COPY));
    }
    // The empty range at the end shows rows that no source provides behind the last one.
    for next in extents.iter().map(|e| e.rows.clone()).chain(std::iter::once(rows..rows)) {
        if next.start != end {
            let message = match next.start < end {
                true => format!("two sources provide row {}", next.start),
                false => format!("rows {end} to {} have no source", next.start - 1),
            };
            return Err(Error::input_with(&place, format!("invalid virtual data set: {message}"), COPY));
        }
        end = next.end;
    }
    Ok(Some(extents))
}

/// The hint where a virtual data set is of a kind that is not read.
const COPY: &str = "copy it with h5py: `new[name] = old[name][:]`, or name its source files";

/// An object of a global heap.
fn list(container: &Container, address: u64, index: u16) -> Hdf5Result<Option<Vec<u8>>> {
    let (storage, block) = (container.file.storage(), container.file.superblock());
    let lengths = usize::from(block.length_size);
    let start = storage.read_range(address, 8 + lengths)?;
    // The heap's own size is looked at before the heap is read whole.
    if Cursor::new(&start[8..]).read_length(block.length_size)? > MAX_LIST {
        return Ok(None);
    }
    let heap = GlobalHeapCollection::parse_at_storage(storage, address, block.offset_size, block.length_size)?;
    Ok(heap.get_object(index).map(|object| object.data.clone()))
}

struct Entries<'a> {
    place: &'a str,
    path: &'a Path,
    set: &'a DataSet,
    lengths: u8,
}

enum ElementSelection {
    None,
    All,
    Block(Vec<Range<u64>>),
    Other(&'static str),
}

impl Entries<'_> {
    fn read(&self, list: &[u8]) -> Result<Vec<VirtualExtent>> {
        let cursor = &mut Cursor::new(list);
        let failed = |e| broken(self.place, &e);
        let version = cursor.read_u8().map_err(failed)?;
        if version > 1 {
            return Err(self.refused("its list has a newer HDF5 version"));
        }
        let count = cursor.read_length(self.lengths).map_err(failed)?;
        let mut extents = Vec::new();
        let mut sources: Vec<VirtualSource> = Vec::new();
        for _ in 0..count {
            let source = self.source(cursor, version, &sources)?;
            sources.push(source.clone());
            // The selection in the source stands before that in the virtual data set.
            let source_block = match selection(cursor).map_err(failed)? {
                ElementSelection::None => Some([0..0, 0..0]),
                ElementSelection::All => None,
                ElementSelection::Other(message) => return Err(self.refused(message)),
                ElementSelection::Block(axes) => Some(self.table(axes)?),
            };
            let rows = match selection(cursor).map_err(failed)? {
                ElementSelection::None => 0..0,
                ElementSelection::All => 0..self.set.shape.first().copied().unwrap_or(0),
                ElementSelection::Other(message) => return Err(self.refused(message)),
                ElementSelection::Block(axes) => self.rows(axes)?,
            };
            if !rows.is_empty() {
                extents.push(VirtualExtent { rows, source, there: source_block });
            }
        }
        Ok(extents)
    }

    /// A source; since version 1, names may be those of an earlier one, or this file's.
    fn source(&self, cursor: &mut Cursor<'_>, version: u8, earlier: &[VirtualSource]) -> Result<VirtualSource> {
        let failed = |e| broken(self.place, &e);
        let flags = if version == 0 { 0 } else { cursor.read_u8().map_err(failed)? };
        let shared = |cursor: &mut Cursor<'_>| {
            let at = usize::try_from(cursor.read_length(self.lengths).map_err(failed)?).unwrap_or(usize::MAX);
            let known = earlier.get(at);
            known.ok_or_else(|| {
                Error::input(self.place, "damaged HDF5 file: a source refers to a name that does not exist")
            })
        };
        // Bit 0: the file is that of an earlier source. Bit 1: so is the name. Bit 2: it is this file.
        let file = match flags & 5 {
            0 => self.file(&cursor.read_null_terminated_string().map_err(failed)?)?.into(),
            1 => shared(cursor)?.file.clone(),
            _ => self.path.into(),
        };
        let set = match flags & 2 {
            0 => cursor.read_null_terminated_string().map_err(failed)?.into(),
            _ => shared(cursor)?.set.clone(),
        };
        Ok(VirtualSource { file, set })
    }

    fn refused(&self, message: &str) -> Error {
        Error::input_with(self.place, format!("unsupported virtual data set: {message}"), COPY)
    }

    /// A block of a table: rows, and numbers of a row.
    fn table(&self, axes: Vec<Range<u64>>) -> Result<[Range<u64>; 2]> {
        let mut axes = axes.into_iter();
        match (axes.next(), axes.next(), axes.next()) {
            (Some(rows), columns, None) => Ok([rows, columns.unwrap_or(0..1)]),
            _ => Err(self.refused("its sources are not tables")),
        }
    }

    fn rows(&self, axes: Vec<Range<u64>>) -> Result<Range<u64>> {
        let [rows, columns] = self.table(axes)?;
        match columns == (0..self.set.components()) {
            true => Ok(rows),
            false => Err(self.refused("a row is split over several sources")),
        }
    }

    /// A source's file: in this file's folder, or below it.
    fn file(&self, name: &str) -> Result<PathBuf> {
        if name == "." {
            return Ok(self.path.to_path_buf());
        }
        if name.replace("%%", "").contains('%') {
            return Err(self.refused("its source files are named by a pattern with %b"));
        }
        let (named, folder) = (name.replace("%%", "%"), self.path.parent().unwrap_or(Path::new("")));
        let shown: String = named.chars().map(|c| if c.is_control() { ' ' } else { c }).take(200).collect();
        let (named, stated) = (Path::new(&named), folder.join(&named));
        let inside =
            named.components().all(|c| matches!(c, std::path::Component::Normal(_) | std::path::Component::CurDir));
        // HDF5, too, looks beside the file for what is not where the path says.
        let path = if inside { stated.clone() } else { folder.join(named.file_name().unwrap_or_default()) };
        let same = |p: PathBuf| path.canonicalize().is_ok_and(|beside| beside == p);
        if !inside && (!path.is_file() || !stated.canonicalize().map_or(true, same)) {
            let message = format!("a source of this virtual data set is in another folder: {shown}");
            return Err(Error::input_with(self.place, message, "put the source beside this file"));
        }
        if !path.is_file() {
            let message =
                format!("a source file of this virtual data set is missing: {}", folder.join(shown).display());
            return Err(Error::input_with(self.place, message, "put the source file there"));
        }
        Ok(path)
    }
}

/// Reads what is selected of a data set, as HDF5 keeps it.
fn selection(cursor: &mut Cursor<'_>) -> Hdf5Result<ElementSelection> {
    const SEVERAL: ElementSelection = ElementSelection::Other("one source provides rows in several places");
    let (kind, version) = (cursor.read_u32_le()?, cursor.read_u32_le()?);
    // HDF5's kinds: 0 is nothing, 1 single elements, 2 blocks (hyperslabs), 3 all.
    if kind != 2 {
        cursor.skip(8)?;
        return Ok(match kind {
            0 => ElementSelection::None,
            3 => ElementSelection::All,
            _ => ElementSelection::Other("single elements are selected"),
        });
    }
    // Version 1 lists corners of 32 bits; later ones may state start, stride, count and block instead.
    let (regular, width) = match version {
        1 => {
            cursor.skip(8)?;
            (false, 4)
        }
        2 => {
            let regular = cursor.read_u8()? & 1 != 0;
            cursor.skip(4)?;
            (regular, 8)
        }
        _ => {
            let regular = cursor.read_u8()? & 1 != 0;
            (regular, usize::from(cursor.read_u8()?))
        }
    };
    let rank = cursor.read_u32_le()?;
    if rank > 32 {
        return Ok(ElementSelection::Other("its sources are not tables"));
    }
    if !regular && cursor.read_uvar(width)? != 1 {
        return Ok(SEVERAL);
    }
    let mut axes = Vec::new();
    // First corners, then last ones, which belong to the block.
    if !regular {
        let ends: Vec<u64> = (0..2 * rank).map(|_| cursor.read_uvar(width)).collect::<Hdf5Result<_>>()?;
        let (first, last) = ends.split_at(rank as usize);
        axes.extend(first.iter().zip(last).map(|(&first, &last)| first..last.saturating_add(1)));
        return Ok(ElementSelection::Block(axes));
    }
    if !matches!(width, 2 | 4 | 8) {
        return Ok(ElementSelection::Other("its list has a newer HDF5 version"));
    }
    // Unlimited sizes have all bits of the number's width set.
    let unlimited = u64::MAX >> (64 - 8 * width);
    for _ in 0..rank {
        let [start, stride, count, block] = [(); 4].map(|()| cursor.read_uvar(width));
        let (start, stride, count, block) = (start?, stride?, count?, block?);
        if count == unlimited || block == unlimited {
            return Ok(ElementSelection::Other("it grows with its sources (unlimited size)"));
        }
        // Blocks that touch are one.
        if count != 1 && stride != block {
            return Ok(SEVERAL);
        }
        axes.push(start..start.saturating_add(count.saturating_mul(block)));
    }
    Ok(ElementSelection::Block(axes))
}
