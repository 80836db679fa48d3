//! Bytes of an HDF5 file whose data sets are uncompressed chunks: where everything lies is known before
//! anything is written, so that runs may be written in any order, and no library that writes HDF5 from Rust
//! alone does that in bounded memory.
//!
//! Superblock 2, object headers 2, compact links and attributes, layout 3 with a version 1 tree: what HDF5 1.8
//! and everything since reads. Chunks lie one after the other, so that a data set is one stretch of the file.

use hdf5_reader::checksum::jenkins_lookup3;
use particlegs_particles::Number;

/// Rows of a chunk.
pub const CHUNK_ROWS: u64 = 1 << 16;

/// The address of what is not there.
const UNDEFINED: u64 = u64::MAX;

/// Data begin at a multiple of a page.
const ALIGN: u64 = 4096;

/// Children of a node of a chunk tree: twice the K that is assumed where the superblock names none.
const CHILDREN: u64 = 64;

pub enum OutValue {
    Number(f64),
    Numbers(Vec<f64>),
    Integer(i32),
    Counts(Vec<u64>),
    Words(Vec<u32>),
    Text(String),
}

pub type Attribute = (&'static str, OutValue);

/// A data set, or one without numbers.
pub struct OutDataSet {
    pub name: String,
    pub number: Number,
    /// Rows, at least one.
    pub rows: u64,
    /// Numbers a row; one makes it one-dimensional.
    pub columns: u64,
    pub attributes: Vec<Attribute>,
    /// Attributes of the source's that are one number.
    pub source: Vec<(String, f64)>,
    /// Whether there is only a shape: readers see 64-bit zeros, and the file has no bytes for them.
    pub hollow: bool,
}

impl OutDataSet {
    fn chunk_rows(&self) -> u64 {
        self.rows.min(CHUNK_ROWS)
    }

    fn chunk_bytes(&self) -> u64 {
        self.chunk_rows() * self.columns * self.number.bytes()
    }

    fn chunks(&self) -> u64 {
        if self.hollow { 0 } else { self.rows.div_ceil(CHUNK_ROWS) }
    }

    /// Shape of the set of so many rows.
    fn shape(&self, rows: u64) -> Vec<u64> {
        if self.columns == 1 { vec![rows] } else { vec![rows, self.columns] }
    }
}

pub struct OutGroup {
    pub name: String,
    pub attributes: Vec<Attribute>,
    pub sets: Vec<OutDataSet>,
}

pub struct EncodedHeader {
    pub metadata: Vec<u8>,
    /// First byte of each data set, group by group.
    pub data: Vec<Vec<u64>>,
    pub length: u64,
}

pub fn plan(groups: &[OutGroup]) -> EncodedHeader {
    let mut next = SUPERBLOCK;
    let mut take = |bytes: u64| {
        let at = next;
        next = (next + bytes).next_multiple_of(8);
        at
    };
    // Sizes do not depend on addresses: everything is measured with none first.
    let none = |g: &OutGroup| vec![0; g.sets.len()];
    let root = take(root_header(groups, &vec![0; groups.len()]).len() as u64);
    let heads: Vec<u64> = groups.iter().map(|g| take(group_header(g, &none(g)).len() as u64)).collect();
    let each = |take: &mut dyn FnMut(&OutDataSet) -> u64| -> Vec<Vec<u64>> {
        groups.iter().map(|g| g.sets.iter().map(&mut *take).collect()).collect()
    };
    let sets = each(&mut |s| take(set_header(s, 0).len() as u64));
    let trees = each(&mut |s| take(nodes(s.chunks()).iter().sum::<u64>() * node_bytes(s)));
    let end = next;
    let mut next = end.next_multiple_of(ALIGN);
    let data = each(&mut |s| {
        let at = next;
        next = (next + s.chunks() * s.chunk_bytes()).next_multiple_of(ALIGN);
        at
    });
    let all =
        groups.iter().enumerate().flat_map(|(g, group)| group.sets.iter().enumerate().map(move |(s, set)| (g, s, set)));
    let length = all.clone().map(|(g, s, set)| data[g][s] + set.chunks() * set.chunk_bytes()).fold(end, u64::max);
    let mut metadata = vec![0; end as usize];
    let mut put = |at: u64, bytes: Vec<u8>| metadata[at as usize..at as usize + bytes.len()].copy_from_slice(&bytes);
    put(0, superblock(root, length));
    put(root, root_header(groups, &heads));
    for (g, group) in groups.iter().enumerate() {
        put(heads[g], group_header(group, &sets[g]));
    }
    for (g, s, set) in all {
        let tree = tree(set, trees[g][s], data[g][s]);
        // The root is the last node of a tree.
        let top = (trees[g][s] + tree.len() as u64).saturating_sub(node_bytes(set));
        put(sets[g][s], set_header(set, top));
        put(trees[g][s], tree);
    }
    EncodedHeader { metadata, data, length }
}

/// Bytes in the order of the file's fields.
#[derive(Default)]
struct ByteWriter(Vec<u8>);

impl ByteWriter {
    fn raw(mut self, bytes: &[u8]) -> Self {
        self.0.extend_from_slice(bytes);
        self
    }

    fn u16(self, v: u64) -> Self {
        self.raw(&(v as u16).to_le_bytes())
    }

    fn u32(self, v: u64) -> Self {
        self.raw(&(v as u32).to_le_bytes())
    }

    fn u64(self, v: u64) -> Self {
        self.raw(&v.to_le_bytes())
    }

    fn u64s(self, values: &[u64]) -> Self {
        values.iter().fold(self, |b, &v| b.u64(v))
    }

    /// Ends with the sum of what came before.
    fn summed(self) -> Vec<u8> {
        let sum = jenkins_lookup3(&self.0);
        self.u32(u64::from(sum)).0
    }
}

const SUPERBLOCK: u64 = 48;

fn superblock(root: u64, length: u64) -> Vec<u8> {
    // Version 2, offsets and lengths of 8 bytes, base 0, no extension.
    ByteWriter::default()
        .raw(&super::container::SIGNATURE)
        .raw(&[2, 8, 8, 0])
        .u64s(&[0, UNDEFINED, length, root])
        .summed()
}

/// An object header of messages: type and content.
fn header(messages: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let size: usize = messages.iter().map(|m| 4 + m.1.len()).sum();
    // Version 2; the size of the first chunk has 4 bytes.
    let start = ByteWriter::default().raw(b"OHDR").raw(&[2, 2]).u32(size as u64);
    messages
        .iter()
        .fold(start, |b, (kind, content)| b.raw(&[*kind]).u16(content.len() as u64).raw(&[0]).raw(content))
        .summed()
}

fn group_messages<'a>(links: impl Iterator<Item = (&'a str, u64)>, attributes: &[Attribute]) -> Vec<(u8, Vec<u8>)> {
    // Link info without a heap, group info without hints.
    let mut messages = vec![(2, ByteWriter::default().raw(&[0, 0]).u64s(&[UNDEFINED; 2]).0), (10, vec![0, 0])];
    let link = |(name, at): (&str, u64)| {
        (6, ByteWriter::default().raw(&[1, 0, name.len() as u8]).raw(name.as_bytes()).u64(at).0)
    };
    messages.extend(links.map(link));
    messages.extend(attribute_messages(attributes));
    messages
}

