//! Frames of a film: a turn around the vertical axis, or a path through key frames.

use clap::{Args, ValueHint};
use particlegs_pictures::{FilmLength, FilmOptions};
use std::path::PathBuf;

/// Options of frames and films.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Films")]
pub struct SequenceArgs {
    /// Draw N frames of one turn around the vertical axis: frame_0000.png, ...
    #[arg(long, value_name = "N", conflicts_with = "path")]
    pub turntable: Option<usize>,
    /// Move the camera through the views of a views file, used as key frames.
    ///
    /// Positions, orientations and distances change smoothly, and pass through every key frame.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath, conflicts_with = "views")]
    pub path: Option<PathBuf>,
    /// Number of frames of the path [default: 60 from each key frame to the next], or of a film of a series.
    ///
    /// `all` draws each frame of a series once; a number is spread evenly over its time, and pictures between frames are
    /// interpolated. --turntable N then turns the camera once in N pictures.
    #[arg(long, value_name = "N|all", hide_short_help = true)]
    pub frames: Option<FilmLength>,
    /// Join the frames into a film: NAME.mp4 or NAME.webm (both need ffmpeg), or NAME.gif.
    ///
    /// Without ffmpeg the frames are kept, and the command that joins them is printed.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    pub video: Option<PathBuf>,
    /// Frames per second of the film.
    #[arg(long, value_name = "N", default_value_t = 30, hide_short_help = true, requires = "video")]
    pub fps: u32,
}

impl SequenceArgs {
    pub fn options(&self) -> FilmOptions {
        let (path, video) = (self.path.clone(), self.video.clone());
        FilmOptions { turntable: self.turntable, path, frames: self.frames, video, fps: self.fps }
    }
}
