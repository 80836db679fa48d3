//! .splat: 32 bytes a splat - position and size as 3 f32 each, colour and rotation as 4 bytes each.

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::format::FileHead;
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::stored_bytes::StoredBytes;
use crate::{Choice, Description, Snapshot};
use particlegs_core::{Error, Result};
use std::path::PathBuf;

const RECORD: usize = 32;

/// There is no signature: the name must say it, and the first records must look like splats.
pub fn detect(head: &FileHead) -> bool {
    let named = head.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("splat"));
    let plausible = |record: &[u8]| {
        let value = |k: usize| NumberType::F32.get(&record[4 * k..], false);
        (0..3).all(|k| value(k).abs() < 1e9) && (3..6).all(|k| (0.0..1e9).contains(&value(k)))
    };
    named
        && head.compression.is_none()
        && head.length.is_multiple_of(RECORD as u64)
        && head.bytes.len() >= RECORD
        && head.bytes.chunks_exact(RECORD).all(plausible)
}

pub fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let bytes = Bytes::from_filled_file(path)?;
    let length = bytes.len() as u64;
    if !length.is_multiple_of(RECORD as u64) {
        let message = format!("the size of {length} bytes is not a multiple of {RECORD}, the size of a record");
        return Err(Error::input_with(path, message, "the file is cut short or not a .splat file"));
    }
    let stored = StoredBytes::plain_file(bytes);
    let stride = RECORD as u64;
    let fields = vec![
        ColumnarField::in_records("position", NumberType::F32, 3, [0, stride, 0]),
        ColumnarField::in_records("scale", NumberType::F32, 3, [0, stride, 12]),
        ColumnarField::in_records("color", NumberType::U8, 4, [0, stride, 24]),
        ColumnarField::in_records("rotation", NumberType::U8, 4, [0, stride, 28]),
    ];
    let count = length / stride;
    let description = Description {
        species: vec![one_species(count, &fields, "position".into(), |_| None)],
        notes: vec![Description::SPLATS.into()],
        ..Description::new(".splat records", std::slice::from_ref(path), named(path))
    };
    let place = path.display().to_string();
    Ok(Box::new(ColumnarSnapshot { description, place, stored: vec![stored], fields, world: Affine::IDENTITY }))
}
