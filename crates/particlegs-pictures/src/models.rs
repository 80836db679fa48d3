//! Pictures of models, and films of series.

use crate::field_choice::FieldChoice;
use crate::finish::Finisher;
use crate::layers;
use crate::options::{PictureStyle, RenderOptions};
use crate::panels::Panels;
use crate::picture_out::PictureOut;
use crate::provenance::{PictureProvenance, PictureUnits, SourceFile};
use crate::run::{DrawingJob, PictureReport, RenderedView};
use crate::series_film::{FocusPath, SeriesFilm, centred};
use crate::subject::{Quantities, ViewSubject};
use crate::view_content::{ViewContent, ViewRenderer};
use crate::view_options::PictureCenter;
use particlegs_core::camera::{View, ViewSet};
use particlegs_core::codec::{SeriesDecoder, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Model, check_densities, hex, species_title};
use particlegs_core::picture::{Gray8, Pixels, Rgb8, Size};
use particlegs_core::render::{Renderer, Scene, SceneRenderer, Scratch, draw_into};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Hint, NamedValue, Result, parallel};
use particlegs_files::input::name_of;
use particlegs_files::output::Outputs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A model to be drawn, and its file.
#[derive(Clone)]
pub struct PictureSource {
    /// The file; pictures store its name without its folder.
    pub path: PathBuf,
    /// The decoded model.
    pub model: Model,
    /// BLAKE3 of the file, in hexadecimal digits.
    pub blake3: String,
    /// Of a series: the moment, in words.
    pub moment: Option<String>,
    /// Whether that lies between two frames, which pictures then state.
    pub interpolated: bool,
}

impl PictureSource {
    /// A decoded model, and its file's bytes.
    pub fn new(path: &Path, bytes: &[u8], model: Model) -> PictureSource {
        let blake3 = hex(blake3::hash(bytes).as_bytes());
        PictureSource { path: path.to_path_buf(), model, blake3, moment: None, interpolated: false }
    }
}

