//! `particlegs render MODEL... --style S -o OUT`.

use crate::common::{CommandContext, Common, NamedChoice, OrNone, one_of};
use crate::density_args::{DensityArgs, Quantities};
use crate::device::DeviceArgs;
use crate::drawing::finish::Finisher;
use crate::drawing::focus::{FocusPath, HaloNumber, centred};
use crate::drawing::job::DrawingJob;
use crate::drawing::panels::Panels;
use crate::drawing::provenance::{PictureProvenance, PictureUnits, SourceFile};
use crate::drawing::run::{self, PictureTarget};
use crate::drawing::series_film::SeriesFilm;
use crate::drawing::{ViewContent, ViewRenderer, layers};
use crate::field_args::{FieldArgs, FieldChoice};
use crate::figure::FileKind;
use crate::figure::args::{Background, FigureArgs};
use crate::inputs::{self, FrameArgs, FrameChoice};
use crate::picture_out::PictureOut;
use crate::rendered_view::RenderedView;
use crate::sequence_args::SequenceArgs;
use crate::view_args::{PictureCenter, ViewArgs, ViewSubject};
use clap::{Args, ValueEnum, ValueHint};
use particlegs::input::DecodedModel;
use particlegs_core::camera::{View, ViewSet};
use particlegs_core::codec::SeriesFile;
use particlegs_core::model::{LawKind, Model, check_densities, species_title};
use particlegs_core::picture::{Colormap, Gray8, Pixels, Rgb8, Size};
use particlegs_core::render::{Renderer, Scene, Scratch, draw_into, field_map, surface_density};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result, parallel};
use particlegs_files::input::name_of;
use particlegs_train::Accelerator;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(
    after_help = "\
Examples:
  particlegs render model.pgs -o pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 -o near.png
  particlegs render model.pgs --style density --projection orthographic -o fig.pdf
  particlegs render model.pgs --turntable 120 --video turn.mp4",
    after_long_help = "\
Examples:
  particlegs render model.pgs -o pictures
  particlegs render model.pgs -o figure.png
  particlegs render model.pgs --views views.json --style expected -o pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 -o near.png
  particlegs render model.pgs --azimuth 30 --save-views view.json -o pictures
  particlegs render model.pgs --style density --colormap magma -o sigma
  particlegs render model.pgs --field velocity.los --bulk mean --projection orthographic -o velocity.png
  particlegs render model.pgs --field temperature --shade -o temperature
  particlegs render model.pgs --layer stars -o stars
  particlegs render m.pgs --style density --projection orthographic --width 30 --depth 5 -o slab.pdf
  particlegs render a.pgs b.pgs --panels --style density --background white -o compared.pdf
  particlegs render model.pgs --like published.png -o again.png
  particlegs render model.pgs --turntable 120 --video turn.mp4
  particlegs render model.pgs --path keys.json --frames 300 --video flight.webm -o frames
  particlegs render run.pgs --frames all --follow haloes.csv:12 --width 5 --video halo.mp4

docs/guide/pictures.md describes styles, cameras, figures, films and views files."
)]
pub struct Arguments {
    /// Model file; several with --panels.
    #[arg(required = true, value_name = "MODEL", value_hint = ValueHint::FilePath)]
    models: Vec<PathBuf>,
    /// Folder for the pictures (NAME.png for each view), or, for one view, the file to write: NAME.png, .pdf or .svg.
    #[arg(
        long = "output",
        short,
        alias = "out",
        value_name = "DIR|FILE",
        value_hint = ValueHint::AnyPath,
        required_unless_present = "video"
    )]
    out: Option<PathBuf>,
    /// What to draw [default: paraview].
    #[arg(long, value_name = "STYLE", value_parser = one_of(STYLES))]
    style: Option<OrNone<ToneStyle>>,
    /// Layers to draw: species such as gas or dm, names that `info` lists, or `all`.
    #[arg(long = "layer", alias = "layers", value_name = "NAME,...", value_delimiter = ',')]
    layers: Option<Vec<String>>,
    /// Colour by layer: hues are mixed by optical depth, brightness is unchanged.
    #[arg(long, hide_short_help = true)]
    color_by_layer: bool,
    /// Reuse the camera, style, colours and range stored in a PNG from this program.
    ///
    /// Other options on the command line override what is stored.
    #[arg(
        long,
        value_name = "PNG",
        hide_short_help = true,
        value_hint = ValueHint::FilePath,
        conflicts_with_all = ["views", "path", "azimuth", "elevation", "distance", "projection", "center", "width", "depth", "fit"]
    )]
    like: Option<PathBuf>,
    /// Draw all models and views in one figure, with a common range and colour bar.
    #[arg(long, hide_short_help = true, conflicts_with_all = ["turntable", "path", "video", "raw"])]
    panels: bool,
    /// Panels per row [default: one per model; up to three for a single model].
    #[arg(long, value_name = "N", hide_short_help = true, requires = "panels")]
    columns: Option<usize>,
    /// Captions of the panels, row by row [default: names of models and views].
    #[arg(long, value_name = "TEXT,...", value_delimiter = ',', hide_short_help = true, requires = "panels")]
    captions: Vec<String>,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    sequence: SequenceArgs,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    density: DensityArgs,
    #[command(flatten)]
    field: FieldArgs,
    /// Follow a halo through a film of a series (--frames): a list read as by `stats --centres`, and the halo's id, or its
    /// row from 1 if the list has no ids.
    ///
    /// From the frame of the list on, the centre moves with the mass within the halo's radius. The camera keeps its
    /// distance and direction.
    #[arg(
        long,
        value_name = "FILE:NUMBER",
        hide_short_help = true,
        requires = "frames",
        value_parser = HaloNumber::parse,
        conflicts_with_all = ["views", "path", "like", "center"]
    )]
    follow: Option<HaloNumber>,
    #[command(flatten)]
    series: FrameArgs,
    #[command(flatten)]
    common: Common,
}

