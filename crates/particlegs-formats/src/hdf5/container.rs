//! HDF5 files: groups, attributes and data sets, through the library that knows the container.
//!
//! Nothing outside this module and its neighbour `storage` sees the library. It is told to keep no
//! data in memory, to follow no link to another file, and to bound what it reads at once.
//!
//! The library does not know the layout of virtual data sets: what it reads has each such layout rewritten as one
//! chunk without axes, which no other data set has; its address says where the list of sources lies.

use super::attributes::Attributes;
use super::packed::PackedNumber;
use crate::numbers::NumberType;
use hdf5_reader::checksum::jenkins_lookup3;
use hdf5_reader::error::{Error as Hdf5Error, Result as Hdf5Result};
use hdf5_reader::group::Group;
use hdf5_reader::messages::layout::DataLayout;
use hdf5_reader::{
    ByteOrder, Dataset, Datatype, ExternalLinkResolver, Hdf5File, OpenOptions, Storage, StorageBuffer, StringSize,
};
use particlegs_core::{Error, Result};
use particlegs_files::input::MappedFile;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// The largest object header that is read; real ones have a few KiB.
const MAX_HEADER: usize = 8 << 20;

/// The group at the top.
pub const TOP: &str = "/";

/// The first bytes of a superblock.
pub const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";

pub struct Container {
    pub place: String,
    pub path: PathBuf,
    pub map: Arc<MappedFile>,
    pub(super) file: Hdf5File,
    elsewhere: Arc<ExternalLinks>,
}

#[derive(Clone, Debug)]
pub struct DataSet {
    /// Name in its group.
    pub name: String,
    /// Numbers along each axis.
    pub shape: Vec<u64>,
    /// Type of its numbers and whether they are big-endian; `None` where they are none.
    pub number: Option<(NumberType, bool)>,
    /// Layout of the numbers' bits, where they do not fill their bytes; the type above has as many bytes then.
    pub packed: Option<PackedNumber>,
    pub kind: String,
    pub attributes: Attributes,
}

impl DataSet {
    pub fn components(&self) -> u64 {
        self.shape.iter().skip(1).fold(1, |a, &b| a.saturating_mul(b))
    }

    pub fn shape_text(&self) -> String {
        let axes: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        format!("({})", axes.join(", "))
    }
}

/// A group's members: data sets, and names with reasons of those that cannot be read.
#[derive(Default)]
pub struct Members {
    pub sets: Vec<DataSet>,
    /// The rest: name and error.
    pub unreadable: Vec<(String, Error)>,
}

/// Links to other files: never followed, remembered by name.
#[derive(Default)]
struct ExternalLinks(Mutex<Vec<String>>);

impl ExternalLinkResolver for ExternalLinks {
    fn resolve_external_link(&self, filename: &str) -> hdf5_reader::error::Result<Option<Hdf5File>> {
        let mut names = self.0.lock().unwrap_or_else(|e| e.into_inner());
        if names.len() < 8 && !names.iter().any(|n| n == filename) {
            names.push(filename.chars().filter(|c| !c.is_control()).take(200).collect());
        }
        Ok(None)
    }
}

impl Container {
    pub fn open(path: &Path) -> Result<Self> {
        match particlegs_files::input::map_file(path)? {
            (Some(map), _) => Self::from_map(path, map),
            (None, _) => Err(Error::input(path, "the file is empty")),
        }
    }

    pub fn from_map(path: &Path, map: Arc<MappedFile>) -> Result<Self> {
        let place = path.display().to_string();
        let elsewhere = Arc::new(ExternalLinks::default());
        let options = OpenOptions::default()
            .with_chunk_cache_bytes(0)
            .with_max_object_header_bytes(MAX_HEADER)
            .with_external_link_resolver(elsewhere.clone());
        let file = Hdf5File::from_storage_with_options(Arc::new(VirtualLayouts(map.clone())), options)
            .map_err(|e| broken(&place, &e))?;
        let block = file.superblock();
        if block.base_address == 0 && block.eof_address > map.len() as u64 {
            let message = format!("it has {} bytes but should have {}", map.len(), block.eof_address);
            return Err(Error::input_with(place, message, "the file is cut short: copy it again"));
        }
        Ok(Container { place, path: path.to_path_buf(), map, file, elsewhere })
    }

    /// Names of the groups at the top and where they lie: several names of one group are links.
    pub fn groups(&self) -> Result<Vec<(String, u64)>> {
        let root = self.file.root_group().map_err(|e| broken(&self.place, &e))?;
        let groups = root.groups().map_err(|e| broken(&self.place, &e))?;
        Ok(groups.iter().map(|g| (g.name().to_string(), g.address())).collect())
    }

