//! Options of pictures: their content, and where they are written.

use crate::field_choice::FieldOptions;
use crate::figure_options::FigureOptions;
use crate::film_options::FilmOptions;
use crate::series_film::HaloNumber;
use crate::view_options::ViewOptions;
use particlegs_core::picture::Colormap;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Hint, Result, named_values};
use particlegs_files::output::{Input, Outputs};
use particlegs_train::Accelerator;
use std::path::PathBuf;
use std::sync::Arc;

named_values! {
    /// Styles of pictures of particles, or of a model's Gaussians. The noise-free means are of particles alone: a
    /// model's pictures are without noise.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum PictureStyle {
        #[default]
        Paraview = "paraview":
            "ParaView 6's default picture, with shot noise: dual depth peeling, 8-bit blending, FXAA",
        ParaviewNoFxaa = "paraview-no-fxaa": "The same without antialiasing (FXAA)",
        Expected = "expected": "255 (1 - exp(-tau)) for the optical depth tau: noise-free",
        Response = "response": "Noise-free mean of paraview-no-fxaa",
        ResponseFxaa = "response-fxaa": "Noise-free mean of paraview",
        Density = "density": "Surface density in logarithmic colours, with a colour bar and a scale bar",
    }
}

impl PictureStyle {
    /// The tone of grey levels; none for a density.
    pub(crate) fn tone(self) -> Option<ToneStyle> {
        match self {
            PictureStyle::Paraview | PictureStyle::ResponseFxaa => Some(ToneStyle::Paraview),
            PictureStyle::ParaviewNoFxaa | PictureStyle::Response => Some(ToneStyle::ParaviewNoFxaa),
            PictureStyle::Expected => Some(ToneStyle::Expected),
            PictureStyle::Density => None,
        }
    }

    pub(crate) fn is_mean(self) -> bool {
        matches!(self, PictureStyle::Response | PictureStyle::ResponseFxaa)
    }
}

/// Pictures to be drawn. By default one perspective view of everything, in ParaView's style.
#[derive(Clone, Debug, Default)]
pub struct PictureOptions {
    /// A folder, which gets `NAME.png` of each view, or, for one view, a picture `NAME.png`, `.pdf` or `.svg`; none where
    /// a film alone is written.
    pub output: Option<PathBuf>,
    /// Style of the pictures; ParaView's by default, or that of a density where `field` names a field.
    pub style: Option<PictureStyle>,
    /// Cameras.
    pub view: ViewOptions,
    /// Frames and films.
    pub film: FilmOptions,
    /// Annotations of the pictures.
    pub figure: FigureOptions,
    /// The field that is drawn instead of the density.
    pub field: FieldOptions,
    /// Colours of a density or field: by default inferno, or those of the field's scale.
    pub colormap: Option<Colormap>,
    /// Values of the first and the last colour, in the unit of the density or field; by default the 5th to 99.5th percentile
    /// of occupied pixels.
    pub range: Option<[f64; 2]>,
    /// Whether values are written instead of a picture: NAME.f32 (rows from the top; NAME.f64 where float32 does not hold a
    /// field) and NAME.json.
    pub raw: bool,
    /// Number of neighbours that particles of a density are smoothed over, from 2; points without.
    pub smooth: Option<usize>,
    /// The GPU that draws grey levels; none is the CPU.
    pub device: Option<Arc<dyn Accelerator>>,
}