/// Style of a model's picture; `None` = surface density.
const STYLES: [NamedChoice<OrNone<ToneStyle>>; 4] = [
    (Some(ToneStyle::Paraview), "paraview", "ParaView's picture of the particles, without shot noise"),
    (Some(ToneStyle::ParaviewNoFxaa), "paraview-no-fxaa", "The same without antialiasing (FXAA)"),
    (Some(ToneStyle::Expected), "expected", "255 (1 - exp(-tau)) for the optical depth tau"),
    (None, "density", "Surface density in logarithmic colours, with a colour bar and a scale bar"),
];

#[derive(Serialize)]
struct RenderReport {
    style: String,
    gaussians: usize,
    width: usize,
    height: usize,
    fov_deg: Option<f64>,
    /// Values of the first and last colour, if all pictures share one range.
    #[serde(skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 2]>,
    views: Vec<RenderedView>,
}

struct SourceModel {
    model: Model,
    source: SourceFile,
    /// The centre of mass that --center asks for.
    center: Option<[f64; 3]>,
    /// Is it of a moment between two frames?
    interpolated: bool,
}

impl SourceModel {
    fn convert(self, to: &Model, context: &CommandContext) -> Result<SourceModel> {
        let model = self.model.in_units(&to.metadata.unit_system(), &self.source.name, context)?;
        Ok(SourceModel { model, ..self })
    }

    /// What is written into its pictures: the moment, where it lies between two frames.
    fn stamp(&self) -> &[String] {
        if self.interpolated { self.source.moment.as_slice() } else { &[] }
    }

    /// Its name in figures.
    fn caption(&self) -> String {
        let name = &self.source.name;
        let stem = Path::new(name).file_stem().map_or(name.into(), |stem| stem.to_string_lossy());
        [&[stem.into_owned()], self.stamp()].concat().join(", ")
    }
}

/// The options, completed by the settings in the --like picture.
struct RenderOptions {
    /// `None` = surface density.
    style: OrNone<ToneStyle>,
    layers: Vec<String>,
    color_by_layer: bool,
    /// The colour map that was chosen.
    colormap: Option<Colormap>,
    range: Option<[f64; 2]>,
    figure: FigureArgs,
    /// The field that is drawn, and how.
    field: FieldArgs,
    /// The view and the units of that picture.
    like: Option<(ViewSet, PictureUnits)>,
}

