//! Which views to draw: a views file, or one camera described in words. Shared by `reference` and
//! `render`.

use crate::common::Context;
use crate::outputs::JSON;
use clap::{Args, ValueHint};
use particlegs::camera::{View, ViewSet, ViewsFile, base_distance, spherical_camera};
use particlegs::picture::Size;
use particlegs::space::Bounds;
use particlegs::{Error, Result};
use particlegs_files::output::write_bytes;
use std::path::PathBuf;

/// Which views, and how particles look in them.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "View options")]
pub struct ViewArgs {
    /// Views file (JSON): draw one picture per view.
    ///
    /// Without it a single view named `view` is drawn, from --azimuth, --elevation and --distance.
    /// docs/guide/pictures.md describes the file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub views: Option<PathBuf>,
    /// Write the views that are drawn as a views file.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    pub save_views: Option<PathBuf>,
    /// Azimuth of the camera in degrees.
    ///
    /// 0 looks along -z, 90 along -x.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, conflicts_with = "views")]
    pub azimuth: f64,
    /// Elevation of the camera above the horizon in degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, conflicts_with = "views")]
    pub elevation: f64,
    /// Distance of the camera from the centre, in base distances.
    ///
    /// 1 is 0.65 of the distance of ParaView's Reset Camera (docs/guide/pictures.md).
    #[arg(long, value_name = "D", default_value_t = 1.0, conflicts_with = "views")]
    pub distance: f64,
    /// Particle radius in world units [default: the view's, else the default].
    ///
    /// The default is that of the model, or 0.0406 of the mean particle spacing.
    #[arg(long, value_name = "R")]
    pub radius: Option<f64>,
    /// Particle opacity, in (0, 1] [default: the view's, else the default].
    ///
    /// The default is that of the model, or 0.05.
    #[arg(long, value_name = "A")]
    pub opacity: Option<f64>,
    /// Picture size in pixels [default: the views file's, else 1920x1080].
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<Size>,
}

/// What a snapshot or a model says about how to look at it.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    /// Bounds of the whole snapshot, world units.
    pub bounds: Bounds,
    /// Default particle radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
}

impl ViewArgs {
    /// The views, every one checked.
    ///
    /// # Errors
    /// [`Error::Input`] or [`Error::Io`] for a views file that cannot be used; [`Error::Argument`]
    /// for a number outside its range.
    pub fn resolve(&self, subject: &Subject, context: &Context) -> Result<ViewSet> {
        let mut file = match &self.views {
            Some(path) => ViewsFile::read(path, context)?,
            None => ViewsFile(self.one_view(subject)?),
        };
        let ViewsFile(set) = &mut file;
        if let Some(size) = self.size {
            set.size = size;
        }
        for view in &mut set.views {
            view.radius = self.radius.unwrap_or(view.radius);
            view.opacity = self.opacity.unwrap_or(view.opacity);
            view.check(set.size)?;
        }
        if let Some(path) = &self.save_views {
            context.writes(path, &JSON)?;
            write_bytes(path, file.text()?.as_bytes())?;
        }
        Ok(file.0)
    }

    fn one_view(&self, subject: &Subject) -> Result<ViewSet> {
        if !(self.distance > 0.0 && self.distance.is_finite()) {
            return Err(Error::argument(format!("--distance {} must be positive", self.distance)));
        }
        for (name, degrees) in [("azimuth", self.azimuth), ("elevation", self.elevation)] {
            if !degrees.is_finite() {
                return Err(Error::argument(format!("--{name} {degrees} is not a finite angle")));
            }
        }
        let size = self.size.unwrap_or(Size { width: 1920, height: 1080 });
        let distance = self.distance * base_distance(&subject.bounds, size);
        let camera = spherical_camera(subject.bounds.center(), self.azimuth, self.elevation, distance);
        let view = View { name: "view".into(), camera, radius: subject.radius, opacity: subject.opacity };
        Ok(ViewSet { size, views: vec![view] })
    }
}

/// `1920x1080`.
pub fn parse_size(text: &str) -> std::result::Result<Size, String> {
    let fail = || format!("`{text}` is not a picture size: give WIDTHxHEIGHT, such as 1920x1080, each from 1 to 32768");
    let (w, h) = text.split_once(['x', 'X']).ok_or_else(fail)?;
    let side = |t: &str| t.trim().parse::<usize>().ok().filter(|n| (1..=32_768).contains(n));
    match (side(w), side(h)) {
        (Some(width), Some(height)) => Ok(Size { width, height }),
        _ => Err(fail()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(parse_size("640x360"), Ok(Size { width: 640, height: 360 }));
        for bad in ["", "640", "0x5", "-1x5", "5x99999", "axb"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }
}
