//! Joins frames into a film, with ffmpeg, or without it into a GIF.

use crate::gif::{self, GifFrame};
use crate::picture_out::PictureOut;
use particlegs_core::camera::frame_digits;
use particlegs_core::context::Context;
use particlegs_core::text::shell_word;
use particlegs_core::{Error, Result};
use particlegs_files::output::{FileSet, Outputs, kinds};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Format of a film, by its extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// H.264, which everything plays.
    Mp4,
    /// VP9.
    Webm,
    /// Needs no other program.
    Gif,
}

/// A film to be made.
pub struct Film {
    path: PathBuf,
    pub form: FilmFormat,
    /// Frames per second.
    pub fps: u32,
    /// Folder of the frames, if they are files.
    frames: Option<PathBuf>,
    /// Whether the frames are removed when the film is complete.
    passing: bool,
}

impl Film {
    /// A film whose frames go to the named folder, or to one beside the film.
    pub fn plan(path: &Path, fps: u32, out: Option<&Path>, outputs: &Outputs, context: &Context<'_>) -> Result<Film> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let (form, kind) = match &ending[..] {
            "mp4" => (FilmFormat::Mp4, &kinds::MP4),
            "webm" => (FilmFormat::Webm, &kinds::WEBM),
            "gif" => (FilmFormat::Gif, &kinds::GIF),
            _ => {
                let message = format!("{}: the name of a film ends in .mp4, .webm or .gif", path.display());
                return Err(Error::argument(message));
            }
        };
        outputs.writes(path, kind, context)?;
        let beside = || {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            path.with_file_name(format!("{stem}-frames"))
        };
        let frames = match (out, form) {
            (Some(folder), _) => Some(folder.to_path_buf()),
            (None, FilmFormat::Gif) => None,
            (None, _) => Some(beside()),
        };
        Ok(Film { path: path.to_path_buf(), form, fps, frames, passing: out.is_none() })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn is_passing(&self) -> bool {
        self.passing
    }

    pub fn frames(&self) -> Option<&Path> {
        self.frames.as_deref()
    }

    /// Joins the frames.
    pub fn join(
        &self,
        gif: &[GifFrame],
        out: Option<&PictureOut>,
        names: &[String],
        context: &Context<'_>,
    ) -> Result<()> {
        if self.form == FilmFormat::Gif {
            return gif::write(&self.path, gif);
        }
        let folder = self.frames.as_deref().unwrap_or(Path::new("."));
        // A film appears only when it is complete: ffmpeg would leave a broken one where it fails.
        let set = FileSet::in_folder(parent(&self.path))?;
        let staged = set.path().join(self.path.file_name().unwrap_or_default());
        context.begin("joining frames with ffmpeg", 0);
        let outcome = run(&self.arguments(folder, names.len(), &staged)).and_then(|()| there(&staged));
        context.end();
        // Ctrl-C ends ffmpeg as well, and its failure is then no error of its own.
        context.check()?;
        if let Err(why) = outcome {
            let arguments = self.arguments(folder, names.len(), &self.path);
            let message = format!("{why}; the frames are kept, and this command joins them: {}", line(&arguments));
            return Err(Error::io(&self.path, std::io::Error::other(message)));
        }
        set.finish()?;
        if let Some(out) = out.filter(|_| self.passing) {
            // Remaining frames do no harm.
            names.iter().for_each(|name| drop(std::fs::remove_file(out.picture(name))));
            let _ = std::fs::remove_dir(folder);
        }
        Ok(())
    }

    /// Arguments for ffmpeg.
    fn arguments(&self, folder: &Path, frames: usize, to: &Path) -> Vec<String> {
        // A percent sign begins the number of a frame in ffmpeg's pattern.
        let folder = folder.to_string_lossy().replace('%', "%%");
        // With `file:`, since ffmpeg would take a colon for a protocol and a dash for an option.
        let pattern = format!("file:{folder}/frame_%0{}d.png", frame_digits(frames));
        let fps = self.fps.to_string();
        // The encoders need even widths and heights.
        let even = "crop=trunc(iw/2)*2:trunc(ih/2)*2";
        // VP9 keeps the quality of `-crf` only if `-b:v 0` takes away its bound on the bit rate.
        let coder: &[&str] = match self.form {
            FilmFormat::Mp4 => &["-c:v", "libx264", "-crf", "18", "-preset", "fast", "-movflags", "+faststart"],
            _ => &[
                "-c:v",
                "libvpx-vp9",
                "-crf",
                "30",
                "-b:v",
                "0",
                "-row-mt",
                "1",
                "-deadline",
                "good",
                "-cpu-used",
                "4",
            ],
        };
        let lead = ["-v", "error", "-nostdin", "-y", "-framerate", &fps, "-i", &pattern, "-vf", even];
        // Many players decode no other sampling of colours than this.
        let end = ["-pix_fmt", "yuv420p"];
        let path = format!("file:{}", to.to_string_lossy());
        lead.iter().chain(coder).chain(&end).map(|a| a.to_string()).chain([path]).collect()
    }
}

fn parent(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Runs ffmpeg; returns why it failed, if so.
fn run(arguments: &[String]) -> std::result::Result<(), String> {
    let output = Command::new("ffmpeg").args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).output();
    match output {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Err("ffmpeg is not installed".into()),
        Err(e) => Err(format!("ffmpeg cannot be run: {e}")),
        Ok(out) if out.status.success() => Ok(()),
        Ok(out) => {
            let stderr = String::from_utf8_lossy(&out.stderr);
            let last = stderr.lines().rfind(|l| !l.trim().is_empty()).unwrap_or("no message");
            Err(format!("ffmpeg failed: {last}"))
        }
    }
}

/// Checks the file itself, not the exit code of ffmpeg.
fn there(film: &Path) -> std::result::Result<(), String> {
    let bytes = film.metadata().map_or(0, |m| m.len());
    if bytes > 0 { Ok(()) } else { Err("ffmpeg wrote no film".into()) }
}

/// The command as text for a shell.
fn line(arguments: &[String]) -> String {
    let words = arguments.iter().map(|a| shell_word(a));
    std::iter::once("ffmpeg".to_string()).chain(words).collect::<Vec<_>>().join(" ")
}
