//! Output of `info` for a series.

use crate::common::CommandContext;
use particlegs::{FrameDescription, Series};
use particlegs_core::Result;
use std::fmt::Write;

/// A line for each frame: its number, what the clock shows, what it is, its bytes and its score.
pub fn print(context: &CommandContext, series: &Series) -> Result<()> {
    let description = series.describe()?;
    let keyframes =
        description.frames.iter().filter(|f| matches!(f, FrameDescription::There { kind: "keyframe", .. })).count();
    let (frames, bytes, clock) = (description.frames.len(), description.series_bytes, description.clock);
    let mut text = format!("series of {frames} frames, {keyframes} of them keyframes, {bytes} bytes");
    let _ = write!(text, "\n{:>6} {clock:>13} {:>9} {:>9} {:>9}", "frame", "kind", "bytes", "PSNR, dB");
    for frame in &description.frames {
        let _ = match frame {
            FrameDescription::Missing { frame, kind } => write!(text, "\n{frame:>6} {:>13} {kind:>9}", ""),
            FrameDescription::There { frame, kind, time, bytes, masked_psnr } => {
                let psnr = masked_psnr.map_or(String::new(), |v| format!("{v:.2}"));
                write!(text, "\n{frame:>6} {time:>13.6} {kind:>9} {bytes:>9} {psnr:>9}")
            }
        };
    }
    context.finish(&text, &description)
}
