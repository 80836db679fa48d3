//! Huffman code of integers: the tree in preorder, then the codes; and bits, written and read.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// No tree of fewer than 2^32 values is deeper; also the longest code that one write can take.
const DEEPEST: u32 = 56;

enum HuffmanNode {
    Inner(usize, usize),
    Leaf(u64),
}

/// Codes values minus the smallest; `None` if a code would be too long.
pub fn write(values: &[u64], symbol_bits: u32) -> Option<Vec<u8>> {
    let mut counts = BTreeMap::new();
    values.iter().for_each(|v| *counts.entry(*v).or_insert(0u64) += 1);
    let mut nodes: Vec<HuffmanNode> = counts.keys().map(|s| HuffmanNode::Leaf(*s)).collect();
    // The index decides between equal counts, so that the tree is always the same.
    let mut heap: BinaryHeap<_> = counts.values().enumerate().map(|(i, n)| Reverse((*n, i))).collect();
    while heap.len() > 1 {
        let (Reverse((a, first)), Reverse((b, second))) = (heap.pop()?, heap.pop()?);
        nodes.push(HuffmanNode::Inner(first, second));
        heap.push(Reverse((a + b, nodes.len() - 1)));
    }
    let mut out = BitWriter::default();
    let mut codes = std::collections::HashMap::new();
    // Write the tree and collect the code of each leaf.
    let mut open = vec![(nodes.len() - 1, 0u64, 0u32)];
    while let Some((node, code, length)) = open.pop() {
        match nodes[node] {
            HuffmanNode::Leaf(symbol) => {
                out.put(1, 1);
                out.put_long(symbol, symbol_bits);
                codes.insert(symbol, (code, length));
            }
            HuffmanNode::Inner(first, second) => {
                if length == DEEPEST {
                    return None;
                }
                out.put(0, 1);
                open.push((second, code | 1 << length, length + 1));
                open.push((first, code, length + 1));
            }
        }
    }
    for v in values {
        let (code, length) = codes[v];
        out.put(code, length);
    }
    Some(out.finish())
}

/// Decodes `count` values; `None` for bytes that [`write()`] did not make.
pub fn read(bytes: &[u8], count: usize, symbol_bits: u32) -> Option<Vec<u64>> {
    let mut bits = BitReader::new(bytes);
    // Children of inner nodes as indices; leaves as symbols.
    let mut nodes: Vec<HuffmanNode> = Vec::new();
    // Inner nodes whose children are not complete yet.
    let mut open: Vec<(usize, Option<usize>)> = Vec::new();
    loop {
        let index = nodes.len();
        let leaf = bits.bit()?;
        nodes.push(if leaf { HuffmanNode::Leaf(bits.take(symbol_bits)?) } else { HuffmanNode::Inner(0, 0) });
        if !leaf {
            // `write` makes no deeper tree.
            if open.len() > DEEPEST as usize {
                return None;
            }
            open.push((index, None));
            continue;
        }
        let mut done = index;
        loop {
            match open.pop() {
                None => {
                    let root = 0;
                    return (0..count).map(|_| symbol(&nodes, root, &mut bits)).collect();
                }
                Some((parent, None)) => {
                    open.push((parent, Some(done)));
                    break;
                }
                Some((parent, Some(first))) => {
                    nodes[parent] = HuffmanNode::Inner(first, done);
                    done = parent;
                }
            }
        }
    }
}

fn symbol(nodes: &[HuffmanNode], root: usize, bits: &mut BitReader<'_>) -> Option<u64> {
    let mut node = root;
    loop {
        match nodes[node] {
            HuffmanNode::Leaf(symbol) => return Some(symbol),
            HuffmanNode::Inner(first, second) => node = if bits.bit()? { second } else { first },
        }
    }
}

/// Writes bits, the lowest of each byte first.
#[derive(Default)]
pub struct BitWriter {
    bytes: Vec<u8>,
    held: u64,
    bits: u32,
}

impl BitWriter {
    /// Appends the lowest `bits` (56 at most) of a value.
    pub fn put(&mut self, value: u64, bits: u32) {
        self.held |= value << self.bits;
        self.bits += bits;
        while self.bits >= 8 {
            self.bytes.push(self.held as u8);
            self.held >>= 8;
            self.bits -= 8;
        }
    }

    /// Appends the lowest `bits` (64 at most) of a value.
    pub fn put_long(&mut self, value: u64, bits: u32) {
        // Up to seven bits are still held, so that 64 more would not fit.
        let low = bits.min(32);
        self.put(value & ((1 << low) - 1), low);
        self.put(value >> low & ((1 << (bits - low)) - 1), bits - low);
    }

    /// The bytes; the last is padded with zeros.
    pub fn finish(mut self) -> Vec<u8> {
        if self.bits > 0 {
            self.bytes.push(self.held as u8);
        }
        self.bytes
    }
}

/// Reads what [`BitWriter`] wrote.
pub struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        BitReader { bytes, at: 0 }
    }

    /// The next bit; `None` at the end.
    pub fn bit(&mut self) -> Option<bool> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (self.at % 8) & 1 == 1;
        self.at += 1;
        Some(bit)
    }

    /// The next `bits` (64 at most).
    pub fn take(&mut self, bits: u32) -> Option<u64> {
        (0..bits).try_fold(0, |value, i| Some(value | u64::from(self.bit()?) << i))
    }
}
