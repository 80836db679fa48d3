//! Tables of numbers in text, read fast, in parallel and in bounded memory.
//!
//! [`lines::LineReader`] gives a stream's lines, a window at a time. [`split`] takes lines apart into
//! tokens and numbers. [`table::TextTable`] knows where the rows of one frame lie and how many of each
//! species there are; [`reader::RowReader`] parses them run by run, and [`snapshot::TextSnapshot`]
//! is what LAMMPS dumps, XYZ files and plain tables have in common.

pub mod content;
pub mod lines;
pub(crate) mod number;
pub mod parse;
pub mod reader;
pub mod snapshot;
pub mod split;
pub mod table;
#[cfg(test)]
mod tests;