impl PictureOptions {
    /// Files that the options name.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.view.views, &self.film.path, &self.figure.overlay].into_iter().flatten()
    }

    /// Checks what can be checked before anything is read.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number out of its range, or options that exclude one another.
    pub fn check(&self) -> Result<()> {
        self.view.check()?;
        self.film.check()?;
        self.figure.check()?;
        let positive = self.field.name.is_none();
        match self.range {
            Some([lo, hi]) if !(lo < hi && lo.is_finite() && hi.is_finite() && (lo > 0.0 || !positive)) => {
                let order = if positive { "0 < LO < HI" } else { "LO < HI" };
                Err(Error::argument(format!("the range of colours takes LO,HI with {order}")))
            }
            _ if self.smooth.is_some_and(|k| k < 2) => Err(Error::argument("smoothing takes 2 neighbours or more")),
            _ => Ok(()),
        }
    }

    /// The style; a field has that of a density.
    pub(crate) fn drawn_style(&self) -> PictureStyle {
        if self.field.name.is_some() { PictureStyle::Density } else { self.style.unwrap_or_default() }
    }

    pub(crate) fn refuse_device(&self, message: &str) -> Result<()> {
        let hint = || Hint::from("omit ").option("device", "");
        self.device.as_ref().map_or(Ok(()), |_| Err(Error::argument_with(message, hint())))
    }

    pub(crate) fn declare<'a>(&self, files: impl Iterator<Item = &'a PathBuf>, outputs: &Outputs) {
        files.for_each(|file| outputs.reads(Input::Data(file.clone())));
    }
}

/// Pictures of models.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// Pictures; smoothing is for particles alone.
    pub pictures: PictureOptions,
    /// Layers to be drawn, by name or species; empty: all.
    pub layers: Vec<String>,
    /// Whether hues tell layers apart, mixed by optical depth.
    pub color_by_layer: bool,
    /// A PNG of this program whose camera, style, colours and range are used where no option says otherwise.
    pub like: Option<PathBuf>,
    /// Whether all models and views are drawn in one figure, with one range and colour bar.
    pub panels: bool,
    /// Panels per row: by default one per model, or up to three for a single model.
    pub columns: Option<usize>,
    /// Captions of the panels, row by row; empty: names of models and views.
    pub captions: Vec<String>,
    /// The halo that the camera follows through a film of a series: from the frame of its list on, the centre moves with the
    /// mass within the halo's radius.
    pub follow: Option<HaloNumber>,
}

impl RenderOptions {
    /// Files that the options name.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.pictures.files().chain(&self.like).chain(self.follow.iter().map(|halo| &halo.file))
    }

    /// Checks what can be checked before anything is read.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number out of its range, or options that exclude one another.
    pub fn check(&self) -> Result<()> {
        self.pictures.check()?;
        if self.pictures.smooth.is_some() {
            return Err(Error::argument("smoothing has no effect on models: it is for particles"));
        }
        if self.pictures.field.name.is_some() && self.color_by_layer {
            return Err(Error::argument("colours by layer have no effect on a field, which has colours of its own"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film_options::FilmLength;

    #[test]
    fn options_check_themselves() {
        let outcome = |options: PictureOptions| {
            let options = RenderOptions { pictures: options, ..RenderOptions::default() };
            options.check().map_err(|e| e.to_string())
        };
        assert_eq!(outcome(PictureOptions::default()), Ok(()));
        let refused = |options: PictureOptions, words: &str| {
            let error = outcome(options).unwrap_err();
            assert!(error.contains(words), "{error}");
        };
        let plain = PictureOptions::default;
        let view = |view| PictureOptions { view, ..plain() };
        refused(
            view(ViewOptions { distance: f64::NAN, ..ViewOptions::default() }),
            "the distance NaN must be positive",
        );
        refused(view(ViewOptions { depth: Some(0.0), ..ViewOptions::default() }), "the depth 0 must be positive");
        let film = |film| PictureOptions { film, ..plain() };
        refused(film(FilmOptions { fps: 0, ..FilmOptions::default() }), "0 frames per second");
        refused(film(FilmOptions { frames: Some(FilmLength::Pictures(0)), ..FilmOptions::default() }), "0 frames");
        let figure = FigureOptions { dpi: Some(f64::NAN), ..FigureOptions::default() };
        refused(PictureOptions { figure, ..plain() }, "from 10 to 10000 pixels per inch, not NaN");
        refused(PictureOptions { range: Some([-1.0, 1.0]), ..plain() }, "0 < LO < HI");
        let field = FieldOptions { name: Some("velocity.los".into()), ..FieldOptions::default() };
        assert_eq!(outcome(PictureOptions { range: Some([-1.0, 1.0]), field, ..plain() }), Ok(()));
        refused(PictureOptions { smooth: Some(8), ..plain() }, "for particles");
    }
}
