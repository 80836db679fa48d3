//! Output of `info` for a series.

use crate::common::CommandContext;
use crate::frame_table::{FrameTable, kind_of};
use crate::info_model;
use crate::inputs::{self, FrameChoice};
use particlegs_core::codec::{FileInfo, FrameCoding, SeriesDecoder, SeriesFile};
use particlegs_core::model::{Certificate, PictureScore};
use particlegs_core::{Result, codec};
use particlegs_files::input::name_of;
use serde::Serialize;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// A line for each frame: its number, what the clock shows, what it is, its bytes and its score.
pub fn print(context: &CommandContext, path: &Path, bytes: &[u8]) -> Result<()> {
    let series = SeriesFile::read(bytes, &name_of(path))?;
    let clock = series.clock.name();
    let keyframes = series.frames.iter().filter(|f| f.kind == FrameCoding::Keyframe).count();
    let mut text =
        format!("series of {} frames, {keyframes} of them keyframes, {} bytes", series.frames.len(), bytes.len());
    let _ = write!(text, "\n{:>6} {clock:>13} {:>9} {:>9} {:>9}", "frame", "kind", "bytes", "PSNR, dB");
    let mut rows = Vec::with_capacity(series.frames.len());
    for (number, frame) in series.frames.iter().enumerate() {
        let kind = kind_of(frame.kind);
        if frame.kind == FrameCoding::Missing {
            let _ = write!(text, "\n{number:>6} {:>13} {kind:>9}", "");
            rows.push(FrameRow::Missing { frame: number, kind });
            continue;
        }
        let masked_psnr = series.certificate(number)?.as_ref().and_then(Certificate::mean_psnr);
        let (time, bytes) = (frame.time, frame.place.len());
        let shown = masked_psnr.map_or(String::new(), |v| format!("{v:.2}"));
        let _ = write!(text, "\n{number:>6} {time:>13.6} {kind:>9} {bytes:>9} {shown:>9}");
        rows.push(FrameRow::There { frame: number, kind, time, bytes, masked_psnr });
    }
    let recipe = serde_json::from_str(&series.recipe).unwrap_or(Value::Null);
    context.finish(&text, &SeriesReport { series_bytes: bytes.len(), clock, frames: rows, recipe })
}

/// A frame as a model, with its certificate in the series.
pub fn print_frame(context: &CommandContext, path: &Path, frame: &FrameChoice) -> Result<()> {
    let (bytes, place) = (inputs::read_file(path, context)?, name_of(path));
    let series = SeriesFile::read(&bytes, &place)?;
    let number = frame.number(&series, &place, context)?;
    context.message("note: sizes are those of the frame as a model file of its own, as `extract` writes it");
    let info = codec::read_info(&SeriesDecoder::new(&series).extract(number, context)?, &series.name(number))?;
    info_model::print_info(context, &FileInfo { certificate: series.certificate(number)?, ..info })
}

#[derive(Serialize)]
struct SeriesReport {
    series_bytes: usize,
    clock: &'static str,
    frames: Vec<FrameRow>,
    recipe: Value,
}

#[derive(Serialize)]
#[serde(untagged)]
enum FrameRow {
    Missing { frame: usize, kind: &'static str },
    There { frame: usize, kind: &'static str, time: f64, bytes: usize, masked_psnr: Option<f64> },
}

/// What a score of pictures is: column, unit, meaning, and where it is found.
type ScoreColumn = (&'static str, Option<&'static str>, &'static str, fn(PictureScore) -> Option<f64>);
const SCORES: [ScoreColumn; 2] = [
    ("masked_psnr", Some("dB"), "of noise-free pictures, stored with the frame", |s| s.masked_psnr),
    ("ssim", None, "of noise-free pictures, stored with the frame", |s| Some(s.ssim)),
];

/// A table of the frames as CSV, on standard output.
pub fn print_table(context: &CommandContext, path: &Path, bytes: &[u8]) -> Result<()> {
    let series = SeriesFile::read(bytes, &name_of(path))?;
    let mut decoder = SeriesDecoder::new(&series);
    let (mut frames, mut gaussians, mut scores) = (Vec::new(), Vec::new(), Vec::new());
    context.begin("reading frames", series.there().count() as u64);
    for number in series.there() {
        context.check()?;
        context.advance(1);
        let model = decoder.frame(number, context)?;
        let blocks = model.layers.iter().flat_map(|l| &l.content);
        gaussians.push(Some(blocks.map(|b| b.block.gaussians.len()).sum::<usize>() as f64));
        frames.push(model.metadata.clone());
        scores.push(model.certificate);
    }
    context.end();
    let mut table = FrameTable::new(&series, &frames, &series.units()?);
    table.add(("gaussians", None), "of the frame", gaussians);
    let bytes = series.there().map(|i| Some(series.frames[i].place.len() as f64));
    table.add(("bytes", None), "that the frame takes in the file", bytes);
    for (name, unit, about, of) in SCORES {
        for (i, orbit) in ["far", "mid", "near"].into_iter().enumerate() {
            let score = |c: &Option<Certificate>| c.as_ref()?.views.orbits[i].expected.model.and_then(of);
            table.add((&format!("{name}_{orbit}"), unit.map(String::from)), about, scores.iter().map(score));
        }
    }
    let density = |pick: fn(&Certificate) -> f64| scores.iter().map(move |c| c.as_ref().map(pick));
    table.add(("density_correlation", None), "of densities on a grid", density(|c| c.density.correlation));
    let about = "mean absolute error of the density contrast on a grid";
    table.add(("density_error", None), about, density(|c| c.density.mean_absolute_error));
    context.line(&table.text())
}
