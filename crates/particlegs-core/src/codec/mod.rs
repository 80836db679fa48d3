//! Floor 3: mixture to bytes and back (docs/format.md).
//!
//! A block's means are sorted into a tree of cells (`tree`); sizes, counts, shapes (`shape`) and places are put on
//! lattices (`trellis`). One walk codes the tree level by level, heavy and dense nodes first, with every node's count
//! (`levels`; `source` is its encoder's side); a second one codes what is left in the order of the tree (`fine`), so that
//! any prefix is a coarser mixture. Both use adaptive models (`symbols`) and rANS (`rans`); points alone are coded alike
//! (`points`), as many of them as fit in a size. Sections with checksums hold it all together (`container`,
//! `file`); files are merged by copying their blocks (`merge`). Blocks of the alpha-blend law hold opacities and grey
//! levels in the places of counts and masses; its network has a section (`vizmapper`).

mod balance;
mod certificate;
mod change;
mod container;
mod decode;
mod decoder;
mod encoder;
mod exact;
mod field;
mod field_correlation;
mod file;
mod fine;
mod header;
mod info;
mod interpolation;
mod levels;
mod merge;
mod metadata;
mod number_model;
mod points;
mod predictor;
mod rans;
#[cfg(test)]
mod sections_tests;
mod series;
mod series_clock;
mod shape;
mod shared_species;
mod source;
mod streams;
mod sums;
mod symbols;
mod tree;
mod trellis;
mod vizmapper;
mod wire;

pub use balance::{CountBalance, MOST_SUMS};
pub use certificate::rounded;
pub use change::{ChangePrecision, ChangeTarget, FrameStep, TrackedBlock};
pub use container::{
    CORRELATION, FIELD, FIELD_CHANGE, HEAD_BYTES, SHARE, is_model, is_series, other_length, promised_length,
};
pub use decode::{Decoder, check, decode, decode_block, decode_prefix, decode_with, with_fields};
pub use encoder::Encoder;
pub use field::{FieldPrecision, PreviousField, encode_field};
pub use field_correlation::encode_correlation;
pub use file::{
    CodedLayer, MOST_LAYERS, StoredBlock, StoredSection, VIZMAPPER_SECTION_BYTES, assemble, assemble_with,
    certificate_bytes, coded_layers, encode, file_hash, read_metadata, size_without_blocks, stored_bytes,
};
pub use header::Precision;
pub use info::{BlockInfo, FieldInfo, FileInfo, LayerSum, read_info};
pub use merge::{Merge, blocks_hash, source_statements, sums};
pub use points::{CodedPoints, Thinning};
pub use series::{
    CodedFrame, FrameCoding, FrameEntry, INDEX_FROM, MOST_FRAMES, SeriesDecoder, SeriesFile, TrackedModel,
    assemble_series,
};
pub use series_clock::SeriesClock;
pub use sums::whole_counts;

/// Numbers that a walk cannot go on with.
#[derive(Debug)]
pub(crate) struct OutOfRange;