impl RenderOptions {
    fn new(a: &Arguments, context: &CommandContext) -> Result<RenderOptions> {
        let mut asked = RenderOptions {
            style: if a.field.field.is_some() { None } else { a.style.unwrap_or(Some(ToneStyle::Paraview)) },
            layers: a.layers.clone().unwrap_or_else(|| vec!["all".into()]),
            color_by_layer: a.color_by_layer,
            colormap: a.density.colormap,
            range: match a.field.field {
                Some(_) => a.density.field_range()?,
                None => a.density.asked_range()?,
            },
            field: a.field.clone(),
            figure: a.figure.clone(),
            like: None,
        };
        if a.field.field.is_some() && a.color_by_layer {
            return Err(Error::argument("--color-by-layer has no effect with --field, which has colours of its own"));
        }
        let Some(path) = &a.like else { return Ok(asked) };
        let (told, set) = PictureProvenance::read(path, context)?;
        let unknown = |what: &str, name: &str| Error::input(path, format!("its {what} `{name}` is unknown"));
        if a.style.is_none() && asked.field.field.is_none() {
            asked.field.field.clone_from(&told.field);
            let hint = "choose one with --style";
            let no_style =
                || Error::input_with(path, format!("its style `{}` is not one for models", told.style), hint);
            let style = STYLES.iter().find(|(_, name, _)| *name == told.style);
            asked.style = style.ok_or_else(no_style)?.0;
        }
        if a.layers.is_none() && !told.layers.is_empty() {
            asked.layers.clone_from(&told.layers);
        }
        asked.color_by_layer |= told.color_by_layer && asked.style.is_some();
        if let (None, Some(name)) = (a.density.colormap, &told.colormap) {
            asked.colormap = Some(name.parse().map_err(|_| unknown("colour map", name))?);
        }
        let same = asked.field.field == told.field;
        if asked.style.is_none() {
            let shows = |r: &[f64; 2]| r[1] > r[0] && (told.field.is_some() || r[0] > 0.0);
            asked.range = asked.range.or(told.range.filter(|r| same && shows(r)));
        }
        if same && told.field.is_some() {
            asked.field.complete(&told).map_err(|what| Error::input(path, what))?;
        }
        if let (None, Some(name)) = (asked.figure.background, &told.background) {
            asked.figure.background = Some(Background::from_str(name, false).map_err(|_| unknown("background", name))?);
        }
        asked.like = Some((set, told.units.unwrap_or_default()));
        Ok(asked)
    }

    /// The layers that are drawn.
    fn chosen(&self, model: Model) -> Result<Model> {
        if self.layers == ["all"] { Ok(model) } else { model.only(&self.layers) }
    }

    /// Converts the --like settings to the model's units; a given range is in them already.
    fn convert(&mut self, a: &Arguments, model: &Model, context: &CommandContext) -> Result<()> {
        let (Some((set, units)), Some(path)) = (&mut self.like, &a.like) else { return Ok(()) };
        let to = model.metadata.unit_system();
        let name = path.display().to_string();
        if let Some(of) = units.density_of.as_ref().filter(|_| self.range.is_some() && a.density.range.is_none()) {
            check_densities((&name, of), ("the model", model.density_of()))?;
        }
        let (by, words) = units.system().conversion_of(&name, &to)?;
        context.notes(&words);
        set.views.iter_mut().for_each(|v| *v = v.scaled(by.length));
        if a.density.range.is_none() && self.field.field.is_none() {
            self.range = self.range.map(|r| r.map(|v| v * by.mass / (by.length * by.length)));
        }
        Ok(())
    }
}

pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let files = [&a.view.views, &a.sequence.path, &a.like, &a.figure.overlay].into_iter().flatten();
    let files = files.chain(a.follow.iter().map(|halo| &halo.file));
    context.reads(a.models.iter().chain(files).map(PathBuf::as_path), false)?;
    let mut asked = RenderOptions::new(a, &context)?;
    let of_series = a.sequence.frames.is_some() && matches!(&a.models[..], [path] if inputs::is_series(path));
    if of_series && a.series.is_given() {
        return Err(Error::argument("--frames makes a film of the whole series: omit --frame and --time"));
    }
    let series = if of_series { Some(inputs::read_file(&a.models[0], &context)?) } else { None };
    let series = series.as_ref().map(|bytes| SeriesFile::read(bytes, &name_of(&a.models[0]))).transpose()?;
    let film = series.as_ref().zip(a.sequence.frames);
    let mut film = film.map(|(s, length)| SeriesFilm::new(s, &a.models[0], length)).transpose()?;
    let focus = series.as_ref().map(|series| focus(a, series, &context)).transpose()?.flatten();
    let followed = film.as_mut().zip(focus).and_then(|(film, path)| film.follow(&path));
    // The last frame gives a film its bounds and units.
    let last = series.as_ref().and_then(|series| series.there().last()).and_then(|frame| i64::try_from(frame).ok());
    let frame = if of_series { FrameChoice::from(last) } else { a.series.choice() };
    let center = a.view.center.as_ref().filter(|c| c.is_of_mass() && !of_series);
    let opened = |path: &PathBuf| read(path, &frame, (&asked, center), &context);
    let read = a.models.iter().map(opened).collect::<Result<Vec<_>>>()?;
    if read.len() > 1 && !a.panels {
        let what = format!("{} models are given, but a picture shows only one", read.len());
        return Err(Error::argument_with(what, "draw them in one figure with --panels"));
    }
    let mut read = read.into_iter();
    let Some(first) = read.next() else { return Err(Error::argument("no model is given")) };
    let others = read.map(|other| other.convert(&first.model, &context)).collect::<Result<Vec<_>>>()?;
    let center = followed.or(first.center);
    let moved = |source: SourceModel| match center {
        Some(center) => SourceModel { model: centred(source.model, center), ..source },
        None => source,
    };
    let read: Vec<SourceModel> = std::iter::once(first).chain(others).map(moved).collect();
    let model = &read[0].model;
    asked.convert(a, model, &context)?;
    let m = &model.metadata;
    let density = asked.style.is_none();
    let subject = ViewSubject { center, ..ViewSubject::of_model(model, density) };
    let quantities = Quantities::from_model(model);
    let device = a.device.open()?;
    let map = asked.colormap;
    let fields =
        read.iter().map(|r| asked.field.field.as_ref().map(|n| asked.field.of_model(n, &r.model, map)).transpose());
    let fields = fields.collect::<Result<Vec<_>>>()?;
    alike(&fields, &read)?;
    if density && fields[0].is_none() {
        let of = |r: &'_ SourceModel| r.model.density_of().to_string();
        let first = (&read[0].source.name[..], &of(&read[0])[..]);
        read.iter().try_for_each(|r| check_densities(first, (&r.source.name, &of(r))))?;
    }
    let field = fields.first().cloned().flatten();
    field.iter().try_for_each(|f| f.checked(asked.range))?;
    let painter = |field| ScenePainter {
        asked: &asked,
        subject: &subject,
        field,
        device: device.as_deref(),
        scratch: parallel::Scratch::default(),
        context: &context,
    };
    let painters = read.iter().zip(&fields).map(|(r, field)| painter(field).renderer(&r.model, film.as_ref()));
    let painters = painters.collect::<Result<Vec<_>>>()?;
    let like = asked.like.as_ref().map(|(set, _)| set.clone());
    let set = run::views(like, &a.view, (&a.sequence, film.as_ref()), &subject, &context)?;
    let panels = a.panels.then(|| Panels {
        painters: read.iter().zip(&painters).map(|(r, p)| (r.caption(), p)).collect(),
        captions: a.captions.clone(),
        columns: a.columns,
    });
    let kind = a.out.as_deref().and_then(FileKind::from_path).unwrap_or(FileKind::Png);
    let columns = panels.as_ref().map_or(1, |p| p.columns(set.views.len()));
    let resolved = asked.figure.resolved(set.size, kind, columns).filter(|_| a.view.size.is_none());
    let set = ViewSet { size: resolved.unwrap_or(set.size), ..set };
    let unit = m.units.length_text().unwrap_or_default().to_string();
    if let Some(note) = a.view.note(&subject, &set, &unit).filter(|_| asked.like.is_none()) {
        context.message(&note);
    }
    asked.figure.note_missing(&a.captions, &context);
    let whole = subject.through(&set);
    let finish = Finisher {
        args: &asked.figure,
        colormap: asked.colormap.unwrap_or_default(),
        field: field.as_ref().map(|f| f.legend.clone()),
        quantities: &quantities,
        subject: &whole,
        legend: legend(&asked, model),
        circles: asked.figure.circles((m.unit_system(), m.cell), &context)?,
        stamps: match (&film, panels.is_none()) {
            (Some(film), _) => &film.stamps,
            (None, true) => read[0].stamp(),
            // Panels have captions.
            (None, false) => &[],
        },
        about: match &field {
            Some(field) => asked.field.stored(field, about(&asked, &read, &quantities)),
            None => about(&asked, &read, &quantities),
        },
    };
    let target = PictureTarget { out: a.out.as_deref(), density: &a.density, sequence: &a.sequence };
    let (drawn, text, range) = match (&panels, &a.out) {
        (Some(panels), Some(out)) => {
            let started = std::time::Instant::now();
            let out = PictureOut::new(out, 1, false, &context)?;
            out.pictures(["panels"].into_iter(), &context)?;
            let (path, range) = panels.draw(&finish, &set, asked.range, &out, &context)?;
            let seconds = started.elapsed().as_secs_f64() / set.views.len() as f64;
            let of = |v: &View| RenderedView::new(v, &subject, seconds, Some(path.clone()));
            let text = format!("{}: {} panels", path.display(), panels.painters.len() * set.views.len());
            (set.views.iter().map(of).collect(), text, range)
        }
        _ => {
            let first = painters.first().ok_or_else(|| Error::argument("no model is given"))?;
            let hints = a.style.is_none() && asked.like.is_none() && m.law == LawKind::OpticalDepth;
            let job =
                DrawingJob { painter: first, finish: &finish, set: &set, range: asked.range, hints, context: &context };
            let report = job.draw(&target)?;
            let text = report.text();
            (report.views, text, report.range)
        }
    };
    let report = RenderReport {
        style: asked.style.map_or("density", ToneStyle::name).into(),
        gaussians: read.iter().map(|r| r.model.gaussians()).sum(),
        width: set.size.width,
        height: set.size.height,
        fov_deg: set.fov_deg(),
        range,
        views: drawn,
    };
    context.finish(&text, &report)
}

