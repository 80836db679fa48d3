//! Frames of a film: a turn around the vertical axis, or a path through key frames.

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueHint};
use particlegs_core::camera::{View, ViewSet, path_through};
use particlegs_core::{Error, Result};
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
    /// Number of frames of the path [default: 60 from each key frame to the next], or of a film of a series.
    ///
    /// `all` draws each frame of a series once; a number is spread evenly over its time, and pictures between frames are
    /// interpolated. --turntable N then turns the camera once in N pictures.
    #[arg(long, value_name = "N|all", hide_short_help = true, value_parser = film_length)]
    pub frames: Option<FilmLength>,
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

/// Number of pictures of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmLength {
    /// As many as a series has frames.
    All,
    Pictures(usize),
}

fn film_length(text: &str) -> std::result::Result<FilmLength, String> {
    match text.parse() {
        _ if text == "all" => Ok(FilmLength::All),
        Ok(number) if (1..=MOST as usize).contains(&number) => Ok(FilmLength::Pictures(number)),
        _ => Err(format!("give a number from 1 to {MOST}, or all")),
    }
}

impl SequenceArgs {
    /// Are the pictures frames of a sequence?
    pub fn is_asked_for(&self) -> bool {
        self.turntable.is_some() || self.path.is_some() || self.frames.is_some()
    }

    /// Rotations of the view in degrees.
    pub fn turns(&self) -> Vec<f64> {
        let turns = |n| (0..n).map(|i| 360.0 * i as f64 / n as f64).collect();
        self.turntable.map(turns).unwrap_or_default()
    }

    /// The frames of these views, `of_series` as many as a film of a series has pictures; without a film the views
    /// themselves.
    pub fn frames(&self, set: ViewSet, of_series: Option<usize>) -> Result<ViewSet> {
        let turned = |frames: usize| match &set.views[..] {
            [one] => Ok(one.turntable(frames)),
            many => {
                let what = format!("--turntable and --frames take one view, but there are {}", many.len());
                Err(Error::argument_with(what, "name a views file with one view"))
            }
        };
        let views = match (self.turntable, &self.path, of_series) {
            (Some(frames), _, None) => turned(frames)?,
            (turn, None, Some(pictures)) => {
                let around = turned(turn.unwrap_or(1))?;
                let camera = |i: usize| around[i % around.len()].camera;
                turned(pictures)?.into_iter().enumerate().map(|(i, v)| View { camera: camera(i), ..v }).collect()
            }
            (_, Some(_), _) => {
                let frames = match (of_series, self.frames) {
                    (Some(pictures), _) => pictures,
                    (None, None) => BETWEEN_KEYS * (set.views.len() - 1) + 1,
                    (None, Some(FilmLength::Pictures(number))) => number,
                    (None, Some(FilmLength::All)) => {
                        return Err(Error::argument("--frames all takes a series"));
                    }
                };
                if frames as u64 > MOST {
                    return Err(Error::argument(format!("{frames} frames are too many: choose --frames up to {MOST}")));
                }
                path_through(&set.views, frames).map_err(|e| Error::argument(format!("--path: {e}")))?
            }
            (None, None, None) if self.frames.is_some() => {
                let what = "--frames has no effect here; it applies to --path and to series";
                return Err(Error::argument_with(what, "add --path FILE"));
            }
            (None, None, None) if self.video.is_some() => {
                let what = "--video has no effect here; it applies to --turntable, --path and --frames";
                return Err(Error::argument_with(what, "add --turntable N or --path FILE"));
            }
            (None, None, None) => set.views,
        };
        Ok(ViewSet { size: set.size, views })
    }
}
