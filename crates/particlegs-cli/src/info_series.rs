//! Output of `info` for a series.

use crate::common::CommandContext;
use particlegs_files::input::name_of;
use particlegs_pipeline::Result;
use particlegs_pipeline::codec::{FrameCoding, SeriesFile};
use particlegs_pipeline::model::Certificate;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// Mean masked PSNR of `expected` over the orbits, dB.
pub fn mean_psnr(certificate: &Certificate) -> Option<f64> {
    let scores: Vec<f64> = certificate.views.orbits.iter().filter_map(|o| o.expected.model?.masked_psnr).collect();
    (!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64)
}

/// A line for each frame: its number, what the clock shows, what it is, its bytes and its score.
pub fn print(context: &CommandContext, path: &Path, bytes: &[u8]) -> Result<()> {
    let series = SeriesFile::read(bytes, &name_of(path))?;
    let clock = series.clock.name();
    let keyframes = series.frames.iter().filter(|f| f.kind == FrameCoding::Keyframe).count();
    let mut text =
        format!("series of {} frames, {keyframes} of them keyframes, {} bytes", series.frames.len(), bytes.len());
    let _ = write!(text, "\n{:>6} {clock:>13} {:>9} {:>9} {:>9}", "frame", "kind", "bytes", "PSNR, dB");
    let mut rows = Vec::new();
    for (number, frame) in series.frames.iter().enumerate() {
        let kind = match frame.kind {
            FrameCoding::Missing => {
                let _ = write!(text, "\n{number:>6} {:>13} {:>9}", "", "missing");
                rows.push(json!({ "frame": number, "kind": "missing" }));
                continue;
            }
            FrameCoding::Keyframe => "keyframe",
            FrameCoding::Change => "changes",
        };
        let score = series.certificate(number)?.as_ref().and_then(mean_psnr);
        let shown = score.map_or(String::new(), |v| format!("{v:.2}"));
        let _ = write!(text, "\n{number:>6} {:>13.6} {kind:>9} {:>9} {shown:>9}", frame.time, frame.place.len());
        rows.push(json!({
            "frame": number, "kind": kind, "time": frame.time, "bytes": frame.place.len(), "masked_psnr": score,
        }));
    }
    let recipe: Value = serde_json::from_str(&series.recipe).unwrap_or(Value::Null);
    let report = json!({ "series_bytes": bytes.len(), "clock": clock, "frames": rows, "recipe": recipe });
    context.finish(&text, &report)
}