/// Attributes in the header itself. Without the first message, which says that there is no heap of more, libraries
/// count none.
fn attribute_messages(attributes: &[Attribute]) -> Vec<(u8, Vec<u8>)> {
    let all = attributes.iter().map(|(name, value)| (12, attribute(name, value)));
    if attributes.is_empty() { Vec::new() } else { std::iter::once(attribute_info()).chain(all).collect() }
}

fn attribute_info() -> (u8, Vec<u8>) {
    (21, ByteWriter::default().raw(&[0, 0]).u64s(&[UNDEFINED; 2]).0)
}

fn root_header(groups: &[OutGroup], heads: &[u64]) -> Vec<u8> {
    header(&group_messages(groups.iter().map(|g| &g.name[..]).zip(heads.iter().copied()), &[]))
}

fn group_header(group: &OutGroup, sets: &[u64]) -> Vec<u8> {
    header(&group_messages(group.sets.iter().map(|s| &s.name[..]).zip(sets.iter().copied()), &group.attributes))
}

fn set_header(set: &OutDataSet, tree: u64) -> Vec<u8> {
    if set.hollow {
        // Contiguous, not yet allocated.
        let layout = ByteWriter::default().raw(&[3, 1]).u64s(&[UNDEFINED, 8 * set.rows * set.columns]).0;
        return table_header(set, &datatype(Number::U64), 0x0a, layout);
    }
    let chunk = set.shape(set.chunk_rows());
    // Layout 3, chunked; the last dimension is the number's size.
    let layout = ByteWriter::default().raw(&[3, 2, chunk.len() as u8 + 1]).u64(tree);
    let layout = chunk.iter().chain(&[set.number.bytes()]).fold(layout, |b, &n| b.u32(n));
    table_header(set, &datatype(set.number), 0x0b, layout.0)
}

