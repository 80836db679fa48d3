//! Frames of a film: a turn around the vertical axis, or a path through key frames.

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueHint};
use particlegs_pipeline::camera::{ViewSet, path_through};
use particlegs_pipeline::{Error, Result};
use std::path::PathBuf;

/// Most frames of a film.
const MOST: u64 = 100_000;
/// Default number of frames from each key frame to the next.
const BETWEEN_KEYS: usize = 60;

/// Options of frames and films.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Films")]
pub struct SequenceArgs {
    /// Draw N frames of one turn around the vertical axis: frame_0000.png, ...
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "path",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=MOST)
    )]
    pub turntable: Option<usize>,
    /// Move the camera through the views of a views file, used as key frames.
    ///
    /// Positions, orientations and distances change smoothly, and pass through every key frame.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath, conflicts_with = "views")]
    pub path: Option<PathBuf>,
    /// Number of frames of the path [default: 60 from each key frame to the next].
    #[arg(
        long,
        value_name = "N",
        hide_short_help = true,
        requires = "path",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=MOST)
    )]
    pub frames: Option<usize>,
    /// Join the frames into a film: NAME.mp4 or NAME.webm (both need ffmpeg), or NAME.gif.
    ///
    /// Without ffmpeg the frames are kept, and the command that joins them is printed.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    pub video: Option<PathBuf>,
    /// Frames per second of the film.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 30,
        hide_short_help = true,
        requires = "video",
        value_parser = clap::value_parser!(u32).range(1..=100)
    )]
    pub fps: u32,
}

impl SequenceArgs {
    /// Are the pictures frames of a sequence?
    pub fn is_asked_for(&self) -> bool {
        self.turntable.is_some() || self.path.is_some()
    }

    /// Rotations of the view in degrees.
    pub fn turns(&self) -> Vec<f64> {
        let turns = |n| (0..n).map(|i| 360.0 * i as f64 / n as f64).collect();
        self.turntable.map(turns).unwrap_or_default()
    }

    /// The frames of these views; without a film the views themselves.
    pub fn frames(&self, set: ViewSet) -> Result<ViewSet> {
        let views = match (self.turntable, &self.path) {
            (Some(frames), _) => match &set.views[..] {
                [one] => one.turntable(frames),
                many => {
                    let what = format!("--turntable turns one view, but there are {}", many.len());
                    return Err(Error::argument_with(what, "name a views file with one view"));
                }
            },
            (None, Some(_)) => {
                let frames = self.frames.unwrap_or(BETWEEN_KEYS * (set.views.len() - 1) + 1);
                if frames as u64 > MOST {
                    return Err(Error::argument(format!("{frames} frames are too many: choose --frames up to {MOST}")));
                }
                path_through(&set.views, frames).map_err(|e| Error::argument(format!("--path: {e}")))?
            }
            (None, None) if self.video.is_some() => {
                let what = "--video has no effect here; it applies to --turntable and --path";
                return Err(Error::argument_with(what, "add --turntable N or --path FILE"));
            }
            (None, None) => set.views,
        };
        Ok(ViewSet { size: set.size, views })
    }
}
