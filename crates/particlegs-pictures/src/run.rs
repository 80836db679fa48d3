//! Draws views into files, as single pictures or as frames, and reports them. A report has the keys of a views file, and can
//! be read as one.

use crate::density_file;
use crate::film::{Film, FilmFormat};
use crate::finish::Finisher;
use crate::frames::{self, FrameOutputs};
use crate::options::{PictureOptions, PictureStyle};
use crate::picture_out::PictureOut;
use crate::provenance::PictureProvenance;
use crate::series_film::SeriesFilm;
use crate::subject::{Quantities, ViewSubject};
use crate::view_content::{ViewContent, ViewRenderer};
use particlegs_core::camera::{DensityView, View, ViewSet};
use particlegs_core::context::Context;
use particlegs_core::{Error, Hint, Result};
use particlegs_figure::FileKind;
use particlegs_files::ViewsFile;
use particlegs_files::output::Outputs;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Everything that a drawing needs.
pub struct DrawingJob<'a> {
    pub painter: &'a ViewRenderer<'a>,
    pub finish: &'a Finisher<'a>,
    pub set: &'a ViewSet,
    /// Whether a dark picture gets a hint.
    pub hints: bool,
    pub options: &'a PictureOptions,
    pub outputs: &'a Outputs,
    pub context: &'a Context<'a>,
}

impl PictureOptions {
    /// The views of the file or the options, with the options applied; key frames become a path. A film of a series has as
    /// many as it has pictures.
    pub(crate) fn views(
        &self,
        given: Option<ViewSet>,
        film: Option<&SeriesFilm<'_>>,
        subject: &ViewSubject,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<ViewSet> {
        let (view, film_options) = (&self.view, &self.film);
        let mut set = match (given, view.views.as_ref().or(film_options.path.as_ref())) {
            (Some(set), _) => set,
            (None, Some(path)) => ViewsFile::read(path, context)?.0,
            // A turn must show everything from every side, so its one view is fitted to all of them.
            (None, None) => view.one_view(subject, &film_options.turns())?,
        };
        view.apply(&mut set)?;
        let mut set = film_options.frames(set, film.map(|film| film.stamps.len()))?;
        film.iter().for_each(|film| film.move_views(&mut set));
        view.save(&set, outputs, context)?;
        Ok(set)
    }

    /// The record of these options in files, without each picture's view and range.
    pub(crate) fn provenance(&self, style: &str, quantities: &Quantities) -> PictureProvenance {
        let density = style == PictureStyle::Density.name();
        PictureProvenance {
            particlegs: env!("CARGO_PKG_VERSION").into(),
            style: style.into(),
            colormap: density.then(|| self.colormap.unwrap_or_default().name().into()),
            unit: density.then(|| quantities.unit()),
            background: self.figure.background.map(|b| b.name().into()),
            ..PictureProvenance::default()
        }
    }

    /// The views at the size that the resolution asks for, with this number of pictures per row.
    pub(crate) fn resolved(&self, set: ViewSet, columns: usize) -> ViewSet {
        let kind = self.output.as_deref().and_then(FileKind::from_path).unwrap_or(FileKind::Png);
        let resolved = self.figure.resolved(set.size, kind, columns).filter(|_| self.view.size.is_none());
        ViewSet { size: resolved.unwrap_or(set.size), ..set }
    }
}

impl PictureReport {
    /// The report of views.
    pub(crate) fn of(self, set: &ViewSet) -> PictureReport {
        PictureReport { width: set.size.width, height: set.size.height, fov_deg: set.fov_deg(), ..self }
    }
}

impl DrawingJob<'_> {
    /// Draws views into files.
    pub fn draw(&self) -> Result<PictureReport> {
        let DrawingJob { finish, set, options, outputs, context, .. } = *self;
        let (raw, named) = (options.raw, options.output.as_deref());
        let plan = |path: &PathBuf| Film::plan(path, options.film.fps, named, outputs, context);
        let film = options.film.video.as_ref().map(plan).transpose()?;
        let folder = named.or(film.as_ref().and_then(Film::frames));
        let out = folder.map(|path| PictureOut::new(path, set.views.len(), raw, outputs)).transpose()?;
        if film.as_ref().is_some_and(|f| f.form != FilmFormat::Gif) && !matches!(out, Some(PictureOut::Folder(_))) {
            let message = "a film needs a folder for its frames, but the output is a picture";
            let hint = Hint::from("name a folder, or omit ").option("output", "");
            return Err(Error::argument_with(message, hint));
        }
        if let Some(out) = &out {
            match raw {
                true => density_file::declare(out, &set.views, outputs, context)?,
                false => drop(out.pictures(set.views.iter().map(|v| &v.name[..]), outputs, context)?),
            }
        }
        let kind = out.as_ref().map_or(FileKind::Png, PictureOut::kind);
        if let Some(note) = set.views.first().filter(|_| !raw).and_then(|v| finish.note(v, set.size, kind)) {
            context.note(&note);
        }
        match out {
            out if options.film.is_asked_for() && !raw => self.sequence(film.as_ref(), out.as_ref()),
            Some(out) => self.one_by_one(&out),
            None => Err(Error::argument_with("no output is named", Hint::from("name one with ").option("output", ""))),
        }
    }