/// Draws models into pictures: one, or in panels several.
///
/// # Errors
/// [`Error::Argument`] for options that are out of range or exclude one another; [`Error::Input`] for files that cannot be
/// used, [`Error::Output`] and [`Error::Io`] where pictures cannot be written; [`Error::Memory`]; [`Error::Cancelled`].
pub fn render_models(
    sources: Vec<PictureSource>,
    options: &RenderOptions,
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<PictureReport> {
    let paths = sources.iter().map(|source| &source.path);
    // Inputs are declared before anything is written, since no output may replace one.
    options.pictures.declare(paths.chain(options.files()), outputs);
    if options.follow.is_some() {
        return Err(Error::argument("a halo is followed through a film of a series, but this is a model"));
    }
    RenderSettings::new(options, context)?.draw(sources, None, None, outputs, context)
}

/// Draws a film of a whole series, a file with these bytes, of as many pictures as `options` ask for.
///
/// # Errors
/// As [`render_models`]; [`Error::Argument`] without a number of frames.
pub fn render_series(
    path: &Path,
    bytes: &[u8],
    options: &RenderOptions,
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<PictureReport> {
    let path = path.to_path_buf();
    options.pictures.declare([&path].into_iter().chain(options.files()), outputs);
    let settings = RenderSettings::new(options, context)?;
    let place = name_of(&path);
    let series = SeriesFile::read(bytes, &place)?;
    let length = options.pictures.film.frames;
    let length = length.ok_or_else(|| Error::argument("a film of a series takes a number of frames, or all"))?;
    let mut film = SeriesFilm::new(&series, &place, length)?;
    let focus = match (&options.follow, &options.pictures.view.center) {
        (Some(halo), _) => Some(FocusPath::of_halo(&series, halo, &place, context)?),
        (None, Some(center)) if center.is_of_mass() => Some(FocusPath::of_mass(&series, center, &place, context)?),
        _ => None,
    };
    // The film's views move with the path; the model that stands for it is centred where the first picture is.
    let followed = focus.and_then(|path| film.follow(&path));
    // The last frame gives a film its bounds and units.
    let time = series.there().last().map_or(0.0, |last| series.frames[last].time);
    let model = SeriesDecoder::new(&series).model_at(time, context)?;
    let moment = Some(series.moment_text(time, &model.metadata.units));
    let source = PictureSource { moment, ..PictureSource::new(&path, bytes, model) };
    settings.draw(vec![source], Some(&film), followed, outputs, context)
}

struct SourceModel {
    model: Model,
    source: SourceFile,
    /// The centre of mass that pictures are about, if that was asked for.
    center: Option<[f64; 3]>,
    /// Whether it is of a moment between two frames.
    interpolated: bool,
}

impl SourceModel {
    /// A model with the layers that are drawn; centres of mass are those of the whole model.
    fn new(
        source: PictureSource,
        (settings, center): (&RenderSettings, Option<&PictureCenter>),
        context: &Context<'_>,
    ) -> Result<SourceModel> {
        let PictureSource { path, model, blake3, moment, interpolated } = source;
        let place = name_of(&path);
        let center = center.map(|center| center.of_model(&model, &place, context)).transpose()?;
        let model = settings.chosen(model)?;
        let name = path.file_name().map_or(place, |n| n.to_string_lossy().into_owned());
        Ok(SourceModel { model, source: SourceFile { name, blake3, moment }, center, interpolated })
    }

    fn convert(self, to: &Model, context: &Context<'_>) -> Result<SourceModel> {
        let model = self.model.in_units(&to.metadata.unit_system(), &self.source.name, context)?;
        Ok(SourceModel { model, ..self })
    }

    /// The text that is written into its pictures: the moment, where it lies between two frames.
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

/// The options, completed by the settings in the picture that they name.
struct RenderSettings {
    options: RenderOptions,
    /// None is a density, or a field.
    style: Option<ToneStyle>,
    /// Whether the range is stated, not that of the picture.
    own_range: bool,
    /// Whether dark pictures get a hint, where the style is the default.
    hints: bool,
    /// The view and the units of the picture.
    like: Option<(ViewSet, PictureUnits)>,
}

impl RenderSettings {
    fn new(options: &RenderOptions, context: &Context<'_>) -> Result<RenderSettings> {
        options.check()?;
        let (given, style) = (&options.pictures, options.pictures.drawn_style());
        if style.is_mean() {
            return Err(Error::argument(format!("the style `{}` is one for particles, not for models", style.name())));
        }
        let (style, own_range) = (style.tone(), given.range.is_some());
        let hints = given.style.is_none() && options.like.is_none();
        let mut settings = RenderSettings { options: options.clone(), style, own_range, hints, like: None };
        let Some(path) = &options.like else { return Ok(settings) };
        let (provenance, set) = PictureProvenance::read(path, context)?;
        let unknown = |setting: &str, name: &str| Error::input(path, format!("its {setting} `{name}` is unknown"));
        let completed = &mut settings.options;
        let pictures = &mut completed.pictures;
        if given.style.is_none() && given.field.name.is_none() {
            pictures.field.name.clone_from(&provenance.field);
            let no_style = || {
                let message = format!("its style `{}` is not one for models", provenance.style);
                Error::input_with(path, message, Hint::from("choose one with ").option("style", ""))
            };
            let style = PictureStyle::from_name(&provenance.style).ok().filter(|style| !style.is_mean());
            settings.style = style.ok_or_else(no_style)?.tone();
        }
        if options.layers.is_empty() {
            completed.layers.clone_from(&provenance.layers);
        }
        // A density has the colours of its map, so those of layers would have no effect on it.
        completed.color_by_layer |= provenance.color_by_layer && settings.style.is_some();
        if let (None, Some(name)) = (given.colormap, &provenance.colormap) {
            pictures.colormap = Some(name.parse().map_err(|_| unknown("colour map", name))?);
        }
        // A range, a scale and a bulk motion mean something only for the quantity that they were chosen for.
        let same = pictures.field.name == provenance.field;
        if settings.style.is_none() {
            // Densities are drawn by their logarithms, so only ranges of fields may reach zero or below.
            let shows = |r: &[f64; 2]| r[1] > r[0] && (provenance.field.is_some() || r[0] > 0.0);
            pictures.range = pictures.range.or(provenance.range.filter(|r| same && shows(r)));
        }
        if same && provenance.field.is_some() {
            pictures.field.complete(&provenance).map_err(|message| Error::input(path, message))?;
        }
        if let (None, Some(name)) = (given.figure.background, &provenance.background) {
            pictures.figure.background = Some(NamedValue::from_name(name).map_err(|_| unknown("background", name))?);
        }
        settings.like = Some((set, provenance.units.unwrap_or_default()));
        Ok(settings)
    }

    fn are_layers_chosen(&self) -> bool {
        !self.options.layers.is_empty() && self.options.layers != ["all"]
    }

    /// The layers that are drawn.
    fn chosen(&self, model: Model) -> Result<Model> {
        if self.are_layers_chosen() { model.only(&self.options.layers) } else { Ok(model) }
    }

    /// Converts the settings of the picture to the model's units; a stated range is in them already.
    fn convert(&mut self, model: &Model, context: &Context<'_>) -> Result<()> {
        let (Some((set, units)), Some(path)) = (&mut self.like, &self.options.like) else { return Ok(()) };
        let to = model.metadata.unit_system();
        let name = path.display().to_string();
        let pictures = &mut self.options.pictures;
        if let Some(quantity) = units.density_of.as_ref().filter(|_| pictures.range.is_some() && !self.own_range) {
            check_densities((&name, quantity), ("the model", model.density_of()))?;
        }
        let (by, words) = units.system().conversion_of(&name, &to)?;
        words.iter().for_each(|word| context.note(word));
        // Cameras, radii and slabs are lengths; angles and opacities have no unit.
        set.views.iter_mut().for_each(|v| *v = v.scaled(by.length));
        if !self.own_range && pictures.field.name.is_none() {
            // A surface density is mass per area; fields keep their values when a model is converted.
            pictures.range = pictures.range.map(|r| r.map(|v| v * by.mass / (by.length * by.length)));
        }
        Ok(())
    }

    /// The models, the first of which gives the others its units, moved about the centre.
    fn open(
        &self,
        sources: Vec<PictureSource>,
        is_film: bool,
        followed: Option<[f64; 3]>,
        context: &Context<'_>,
    ) -> Result<(Vec<SourceModel>, Option<[f64; 3]>)> {
        if sources.len() > 1 && !self.options.panels {
            let message = format!("{} models are given, but a picture shows only one", sources.len());
            let hint = Hint::from("draw them in one figure with ").option("panels", "");
            return Err(Error::argument_with(message, hint));
        }
        // A film has found the centre of each frame already, and a stated place needs no model.
        let center = self.options.pictures.view.center.as_ref().filter(|c| c.is_of_mass() && !is_film);
        // The centre is that of the first.
        let source_model = |(i, source)| SourceModel::new(source, (self, center.filter(|_| i == 0)), context);
        let source_models = sources.into_iter().enumerate().map(source_model);
        let mut source_models = source_models.collect::<Result<Vec<_>>>()?.into_iter();
        let Some(first) = source_models.next() else { return Err(Error::argument("no model is given")) };
        let others = source_models.map(|other| other.convert(&first.model, context)).collect::<Result<Vec<_>>>()?;
        // One centre serves all models, so that their panels show the same part of the world.
        let center = followed.or(first.center);
        let centred_source = |source: SourceModel| match center {
            Some(center) => SourceModel { model: centred(source.model, center), ..source },
            None => source,
        };
        Ok((std::iter::once(first).chain(others).map(centred_source).collect(), center))
    }

    /// The field of each model; they must be of one kind, as must be densities.
    fn fields(&self, models: &[SourceModel]) -> Result<Vec<Option<FieldChoice>>> {
        let pictures = &self.options.pictures;
        let of_model = |r: &SourceModel| {
            let name = pictures.field.name.as_ref();
            name.map(|name| pictures.field.of_model(name, &r.model, pictures.colormap)).transpose()
        };
        let fields = models.iter().map(of_model).collect::<Result<Vec<_>>>()?;
        alike(&fields, models)?;
        if self.style.is_none() && fields[0].is_none() {
            let first = (&models[0].source.name[..], models[0].model.density_of());
            models.iter().try_for_each(|r| check_densities(first, (&r.source.name, r.model.density_of())))?;
        }
        if let Some(field) = &fields[0] {
            field.checked(pictures.range)?;
        }
        Ok(fields)
    }

    fn draw(
        mut self,
        sources: Vec<PictureSource>,
        film: Option<&SeriesFilm<'_>>,
        followed: Option<[f64; 3]>,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<PictureReport> {
        let (models, center) = self.open(sources, film.is_some(), followed, context)?;
        let model = &models[0].model;
        self.convert(model, context)?;
        let (options, pictures, m) = (&self.options, &self.options.pictures, &model.metadata);
        let subject = ViewSubject { center, ..ViewSubject::of_model(model, self.style.is_none()) };
        let quantities = Quantities::from_model(model);
        let fields = self.fields(&models)?;
        let renderer_of = |(r, field)| {
            let scratch = parallel::Scratch::default();
            ScenePainter { settings: &self, subject: &subject, field, scratch, context }.renderer(r, film)
        };
        let renderers = models.iter().map(|r| &r.model).zip(&fields).map(renderer_of).collect::<Result<Vec<_>>>()?;
        let like = self.like.as_ref().map(|(set, _)| set.clone());
        let set = pictures.views(like, film, &subject, outputs, context)?;
        let panels = options.panels.then(|| Panels {
            painters: models.iter().zip(&renderers).map(|(r, p)| (r.caption(), p)).collect(),
            captions: options.captions.clone(),
            columns: options.columns,
        });
        // The panels of a row share the printed width, so their pixels follow from the number of columns.
        let columns = panels.as_ref().map_or(1, |p| p.columns(set.views.len()));
        let set = pictures.resolved(set, columns);
        let unit = m.units.length_text().unwrap_or_default();
        // The window of `like` was chosen for another picture, and is no default to note.
        if let Some(note) = pictures.view.note(&subject, &set, unit).filter(|_| self.like.is_none()) {
            context.note(&note);
        }
        pictures.figure.note_missing(&options.captions, context);
        let (field, provenance) = (fields[0].as_ref(), self.provenance(&models, &quantities));
        let finish = Finisher {
            options: &pictures.figure,
            colormap: pictures.colormap.unwrap_or_default(),
            field: field.map(|f| f.legend.clone()),
            quantities: &quantities,
            subject: &subject.through(&set),
            legend: self.legend(model),
            circles: pictures.figure.circles((m.unit_system(), m.cell), context)?,
            stamps: match (film, panels.is_none()) {
                (Some(film), _) => &film.stamps,
                (None, true) => models[0].stamp(),
                // Panels have captions.
                (None, false) => &[],
            },
            about: field.map_or(provenance.clone(), |field| pictures.field.stored(field, provenance)),
        };
        let report = match (&panels, &pictures.output) {
            (Some(panels), Some(out)) => {
                let started = Instant::now();
                let out = PictureOut::new(out, 1, false, outputs)?;
                out.pictures(["panels"].into_iter(), outputs, context)?;
                let (path, range) = panels.draw(&finish, &set, pictures.range, &out, context)?;
                let seconds = started.elapsed().as_secs_f64() / set.views.len() as f64;
                let rendered_view = |v: &View| RenderedView::new(v, &subject, seconds, Some(path.clone()));
                let line = format!("{}: {} panels", path.display(), panels.painters.len() * set.views.len());
                let views = set.views.iter().map(rendered_view).collect();
                PictureReport { views, range, lines: vec![line], ..PictureReport::default() }
            }
            _ => {
                let Some(painter) = renderers.first() else { return Err(Error::argument("no model is given")) };
                // The hint names the style density, which splats of the alpha-blend law do not have.
                let hints = self.hints && m.law == LawKind::OpticalDepth;
                DrawingJob { painter, finish: &finish, set: &set, hints, options: pictures, outputs, context }.draw()?
            }
        };
        let style = self.style.map_or(PictureStyle::Density.name(), ToneStyle::name).into();
        Ok(PictureReport {
            style,
            gaussians: Some(models.iter().map(|r| r.model.gaussians()).sum()),
            ..report.of(&set)
        })
    }

    fn legend(&self, model: &Model) -> Vec<(String, [u8; 3])> {
        match self.options.color_by_layer {
            true => {
                model.layers.iter().enumerate().map(|(i, l)| (species_title(&l.name), Rgb8::layer_color(i))).collect()
            }
            false => Vec::new(),
        }
    }

    /// Provenance stored in the files, without each picture's view and range.
    fn provenance(&self, models: &[SourceModel], quantities: &Quantities) -> PictureProvenance {
        let (density, pictures) = (self.style.is_none(), &self.options.pictures);
        let first = models.first().map(|r| &r.model);
        PictureProvenance {
            of: models.iter().map(|r| r.source.clone()).collect(),
            layers: if self.are_layers_chosen() { self.options.layers.clone() } else { Vec::new() },
            color_by_layer: self.options.color_by_layer,
            units: first.map(|m| PictureUnits::new(m.metadata.unit_system(), density.then(|| m.density_of()))),
            ..pictures.provenance(self.style.map_or(PictureStyle::Density.name(), ToneStyle::name), quantities)
        }
    }
}

/// Refuses panels of one field in several units.
fn alike(fields: &[Option<FieldChoice>], models: &[SourceModel]) -> Result<()> {
    let title_and_unit = |f: &Option<FieldChoice>| f.as_ref().map(|f| (f.legend.title.clone(), f.legend.unit.clone()));
    match fields.iter().position(|f| title_and_unit(f) != title_and_unit(&fields[0])) {
        None => Ok(()),
        Some(i) => {
            let unit = |i: usize| {
                title_and_unit(&fields[i]).map_or(String::new(), |(title, unit)| format!("{title} in `{unit}`"))
            };
            let (a, b) = (&models[0].source.name, &models[i].source.name);
            Err(Error::argument(format!("{b} has {}, but {a} has {}: they cannot share colours", unit(i), unit(0))))
        }
    }
}

/// Draws models as the options say.
struct ScenePainter<'a> {
    settings: &'a RenderSettings,
    subject: &'a ViewSubject,
    field: &'a Option<FieldChoice>,
    scratch: parallel::Scratch<Scratch>,
    context: &'a Context<'a>,
}

/// A model with what is drawn of it.
struct SceneParts<'a> {
    scene: Scene<'a>,
    /// Colours need each layer on its own.
    layers: Vec<Box<dyn Renderer + 'a>>,
    on_device: Option<Box<dyn SceneRenderer + 'a>>,
}

impl<'a> ScenePainter<'a> {
    /// Draws the model in every picture, or in each of a film that of its moment.
    fn renderer<'f: 'a>(self, model: &'a Model, film: Option<&'a SeriesFilm<'f>>) -> Result<ViewRenderer<'a>> {
        let parts = self.parts(model)?;
        // The decoder of a series goes on from the last frame, so the frames of a film are drawn in order.
        let side_by_side = film.is_none() && self.settings.options.pictures.device.is_none();
        let draw = move |view: &View, size: Size| {
            let Some(film) = film else { return self.picture(&parts, self.subject, view, size) };
            let last = model.density_of();
            let model = self.settings.chosen(film.model(view, self.context)?)?;
            if self.settings.style.is_none() && self.field.is_none() {
                // Colour bar and range are labelled for the last frame, so every other one must sum the same quantity.
                check_densities(("the last frame", last), (&view.name, model.density_of()))?;
            }
            if self.subject.center.is_none() {
                return self.picture(&self.parts(&model)?, self.subject, view, size);
            }
            // In a box that repeats, mass beside the followed centre may lie at the opposite face.
            let model = centred(model, view.camera.focal_point);
            let subject = ViewSubject { bounds: model.metadata.bounds, ..*self.subject };
            self.picture(&self.parts(&model)?, &subject, view, size)
        };
        Ok(ViewRenderer { draw: Box::new(draw), side_by_side })
    }

    fn parts<'m>(&self, model: &'m Model) -> Result<SceneParts<'m>> {
        let (options, scene) = (&self.settings.options, Scene::new(model));
        let device = options.pictures.device.as_ref();
        if self.settings.style.is_none() && self.field.is_none() {
            model.check_density(|_| true)?;
        }
        if !options.color_by_layer {
            return Ok(SceneParts {
                on_device: device.map(|d| d.scene(&scene)).transpose()?,
                scene,
                layers: Vec::new(),
            });
        }
        layers::check(model)?;
        let layer = |place: usize| -> Result<Box<dyn Renderer + 'm>> {
            let scene = Scene::from_layers(model, |other| other == place);
            Ok(match device {
                Some(device) => device.scene(&scene)?,
                None => Box::new(scene),
            })
        };
        let layers = (0..model.layers.len()).map(layer).collect::<Result<_>>()?;
        Ok(SceneParts { scene, layers, on_device: None })
    }

    fn picture(&self, parts: &SceneParts<'_>, subject: &ViewSubject, view: &View, size: Size) -> Result<ViewContent> {
        let (scene, context) = (&parts.scene, self.context);
        let Some(style) = self.settings.style else {
            let view = subject.density_view(view, size);
            let renderer: &dyn SceneRenderer = parts.on_device.as_deref().unwrap_or(scene);
            if let Some(field) = self.field {
                return Ok(field.content(renderer.field_map(&field.query, &view, size, context)?));
            }
            return Ok(ViewContent::Density(renderer.surface_density(&view, size, context)?));
        };
        if !parts.layers.is_empty() {
            return layers::draw(&parts.layers, view, size, style, context);
        }
        context.require_memory("a picture", size.pixels() as u64)?;
        if let Some(renderer) = &parts.on_device {
            return Ok(ViewContent::Levels(renderer.draw(view, size, style, context)?));
        }
        let mut picture = Gray8::black(size);
        let pixels = Pixels::new(size, &mut picture.data)?;
        self.scratch.with(|scratch| draw_into(scene, view, style, pixels, scratch, context))?;
        Ok(ViewContent::Levels(picture))
    }
}