/// `fill`: when space is taken, and that no fill value is set.
fn table_header(set: &OutDataSet, kind: &[u8], fill: u8, layout: Vec<u8>) -> Vec<u8> {
    let mut messages = vec![(1, dataspace(&set.shape(set.rows))), (3, kind.to_vec()), (5, vec![3, fill]), (8, layout)];
    let source = set.source.iter().map(|(name, value)| (12, attribute(name, &OutValue::Number(*value))));
    let source: Vec<_> = source.collect();
    match set.attributes.is_empty() && !source.is_empty() {
        true => messages.push(attribute_info()),
        false => messages.extend(attribute_messages(&set.attributes)),
    }
    messages.extend(source);
    header(&messages)
}

/// Whole numbers, or IEEE 754's.
fn datatype(number: Number) -> Vec<u8> {
    let signed = match number {
        Number::F32 => return FLOAT32.to_vec(),
        Number::F64 => return FLOAT64.to_vec(),
        Number::I8 | Number::I16 | Number::I32 | Number::I64 => 8,
        Number::U8 | Number::U16 | Number::U32 | Number::U64 => 0,
    };
    let bytes = number.bytes() as u8;
    vec![0x10, signed, 0, 0, bytes, 0, 0, 0, 0, 0, 8 * bytes, 0]
}

fn dataspace(shape: &[u64]) -> Vec<u8> {
    ByteWriter::default().raw(&[2, shape.len() as u8, 0, u8::from(!shape.is_empty())]).u64s(shape).0
}

// Little-endian IEEE 754: where sign, exponent and mantissa lie, and the bias of the exponent.
const FLOAT32: [u8; 20] = [0x11, 0x20, 31, 0, 4, 0, 0, 0, 0, 0, 32, 0, 23, 8, 0, 23, 127, 0, 0, 0];
const FLOAT64: [u8; 20] = [0x11, 0x20, 63, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52, 0xff, 3, 0, 0];