/// Refuses panels of one field in several units.
fn alike(fields: &[Option<FieldChoice>], read: &[SourceModel]) -> Result<()> {
    let of = |f: &Option<FieldChoice>| f.as_ref().map(|f| (f.legend.title.clone(), f.legend.unit.clone()));
    match fields.iter().position(|f| of(f) != of(&fields[0])) {
        None => Ok(()),
        Some(i) => {
            let unit = |i: usize| of(&fields[i]).map_or(String::new(), |(title, unit)| format!("{title} in `{unit}`"));
            let (a, b) = (&read[0].source.name, &read[i].source.name);
            Err(Error::argument(format!("{b} has {}, but {a} has {}: they cannot share colours", unit(i), unit(0))))
        }
    }
}

/// What a film of a series follows, if anything.
fn focus(a: &Arguments, series: &SeriesFile<'_>, context: &CommandContext) -> Result<Option<FocusPath>> {
    let place = name_of(&a.models[0]);
    match (&a.follow, &a.view.center) {
        (Some(halo), _) => FocusPath::of_halo(series, halo, &place, context).map(Some),
        (None, Some(center)) if center.is_of_mass() => FocusPath::of_mass(series, center, &place, context).map(Some),
        _ => Ok(None),
    }
}

/// A model with the layers that are drawn; centres of mass are those of the whole model.
fn read(
    path: &Path,
    frame: &FrameChoice,
    (asked, center): (&RenderOptions, Option<&PictureCenter>),
    context: &CommandContext,
) -> Result<SourceModel> {
    let name = name_of(path);
    let DecodedModel { model, blake3, moment, interpolated } = inputs::decoded_model(path, frame, context)?;
    let center = center.map(|center| center.of_model(&model, &name, context)).transpose()?;
    let model = asked.chosen(model)?;
    let file = path.file_name().map_or(name, |n| n.to_string_lossy().into_owned());
    Ok(SourceModel { model, source: SourceFile { name: file, blake3, moment }, center, interpolated })
}

fn legend(asked: &RenderOptions, model: &Model) -> Vec<(String, [u8; 3])> {
    match asked.color_by_layer {
        true => model.layers.iter().enumerate().map(|(i, l)| (species_title(&l.name), Rgb8::layer_color(i))).collect(),
        false => Vec::new(),
    }
}

