//! Draws views into files, as single pictures or as frames, and reports them. Shared by `render` and `reference`.

use super::ViewContent;
use super::film::{Film, FilmFormat};
use super::frames::{self, FrameOutputs};
use super::job::DrawingJob;
use super::series_film::SeriesFilm;
use crate::common::CommandContext;
use crate::density_args::DensityArgs;
use crate::figure::FileKind;
use crate::picture_out::PictureOut;
use crate::rendered_view::RenderedView;
use crate::sequence_args::SequenceArgs;
use crate::view_args::{ViewArgs, ViewSubject};
use particlegs_core::camera::ViewSet;
use particlegs_core::{Error, Result};
use particlegs_files::ViewsFile;
use std::path::Path;
use std::time::Instant;

/// Results for a report.
pub struct DrawingReport {
    /// The pictures.
    pub views: Vec<RenderedView>,
    /// Common range, if they have one.
    pub range: Option<[f64; 2]>,
    /// Lines about the film.
    pub lines: Vec<String>,
}

/// Where pictures go.
pub struct PictureTarget<'a> {
    /// The folder or the picture; `None` if only a film is written.
    pub out: Option<&'a Path>,
    /// Colours and values of a density.
    pub density: &'a DensityArgs,
    /// Frames and film.
    pub sequence: &'a SequenceArgs,
}

/// The views of the file or the options, with the options applied; key frames become a path. A film of a series has as
/// many as it has pictures.
pub fn views(
    given: Option<ViewSet>,
    args: &ViewArgs,
    (of, film): (&SequenceArgs, Option<&SeriesFilm<'_>>),
    subject: &ViewSubject,
    context: &CommandContext,
) -> Result<ViewSet> {
    let mut set = match (given, args.views.as_ref().or(of.path.as_ref())) {
        (Some(set), _) => set,
        (None, Some(path)) => ViewsFile::read(path, context)?.0,
        (None, None) => args.one_view(subject, &of.turns())?,
    };
    args.apply(&mut set)?;
    let mut set = of.frames(set, film.map(|film| film.stamps.len()))?;
    film.iter().for_each(|film| film.move_views(&mut set));
    args.save(&set, context)?;
    Ok(set)
}

impl DrawingJob<'_> {
    /// Draws views into files.
    pub fn draw(&self, target: &PictureTarget<'_>) -> Result<DrawingReport> {
        let DrawingJob { finish, set, context, .. } = *self;
        let film = target.sequence.video.as_deref();
        let film = film.map(|path| Film::plan(path, target.sequence.fps, target.out, context)).transpose()?;
        let folder = target.out.or(film.as_ref().and_then(Film::frames));
        let raw = target.density.raw;
        let out = folder.map(|path| PictureOut::new(path, set.views.len(), raw, context)).transpose()?;
        if film.as_ref().is_some_and(|f| f.form != FilmFormat::Gif) && !matches!(out, Some(PictureOut::Folder(_))) {
            let what = "--video needs a folder for its frames, but -o names a picture";
            return Err(Error::argument_with(what, "name a folder, or omit -o"));
        }
        if let Some(out) = &out {
            match raw {
                true => target.density.plan_raw(out, &set.views, context)?,
                false => drop(out.pictures(set.views.iter().map(|v| &v.name[..]), context)?),
            }
        }
        let kind = out.as_ref().map_or(FileKind::Png, PictureOut::kind);
        if let Some(note) = set.views.first().filter(|_| !raw).and_then(|v| finish.note(v, set.size, kind)) {
            context.message(&note);
        }
        if target.sequence.is_asked_for() && !raw {
            return self.sequence(film.as_ref(), out.as_ref());
        }
        let Some(out) = out else { return Err(Error::argument("name an output with -o")) };
        self.one_by_one(&out, target.density)
    }

    fn one_by_one(&self, out: &PictureOut, density: &DensityArgs) -> Result<DrawingReport> {
        let DrawingJob { painter, finish, set, range, context, .. } = *self;
        let mut views = Vec::with_capacity(set.views.len());
        for view in &set.views {
            let started = Instant::now();
            let mut seconds = 0.0;
            let drawn = (painter.draw)(view, set.size).and_then(|seen| {
                seconds = started.elapsed().as_secs_f64();
                seen.say_if_empty(view, context);
                if let Some(grey) = seen.dark().filter(|_| self.hints && views.is_empty()) {
                    context.message(&format!("note: the picture is dark, as ParaView's would be (mean grey {grey:.1} of 255): --style density shows more"));
                }
                match seen {
                    ViewContent::Density(_) | ViewContent::Field(..) if density.raw => {
                        let view = finish.subject.density_view(view, set.size);
                        density.write_raw(out, &view, &seen, finish.quantities, finish.field.as_ref())
                    }
                    seen => {
                        let path = out.picture(&view.name);
                        finish.write(&path, seen, view, range, out.kind()).map(|()| path)
                    }
                }
            });
            let folder = match out {
                PictureOut::File(file) => file,
                PictureOut::Folder(folder) => folder,
            };
            let path = context.count_pictures(folder, views.len(), set.views.len(), drawn)?;
            views.push(RenderedView::new(view, finish.subject, seconds, Some(path)));
        }
        Ok(DrawingReport { views, range, lines: Vec::new() })
    }

    fn sequence(&self, film: Option<&Film>, out: Option<&PictureOut>) -> Result<DrawingReport> {
        let DrawingJob { finish, set, context, .. } = *self;
        let started = Instant::now();
        let gif = film.filter(|f| f.form == FilmFormat::Gif).map(|f| f.fps);
        let drawn = frames::draw(self, &FrameOutputs { files: out, gif })?;
        let mut lines = vec![format!("{} frames in {:.2} s", set.views.len(), started.elapsed().as_secs_f64())];
        let mut passing = false;
        if let Some(film) = film {
            let started = Instant::now();
            let names: Vec<String> = set.views.iter().map(|v| v.name.clone()).collect();
            film.join(&drawn.gif, out, &names, context)?;
            passing = film.is_passing();
            let seconds = started.elapsed().as_secs_f64();
            lines.push(format!("{} written in {seconds:.2} s", film.path().display()));
        }
        let path = |name: &str| out.filter(|_| !passing).map(|o| o.picture(name));
        let with_seconds = set.views.iter().zip(&drawn.seconds);
        let views = with_seconds.map(|(v, s)| RenderedView::new(v, finish.subject, *s, path(&v.name))).collect();
        Ok(DrawingReport { views, range: drawn.range, lines })
    }
}

impl DrawingReport {
    /// A row for each picture, or lines about a film.
    pub fn text(&self) -> String {
        if !self.lines.is_empty() {
            return self.lines.join("\n");
        }
        let mut text = format!("{:<16} {:>9}", "view", "seconds");
        for v in &self.views {
            text += &format!("\n{:<16} {:>9.3}", v.view.name, v.seconds);
        }
        text
    }
}