fn attribute(name: &str, value: &OutValue) -> Vec<u8> {
    let floats = |v: &[f64]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let (kind, space, data) = match value {
        OutValue::Number(v) => (FLOAT64.to_vec(), dataspace(&[]), floats(&[*v])),
        OutValue::Numbers(v) => (FLOAT64.to_vec(), dataspace(&[v.len() as u64]), floats(v)),
        OutValue::Integer(v) => (datatype(Number::I32), dataspace(&[]), v.to_le_bytes().to_vec()),
        OutValue::Counts(v) => (datatype(Number::U64), dataspace(&[v.len() as u64]), ByteWriter::default().u64s(v).0),
        OutValue::Words(v) => {
            (datatype(Number::U32), dataspace(&[v.len() as u64]), v.iter().flat_map(|v| v.to_le_bytes()).collect())
        }
        OutValue::Text(text) => {
            // UTF-8, ended by a zero.
            let text = [text.as_bytes(), &[0]].concat();
            (ByteWriter::default().raw(&[0x13, 0x10, 0, 0]).u32(text.len() as u64).0, dataspace(&[]), text)
        }
    };
    let lengths = [name.len() + 1, kind.len(), space.len()];
    let start = lengths.iter().fold(ByteWriter::default().raw(&[3, 0]), |b, &n| b.u16(n as u64)).raw(&[0]);
    start.raw(name.as_bytes()).raw(&[0]).raw(&kind).raw(&space).raw(&data).0
}

/// Nodes of a chunk tree, level by level from the leaves; the last level has one.
fn nodes(chunks: u64) -> Vec<u64> {
    let mut levels = vec![chunks.div_ceil(CHILDREN)];
    if chunks == 0 {
        return levels;
    }
    while let Some(&n) = levels.last().filter(|&&n| n > 1) {
        levels.push(n.div_ceil(CHILDREN));
    }
    levels
}

fn key_bytes(set: &OutDataSet) -> u64 {
    8 + 8 * (set.shape(0).len() as u64 + 1)
}

fn node_bytes(set: &OutDataSet) -> u64 {
    24 + CHILDREN * 8 + (CHILDREN + 1) * key_bytes(set)
}

/// The tree of a set's chunks, at byte `at`, leaves first, the root last. Chunks lie from byte `data`.
fn tree(set: &OutDataSet, at: u64, data: u64) -> Vec<u8> {
    let (size, chunks) = (node_bytes(set), set.chunks());
    let key = |bytes: ByteWriter, chunk: u64| {
        // Multiples of the chunk's shape; beyond the last chunk in every direction for the key after it.
        let past = u64::from(chunk >= chunks);
        let mut offsets = set.shape(chunk.min(chunks) * set.chunk_rows());
        offsets[1..].fill(past * set.columns);
        offsets.push(past * set.number.bytes());
        bytes.u32(set.chunk_bytes()).u32(0).u64s(&offsets)
    };
    let mut out = Vec::new();
    let (mut below, mut step) = (data, 1);
    let mut children = chunks;
    for (level, &count) in nodes(chunks).iter().enumerate() {
        let here = at + out.len() as u64;
        let child_bytes = if level == 0 { set.chunk_bytes() } else { size };
        for node in 0..count {
            let range = node * CHILDREN..children.min((node + 1) * CHILDREN);
            let left = if node == 0 { UNDEFINED } else { here + (node - 1) * size };
            let right = if node + 1 == count { UNDEFINED } else { here + (node + 1) * size };
            let start = ByteWriter::default().raw(b"TREE").raw(&[1, level as u8]).u16(range.end - range.start);
            let filled = range
                .clone()
                .fold(start.u64s(&[left, right]), |b, child| key(b, child * step).u64(below + child * child_bytes));
            let mut bytes = key(filled, range.end * step).0;
            bytes.resize(size as usize, 0);
            out.extend_from_slice(&bytes);
        }
        (below, step, children) = (here, step * CHILDREN, count);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_have_as_many_levels_as_they_need() {
        assert_eq!(nodes(0), [0]);
        assert_eq!(nodes(1), [1]);
        assert_eq!(nodes(64), [1]);
        assert_eq!(nodes(65), [2, 1]);
        assert_eq!(nodes(64 * 64 + 1), [65, 2, 1]);
        let (number, attributes, source) = (Number::F32, Vec::new(), Vec::new());
        let rows = 65 * CHUNK_ROWS - 5;
        let set = OutDataSet { name: "a".into(), number, rows, columns: 3, attributes, source, hollow: false };
        assert_eq!(tree(&set, 0, 0).len() as u64, 3 * node_bytes(&set));
    }
}