/// Provenance stored in the files, without each picture's view and range.
fn about(asked: &RenderOptions, read: &[SourceModel], quantities: &Quantities) -> PictureProvenance {
    let density = asked.style.is_none();
    let ground = asked.figure.background.and_then(|b| Some(b.to_possible_value()?.get_name().to_string()));
    PictureProvenance {
        particlegs: env!("CARGO_PKG_VERSION").into(),
        of: read.iter().map(|r| r.source.clone()).collect(),
        style: asked.style.map_or("density", ToneStyle::name).into(),
        layers: if asked.layers == ["all"] { Vec::new() } else { asked.layers.clone() },
        color_by_layer: asked.color_by_layer,
        colormap: density.then(|| asked.colormap.unwrap_or_default().name().into()),
        unit: density.then(|| quantities.unit()),
        units: read
            .first()
            .map(|r| PictureUnits::new(r.model.metadata.unit_system(), density.then(|| r.model.density_of()))),
        background: ground,
        ..PictureProvenance::default()
    }
}

/// Draws models as the options say.
struct ScenePainter<'a> {
    asked: &'a RenderOptions,
    subject: &'a ViewSubject,
    field: &'a Option<FieldChoice>,
    device: Option<&'a dyn Accelerator>,
    scratch: parallel::Scratch<Scratch>,
    context: &'a CommandContext,
}

/// A model with what is drawn of it.
struct SceneParts<'a> {
    scene: Scene<'a>,
    /// Colours need each layer on its own.
    layers: Vec<Model>,
    on_device: Option<Box<dyn Renderer>>,
}

impl<'a> ScenePainter<'a> {
    /// Draws the model in every picture, or in each of a film that of its moment.
    fn renderer<'f: 'a>(self, model: &'a Model, film: Option<&'a SeriesFilm<'f>>) -> Result<ViewRenderer<'a>> {
        let parts = self.parts(model)?;
        let side_by_side = film.is_none() && parts.on_device.is_none();
        let draw = move |view: &View, size: Size| {
            let Some(film) = film else { return self.picture(&parts, self.subject, view, size) };
            let last = model.density_of();
            let model = self.asked.chosen(film.model(view, self.context)?)?;
            if self.asked.style.is_none() && self.field.is_none() {
                check_densities(("the last frame", last), (&view.name, model.density_of()))?;
            }
            if self.subject.center.is_none() {
                return self.picture(&self.parts(&model)?, self.subject, view, size);
            }
            let model = centred(model, view.camera.focal_point);
            let subject = ViewSubject { bounds: model.metadata.bounds, ..*self.subject };
            self.picture(&self.parts(&model)?, &subject, view, size)
        };
        Ok(ViewRenderer { draw: Box::new(draw), side_by_side })
    }

    fn parts<'m>(&self, model: &'m Model) -> Result<SceneParts<'m>> {
        let look = self.asked.style;
        if look.is_none() && model.metadata.law == LawKind::AlphaBlend {
            let what = "an alpha-blend model has no surface density: its splats hold opacities, not masses".to_string();
            let hint = "draw particles with `recover`, then their density with `reference --style density`".to_string();
            return Err(Error::argument_with(what, hint));
        }
        let layers = if self.asked.color_by_layer { layers::apart(model)? } else { Vec::new() };
        let scene = Scene::new(model);
        if self.device.is_some() && (look.is_none() || !layers.is_empty()) {
            let what = "surface densities, fields and coloured layers are rendered on the CPU only";
            return Err(Error::argument_with(what, "omit --device"));
        }
        let on_device = self.device.map(|d| d.scene(&scene)).transpose()?;
        Ok(SceneParts { scene, layers, on_device })
    }

    fn picture(&self, of: &SceneParts<'_>, subject: &ViewSubject, view: &View, size: Size) -> Result<ViewContent> {
        let (scene, context) = (&of.scene, self.context);
        let Some(look) = self.asked.style else {
            let view = subject.density_view(view, size);
            if let Some(field) = self.field {
                return Ok(field.content(field_map(scene, &field.query, &view, size, context)?));
            }
            return Ok(ViewContent::Density(surface_density(scene, &view, size, context)?));
        };
        if !of.layers.is_empty() {
            return layers::draw(&of.layers, view, size, look, context);
        }
        context.require_memory("a picture", size.pixels() as u64)?;
        if let Some(renderer) = &of.on_device {
            return Ok(ViewContent::Levels(renderer.draw(view, size, look, context)?));
        }
        let mut picture = Gray8::black(size);
        let pixels = Pixels::new(size, &mut picture.data)?;
        self.scratch.with(|scratch| draw_into(scene, view, look, pixels, scratch, context))?;
        Ok(ViewContent::Levels(picture))
    }
}