    /// Paths of all groups below those at the top, each once and in order, `most` at most.
    pub fn groups_below(&self, most: usize) -> Result<Vec<String>> {
        let mut seen = BTreeSet::new();
        let mut paths: Vec<String> = Vec::new();
        let mut open: Vec<String> = self.groups()?.into_iter().map(|g| g.0).collect();
        while let Some(path) = open.pop() {
            let Ok(groups) = self.group(&path).and_then(|g| g.groups().map_err(|e| broken(&self.place, &e))) else {
                continue;
            };
            // Links may form circles: the address tells groups that were seen under another name.
            for group in groups.into_iter().filter(|g| seen.insert(g.address())) {
                if paths.len() < most {
                    paths.push(format!("{path}/{}", group.name()));
                    open.push(format!("{path}/{}", group.name()));
                }
            }
        }
        paths.sort();
        Ok(paths)
    }

    /// Names of other files that links in the groups looked at lead to.
    pub fn elsewhere(&self) -> Vec<String> {
        self.elsewhere.0.lock().unwrap_or_else(|e| e.into_inner()).clone()
    }

    /// A group by its names from the top, with `/` between them.
    fn group(&self, name: &str) -> Result<Group> {
        let root = self.file.root_group().map_err(|e| broken(&self.place, &e))?;
        let mut names = name.split('/').filter(|n| !n.is_empty());
        names.try_fold(root, |g, n| g.group(n)).map_err(|e| broken(&format!("{}: {name}", self.place), &e))
    }

    /// Names of what a group at the top holds; none where there is no such group.
    pub fn names_in(&self, group: &str) -> Vec<String> {
        self.group(group)
            .and_then(|g| g.member_names().map_err(|e| broken(&self.place, &e)))
            .map_or(Vec::new(), |(groups, sets)| groups.into_iter().chain(sets).map(|n| n.to_string()).collect())
    }

    /// Attributes of a group, by its names from the top; none where there is no such group.
    pub fn attributes(&self, group: &str) -> Result<Attributes> {
        let place = format!("{}: {group}", self.place);
        let root = self.file.root_group().map_err(|e| broken(&self.place, &e))?;
        if group == TOP {
            return Ok(Attributes::new(&root.attributes().map_err(|e| broken(&place, &e))?));
        }
        let mut names = group.split('/').filter(|name| !name.is_empty());
        match names.try_fold(root, |g, name| g.group(name)) {
            Ok(g) => Ok(Attributes::new(&g.attributes().map_err(|e| broken(&place, &e))?)),
            Err(Hdf5Error::GroupNotFound(_)) => Ok(Attributes::default()),
            Err(e) => Err(broken(&place, &e)),
        }
    }

    pub fn members(&self, group: &str) -> Result<Members> {
        let place = format!("{}: {group}", self.place);
        let group = self.group(group)?;
        let (_, names) = group.member_names().map_err(|e| broken(&place, &e))?;
        let mut members = Members::default();
        for name in names {
            match group.dataset(&name) {
                Ok(set) => members.sets.push(describe(&name, &set)),
                Err(e) => {
                    let error = broken(&format!("{place}/{name}"), &e);
                    members.unreadable.push((name, error));
                }
            }
        }
        Ok(members)
    }

    pub fn data_set(&self, group: &str, name: &str) -> Result<DataSet> {
        Ok(self.set(group, name)?.0)
    }

    /// A data set of a group at the top, and the library's view of it.
    pub(super) fn set(&self, group: &str, name: &str) -> Result<(DataSet, Dataset)> {
        let place = format!("{}: {group}/{name}", self.place);
        let set = self.group(group)?.dataset(name).map_err(|e| broken(&place, &e))?;
        Ok((describe(name, &set), set))
    }
}

/// An error of the library as ours, with what to do where that is known.
pub(super) fn broken(place: &str, error: &Hdf5Error) -> Error {
    let text = line(error);
    if text.contains("unsupported layout class 3") {
        let hint = "open its source files, or copy it with `h5repack`";
        return Error::input_with(place, "virtual data sets of this kind are not supported", hint);
    }
    if text.contains("unsupported") {
        return Error::input_with(place, text, "rewrite it with `h5repack -f GZIP=4 in.hdf5 out.hdf5`");
    }
    if text.contains("not found") {
        return Error::input(place, text);
    }
    Error::input_with(place, format!("damaged HDF5 file: {text}"), "copy it again; `h5dump -H` shows what is readable")
}

/// An error's text on one line of bounded length, without control characters that names may hold.
fn line(error: &Hdf5Error) -> String {
    error.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).take(300).collect()
}

