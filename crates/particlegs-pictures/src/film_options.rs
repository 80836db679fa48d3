//! Frames of a film: a turn around the vertical axis, or a path through key frames.

use particlegs_core::camera::{View, ViewSet, path_through};
use particlegs_core::{Error, Hint, Result};
use std::path::PathBuf;
use std::str::FromStr;

/// Most frames of a film.
const MOST: usize = 100_000;
/// Default number of frames from each key frame to the next.
const BETWEEN_KEYS: usize = 60;

/// Frames and films.
#[derive(Clone, Debug)]
pub struct FilmOptions {
    /// Frames of one turn around the vertical axis: frame_0000.png, ...
    pub turntable: Option<usize>,
    /// A views file whose views are key frames: positions, orientations and distances change smoothly, and pass through
    /// every key frame.
    pub path: Option<PathBuf>,
    /// Number of frames of the path, by default 60 from each key frame to the next, or of a film of a series.
    pub frames: Option<FilmLength>,
    /// The film: NAME.mp4 or NAME.webm, which need ffmpeg, or NAME.gif.
    pub video: Option<PathBuf>,
    /// Frames per second of the film, from 1 to 100.
    pub fps: u32,
}

impl Default for FilmOptions {
    fn default() -> Self {
        FilmOptions { turntable: None, path: None, frames: None, video: None, fps: 30 }
    }
}

/// Number of pictures of a film: `all`, or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmLength {
    /// As many as a series has frames.
    All,
    /// So many, evenly over the time of a series.
    Pictures(usize),
}

impl FromStr for FilmLength {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<FilmLength, String> {
        match text.parse() {
            _ if text == "all" => Ok(FilmLength::All),
            Ok(number) if (1..=MOST).contains(&number) => Ok(FilmLength::Pictures(number)),
            _ => Err(format!("give a number from 1 to {MOST}, or all")),
        }
    }
}

impl FilmOptions {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for one out of its range.
    pub fn check(&self) -> Result<()> {
        let pictures = if let Some(FilmLength::Pictures(number)) = self.frames { Some(number) } else { None };
        if let Some(number) = self.turntable.into_iter().chain(pictures).find(|n| !(1..=MOST).contains(n)) {
            return Err(Error::argument(format!("{number} frames of a film are outside 1 to {MOST}")));
        }
        match (1..=100).contains(&self.fps) {
            true => Ok(()),
            false => Err(Error::argument(format!("{} frames per second are outside 1 to 100", self.fps))),
        }
    }

    /// Whether the pictures are frames of a sequence.
    pub(crate) fn is_asked_for(&self) -> bool {
        self.turntable.is_some() || self.path.is_some() || self.frames.is_some()
    }

    /// Rotations of the view in degrees.
    pub(crate) fn turns(&self) -> Vec<f64> {
        let turns = |n| (0..n).map(|i| 360.0 * i as f64 / n as f64).collect();
        self.turntable.map(turns).unwrap_or_default()
    }

    /// The frames of these views, `of_series` as many as a film of a series has pictures; without a film the views
    /// themselves.
    pub(crate) fn frames(&self, set: ViewSet, of_series: Option<usize>) -> Result<ViewSet> {
        let turned = |frames: usize| match &set.views[..] {
            [one] => Ok(one.turntable(frames)),
            many => {
                let message = format!("a turntable and a film of a series take one view, but there are {}", many.len());
                Err(Error::argument_with(message, "name a views file with one view"))
            }
        };
        let views = match (self.turntable, &self.path, of_series) {
            (Some(frames), _, None) => turned(frames)?,
            (turn, None, Some(pictures)) => {
                let around = turned(turn.unwrap_or(1))?;
                // The turn starts again where the series has more pictures than it has.
                let camera = |i: usize| around[i % around.len()].camera;
                turned(pictures)?.into_iter().enumerate().map(|(i, v)| View { camera: camera(i), ..v }).collect()
            }
            (_, Some(_), _) => {
                let frames = match (of_series, self.frames) {
                    (Some(pictures), _) => pictures,
                    (None, None) => BETWEEN_KEYS * (set.views.len() - 1) + 1,
                    (None, Some(FilmLength::Pictures(number))) => number,
                    (None, Some(FilmLength::All)) => {
                        return Err(Error::argument("all frames are those of a series, but this is none"));
                    }
                };
                if frames > MOST {
                    let hint = Hint::from("choose ").option("frames", "N").words(format!(" up to {MOST}"));
                    return Err(Error::argument_with(format!("{frames} frames are too many"), hint));
                }
                path_through(&set.views, frames).map_err(|e| Error::argument(format!("the path: {e}")))?
            }
            (None, None, None) if self.frames.is_some() => {
                let message = "a number of frames has no effect here; it applies to a path and to series";
                return Err(Error::argument_with(message, Hint::from("add ").option("path", "FILE")));
            }
            (None, None, None) if self.video.is_some() => {
                let message = "a film has no effect here; it is made of a turntable, a path or a series";
                let hint = Hint::from("add ").option("turntable", "N").words(" or ").option("path", "FILE");
                return Err(Error::argument_with(message, hint));
            }
            (None, None, None) => set.views,
        };
        Ok(ViewSet { size: set.size, views })
    }
}