    fn one_by_one(&self, out: &PictureOut) -> Result<PictureReport> {
        let DrawingJob { painter, finish, set, context, options, .. } = *self;
        let range = options.range;
        let mut views = Vec::with_capacity(set.views.len());
        for view in &set.views {
            let started = Instant::now();
            let mut seconds = 0.0;
            let outcome = (painter.draw)(view, set.size).and_then(|content| {
                seconds = started.elapsed().as_secs_f64();
                content.say_if_empty(view, context);
                if let Some(grey) = content.dark().filter(|_| self.hints && views.is_empty()) {
                    context.note(&format!("the picture is dark, as ParaView's would be (mean grey {grey:.1} of 255): the style density shows more"));
                }
                match content {
                    ViewContent::Density(_) | ViewContent::Field(..) if options.raw => {
                        let view = finish.subject.density_view(view, set.size);
                        density_file::write_content(out, &view, &content, finish.quantities, finish.field.as_ref())
                    }
                    content => {
                        let path = out.picture(&view.name);
                        finish.write(&path, content, view, range, out.kind()).map(|()| path)
                    }
                }
            });
            let path = out.count(views.len(), set.views.len(), outcome, context)?;
            views.push(RenderedView::new(view, finish.subject, seconds, Some(path)));
        }
        Ok(PictureReport { views, range, ..PictureReport::default() })
    }

    fn sequence(&self, film: Option<&Film>, out: Option<&PictureOut>) -> Result<PictureReport> {
        let DrawingJob { finish, set, context, .. } = *self;
        let started = Instant::now();
        let gif = film.filter(|f| f.form == FilmFormat::Gif).map(|f| f.fps);
        let frame_series = frames::draw(self, &FrameOutputs { files: out, gif })?;
        let mut lines = vec![format!("{} frames in {:.2} s", set.views.len(), started.elapsed().as_secs_f64())];
        let mut passing = false;
        if let Some(film) = film {
            let started = Instant::now();
            let names: Vec<String> = set.views.iter().map(|v| v.name.clone()).collect();
            film.join(&frame_series.gif, out, &names, context)?;
            passing = film.is_passing();
            let seconds = started.elapsed().as_secs_f64();
            lines.push(format!("{} written in {seconds:.2} s", film.path().display()));
        }
        let path = |name: &str| out.filter(|_| !passing).map(|o| o.picture(name));
        let with_seconds = set.views.iter().zip(&frame_series.seconds);
        let views = with_seconds.map(|(v, s)| RenderedView::new(v, finish.subject, *s, path(&v.name))).collect();
        Ok(PictureReport { views, range: frame_series.range, lines, ..PictureReport::default() })
    }
}

/// Pictures that were drawn, of models or of particles.
#[derive(Debug, Default, Serialize)]
pub struct PictureReport {
    /// The style's name.
    pub style: String,
    /// Number of Gaussians of all models.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaussians: Option<usize>,
    /// Number of particles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub particles: Option<u64>,
    /// Number of neighbours that were smoothed over, and the seconds to find them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smooth: Option<usize>,
    /// Seconds of that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smooth_seconds: Option<f64>,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Vertical angle of view in degrees; none of orthographic pictures.
    pub fov_deg: Option<f64>,
    /// Values of the first and last colour, if all pictures share one range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// The pictures.
    pub views: Vec<RenderedView>,
    /// In words, what was written of a film or a figure of panels.
    #[serde(skip)]
    pub lines: Vec<String>,
}

/// A picture of a view.
#[derive(Debug, Serialize)]
pub struct RenderedView {
    /// The view; a surface density has no radius and opacity.
    #[serde(flatten)]
    pub view: View,
    /// Seconds to draw it, of a frame also to write it.
    pub seconds: f64,
    /// Its file, unless it only went into a film.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// Of particles in grey levels, their radius in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_px: Option<f64>,
    /// Of particles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub particles_per_second: Option<f64>,
}

impl RenderedView {
    /// The picture of a view of a model.
    pub(crate) fn new(view: &View, subject: &ViewSubject, seconds: f64, path: Option<PathBuf>) -> Self {
        let mut view = view.clone();
        if subject.density {
            view.camera.clipping_range = Some(DensityView::of_view(&view, &subject.bounds).range);
        }
        let path = path.map(|p| p.to_string_lossy().into_owned());
        RenderedView { view, seconds, path, radius_px: None, particles_per_second: None }
    }
}
