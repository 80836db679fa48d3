//! Merges models; their coded blocks are copied.

use crate::{Context, Model, Result};
use particlegs_core::codec::{self, Merge};
use particlegs_core::model::LawKind;
use particlegs_files::input::name_of;
use std::borrow::Cow;
use std::path::PathBuf;

/// Merges models, which keep all fields that each of them has, or those of these names.
///
/// # Errors
/// [`crate::Error::Input`] for models that do not belong together; [`crate::Error::Cancelled`].
pub fn merge(parts: &[&Model], fields: Option<Vec<String>>, context: &Context<'_>) -> Result<Model> {
    let name = parts.first().map_or("merged", |part| part.name());
    let bytes = merge_parts(parts.iter().map(|part| Ok((part.bytes().into(), part.name().into()))), fields, context)?;
    Model::decode(bytes, name, context)
}

/// Merges model files, one after the other read and not decoded, to the bytes of one.
///
/// # Errors
/// As [`merge`]; those of reading.
pub fn merge_files(parts: &[PathBuf], fields: Option<Vec<String>>, context: &Context<'_>) -> Result<Vec<u8>> {
    let read =
        |path: &PathBuf| Ok((crate::input::read_model(path, &Default::default(), context)?.into(), name_of(path)));
    merge_parts(parts.iter().map(read), fields, context)
}

fn merge_parts<'a>(
    parts: impl ExactSizeIterator<Item = Result<(Cow<'a, [u8]>, String)>>,
    fields: Option<Vec<String>>,
    context: &Context<'_>,
) -> Result<Vec<u8>> {
    let (mut merge, count) = (fields.map_or_else(Merge::default, Merge::with_fields), parts.len());
    context.begin("merging", count as u64);
    for part in parts {
        context.check()?;
        let (bytes, name) = part?;
        merge.add(&bytes, &name, context)?;
        context.advance(1);
    }
    context.end();
    let bytes = merge.finish()?;
    let info = codec::read_info(&bytes, "the merged model")?;
    if info.metadata.law == LawKind::AlphaBlend && count > 1 {
        context.note(match info.vizmapper {
            Some(_) => {
                "the VizMapper is that of the part with the first block, as published; it was trained on that part only"
            }
            None => "the part with the first block has no VizMapper, so the merged file has none",
        });
    }
    Ok(bytes)
}