fn describe(name: &str, set: &Dataset) -> DataSet {
    let (mut number, mut kind) = number_of(set.dtype());
    let mut packed = None;
    if number.is_some() {
        // The library does not tell types of fewer bits from whole ones: the description itself does.
        match PackedNumber::from_datatype(&set.raw_datatype().unwrap_or_default()) {
            Ok(None) => {}
            Ok(Some(bits)) => (packed, kind) = (Some(bits), bits.name()),
            Err(odd) => (number, kind) = (None, odd),
        }
    }
    let attributes = Attributes::new(&set.attributes());
    DataSet { name: name.to_string(), shape: set.shape().to_vec(), number, packed, kind, attributes }
}

/// The type of numbers that a data type means, with whether they are big-endian, and its name.
fn number_of(datatype: &Datatype) -> (Option<(NumberType, bool)>, String) {
    let (kind, order) = match datatype {
        Datatype::FloatingPoint { size, byte_order } => match NumberType::float((*size).into()) {
            Some(kind) => (kind, byte_order),
            // Always packed.
            None if *size == 2 => (NumberType::U16, byte_order),
            None => return (None, format!("{size}-byte float")),
        },
        Datatype::FixedPoint { size, signed, byte_order } => match NumberType::integer((*size).into(), *signed) {
            Some(kind) => (kind, byte_order),
            None => return (None, format!("{size}-byte integer")),
        },
        Datatype::Enum { .. } => return (None, "enumeration".into()),
        Datatype::String { size: StringSize::Fixed(n), .. } => return (None, format!("text of {n}")),
        Datatype::String { .. } => return (None, "text".into()),
        Datatype::VarLen { .. } => return (None, "variable length".into()),
        Datatype::Compound { .. } => return (None, "compound".into()),
        Datatype::Array { .. } => return (None, "array".into()),
        Datatype::Opaque { .. } => return (None, "opaque".into()),
        Datatype::Reference { .. } => return (None, "reference".into()),
        Datatype::Bitfield { .. } => return (None, "bits".into()),
    };
    (Some((kind, *order == ByteOrder::BigEndian)), kind.name().into())
}

/// A mapped file, with layouts of virtual data sets as the library can read them.
struct VirtualLayouts(Arc<MappedFile>);

impl Storage for VirtualLayouts {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }

    fn read_range(&self, offset: u64, len: usize) -> Hdf5Result<StorageBuffer> {
        let start = usize::try_from(offset).unwrap_or(usize::MAX);
        let stored = StorageBuffer::from_shared_owner(self.0.clone(), start, len)?;
        Ok(rewritten(&stored).map_or(stored, StorageBuffer::from_vec))
    }
}

/// Part of an object's header with its layout rewritten; `None` where it has no layout of a virtual data set.
fn rewritten(bytes: &[u8]) -> Option<Vec<u8>> {
    let summed = bytes.starts_with(b"OHDR") || bytes.starts_with(b"OCHK");
    let at = (8..bytes.len().saturating_sub(13)).find(|&at| {
        let before = &bytes[at - 8..at];
        let layout = if summed {
            // Type 8 and a size of 14 bytes, then flags and perhaps two bytes of creation order.
            before[4..7] == [8, 14, 0] || before[2..5] == [8, 14, 0]
        } else {
            // Headers of version 1 pad the size to 16, and have flags and three zeros.
            before[..4] == [8, 0, 16, 0] && before[5..] == [0; 3]
        };
        // Version 4 or 5 of the layout, of the class that is virtual.
        layout && matches!(bytes[at..at + 2], [4 | 5, 3])
    })?;
    let index = u32::from_le_bytes(bytes[at + 10..at + 14].try_into().ok()?);
    let address = u64::from_le_bytes(bytes[at + 2..at + 10].try_into().ok()?);
    // Both must fit one address of 64 bits.
    let index = u16::try_from(index).ok().filter(|_| address < 1 << 48)?;
    let mut out = bytes.to_vec();
    // Version 4, chunks, no flags, no axes, sizes of one byte, index of a single chunk: its address follows.
    out[at..at + 6].copy_from_slice(&[4, 2, 0, 0, 1, 1]);
    out[at + 6..at + 14].copy_from_slice(&(address << 16 | u64::from(index)).to_le_bytes());
    if summed {
        let end = bytes.len() - 4;
        // A header whose checksum was wrong before must stay so, for the library to see it.
        if at + 14 > end || bytes[end..] != jenkins_lookup3(&bytes[..end]).to_le_bytes() {
            return None;
        }
        let sum = jenkins_lookup3(&out[..end]).to_le_bytes();
        out[end..].copy_from_slice(&sum);
    }
    Some(out)
}

/// Whether it is a virtual data set's layout as rewritten here.
pub fn is_virtual(layout: &DataLayout) -> bool {
    matches!(layout, DataLayout::Chunked { dims, .. } if dims.is_empty())
}
