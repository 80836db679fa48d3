//! The open models and answers to queries.

use crate::about::{ModelSummary, MomentSummary, SeriesSummary};
use crate::opened::LoadedModel;
use crate::picture::{FieldPlane, PlaneRenderer, UNLIT, bytes, check};
use crate::probe;
use crate::question::{EngineQuery, EngineResponse, PlaneColours, PlaneStyle, QueryKind, SceneRequest};
use crate::strokes::strokes;
use particlegs_core::camera::base_distance;
use particlegs_core::codec::{self, Decoder, FrameEntry, SeriesDecoder, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::model::{Model, hex};
use particlegs_core::picture::{Colormap, DensityColors, Gray8, Plane, Size, ValueColors, ValueScale, masked_psnr};
use particlegs_core::render::Scene;
use particlegs_core::render::lens::Lens;
use particlegs_core::splat::Response;
use particlegs_core::{Error, NamedValue, Result};
use serde_json::json;

/// The models in the order of opening, and the renderer.
#[derive(Default)]
pub struct Engine {
    models: Vec<LoadedModel>,
    painter: PlaneRenderer,
}

impl SceneRequest {
    /// Whether this layer is drawn.
    pub(crate) fn shows(&self, layer: usize) -> bool {
        self.layers.as_ref().is_none_or(|l| l.get(layer).copied().unwrap_or(true))
    }

    pub(crate) fn scene<'a>(&self, model: &'a Model, shown: &dyn Fn(usize) -> bool) -> Scene<'a> {
        let scene = Scene::from_layers(model, shown).repeated(self.shifts(model));
        // The page names one unit for all layers, shown or not.
        if model.has_masses() { scene } else { scene.by_number() }
    }

    /// The positions of the box and its images, the box first.
    fn shifts(&self, model: &Model) -> Vec<[f64; 3]> {
        let Some(cell) = model.metadata.cell.filter(|_| self.images) else { return vec![[0.0; 3]] };
        let mut shifts = cell.shifts(cell.periodic.map(|repeats| if repeats { [-1, 1] } else { [0, 0] }));
        let box_index = shifts.iter().position(|shift| *shift == [0.0; 3]).unwrap_or_default();
        shifts[..=box_index].rotate_right(1);
        shifts
    }

    /// The lens of each image.
    fn lenses(&self, model: &Model, style: PlaneStyle) -> Result<Vec<Lens>> {
        let scene = self.scene(model, &|_| true);
        let lens = match style {
            PlaneStyle::Depth => Lens::optical(&self.view()?, self.size, scene.bounds())?,
            PlaneStyle::Density => Lens::density(&self.density_view(scene.bounds())?, self.size, [0.0; 3])?,
        };
        Ok(self.shifts(model).into_iter().map(|s| lens.shifted(s)).collect())
    }
}

impl Engine {
    /// Opens a model file and returns its summary. Small models are then decoded; others need `Decode` queries.
    ///
    /// Of a series the first bytes are enough, up to the end of the first frame; if they are fewer, the answer says how
    /// many it `needs`, and nothing is opened.
    pub fn open(&mut self, file: Vec<u8>) -> EngineResponse {
        let opened = if codec::is_series(&file) { self.open_series(&file) } else { self.open_model(file) };
        EngineResponse::or_error(opened)
    }

    fn open_model(&mut self, file: Vec<u8>) -> Result<EngineResponse> {
        let decoder = Decoder::new(file, "the model", &Context::SILENT)?;
        let blake3 = hex(blake3::hash(decoder.file()).as_bytes());
        let about = json!(ModelSummary::new(decoder.info(), blake3));
        let mut opened = LoadedModel::new(decoder);
        let decoded = opened.step()?;
        self.models.push(opened);
        EngineResponse::new(&json!({ "about": about, "decoded": decoded }))
    }

    fn open_series(&mut self, start: &[u8]) -> Result<EngineResponse> {
        const PLACE: &str = "the series";
        let index = SeriesFile::index_end(start, PLACE)?;
        if start.len() < index {
            return EngineResponse::new(&json!({ "needs": index }));
        }
        let series = SeriesFile::read_start(start, PLACE)?;
        let first = series.first()?;
        let FrameEntry { time, place, .. } = &series.frames[first];
        if start.len() < place.end {
            return EngineResponse::new(&json!({ "needs": place.end }));
        }
        let decoder = Decoder::new(series.frame_bytes(first)?, PLACE, &Context::SILENT)?;
        let answer = json!({
            "about": ModelSummary::new(decoder.info(), String::new()), "decoded": 1.0,
            "series": SeriesSummary::new(&series, &series.units()?),
        });
        self.models.push(LoadedModel::of_series(SeriesDecoder::of(series.clone()), *time)?);
        EngineResponse::new(&answer)
    }

    /// Answers a query: JSON followed by its numbers.
    pub fn ask(&mut self, question: &[u8]) -> EngineResponse {
        let mut json = serde_json::Deserializer::from_slice(question).into_iter();
        // No bytes at all get the parser's own error.
        let parsed_query = json.next().unwrap_or_else(|| serde_json::from_slice(b""));
        let query = parsed_query.map_err(|e| Error::argument(format!("invalid query: {e}")));
        // The numbers begin where the JSON ends; their length is not stated.
        let numbers = &question[json.byte_offset()..];
        EngineResponse::or_error(query.and_then(|q: EngineQuery| self.answer(q, numbers)))
    }

    fn answer(&mut self, EngineQuery { model, what: kind }: EngineQuery, numbers: &[u8]) -> Result<EngineResponse> {
        let Engine { models, painter: renderer } = self;
        let number = models.len();
        let none = || Error::argument(format!("there is no model {model}: {number} are open"));
        let opened = models.get_mut(model).ok_or_else(none)?;
        match kind {
            QueryKind::Decode => EngineResponse::new(&json!({ "decoded": opened.step()? })),
            QueryKind::AddFrame { frame } => {
                opened.series()?.add_frame(frame, numbers.to_vec())?;
                EngineResponse::new(&json!({}))
            }
            QueryKind::SetTime { time } => {
                opened.set_time(time)?;
                let series = opened.series()?.series();
                let (text, interpolated) = (series.clock.text(time, &series.units()?), series.frame_at(time).is_none());
                EngineResponse::new(&MomentSummary::new(&opened.full()?.model, text, interpolated))
            }
            QueryKind::Picture { scene, paint } => picture(opened, renderer, &scene, &paint),
            QueryKind::Values { scene, field: Some(field), .. } => {
                check(scene.size)?;
                let map = FieldPlane::new(opened, &scene, &field)?;
                let data = map.values.data.iter().map(|v| *v as f32).collect();
                EngineResponse::with(&json!({ "range": map.range() }), bytes(&Plane { size: scene.size, data }))
            }
            QueryKind::Values { scene, style, field: None } => {
                check(scene.size)?;
                let model = opened.shown(&scene)?;
                let plane = renderer.plane(&scene.scene(model, &|l| scene.shows(l)), &scene, style)?;
                EngineResponse::with(&json!({ "range": plane.first_range() }), bytes(&plane))
            }
            QueryKind::Strokes { scene, style } => {
                check(scene.size)?;
                let model = opened.shown(&scene)?;
                let lenses = scene.lenses(model, style)?;
                strokes(model, |l| scene.shows(l), &lenses, scene.size, style == PlaneStyle::Density)
            }
            QueryKind::Tone { opacity, radius_pixels } => tone(opacity, radius_pixels),
            QueryKind::Colors { name, scale: Some(scale), .. } => {
                let scale = ValueScale::from_name(&scale).map_err(Error::argument)?;
                let colors = ValueColors { scale, range: UNLIT, map: name.parse().ok() };
                let all: Vec<[u8; 3]> = (0..=255).map(|i| colors.at(i as f32 / 255.0)).collect();
                EngineResponse::with(&json!({}), all.concat())
            }
            QueryKind::Colors { name, white, scale: None } => {
                let map: Colormap = name.parse().map_err(Error::argument)?;
                EngineResponse::with(&json!({}), DensityColors::new(map, white, UNLIT).all().concat())
            }
            QueryKind::Window { scene } => {
                check(scene.size)?;
                let (extent, frame) = (opened.extent()?, scene.view()?.camera.frame()?);
                let Size { width, height } = scene.size;
                let height_world = extent.width(&frame, scene.size) * height as f64 / width as f64;
                EngineResponse::new(&json!({ "center": extent.center, "height_world": height_world }))
            }
            QueryKind::Probe { scene, pixel } => {
                let full = opened.full()?;
                let model = full.inside(scene.clip);
                let images: Vec<_> =
                    scene.lenses(model, PlaneStyle::Depth)?.into_iter().zip(scene.shifts(model)).collect();
                let camera = scene.view()?.camera;
                let mut seen = probe::seen(model, &|l| scene.shows(l), (&camera, &images, scene.size), pixel);
                if let Some(seen) = &mut seen {
                    seen.number_in(&full.model, full.number(seen.gaussian, scene.clip));
                }
                EngineResponse::new(&seen)
            }
            QueryKind::Sphere { center, radius, layers, clip } => {
                let shown = |l: usize| layers.as_ref().is_none_or(|s| s.get(l).copied().unwrap_or(true));
                EngineResponse::new(&probe::held(opened.full()?.inside(clip), &shown, center, radius))
            }
            QueryKind::Gaussian { index } => {
                let model = &opened.full()?.model;
                let gaussian = probe::gaussian(model, index);
                let missing = || format!("there is no Gaussian #{index}: the model has {}", model.gaussians());
                let (position, extent) = gaussian.ok_or_else(|| Error::argument(missing()))?;
                EngineResponse::new(&json!({ "position": position, "extent": extent }))
            }
            QueryKind::BaseDistance { size } => {
                EngineResponse::new(&json!({ "distance": base_distance(&opened.bounds, size) }))
            }
            QueryKind::Score { size } => {
                check(size)?;
                if numbers.len() != 2 * size.pixels() {
                    return Err(Error::argument("a score needs two pictures of the same size"));
                }
                let (a, b) = numbers.split_at(size.pixels());
                let [a, b] = [a, b].map(|levels| Gray8 { size, data: levels.to_vec() });
                EngineResponse::new(&json!({ "masked_psnr": masked_psnr(&a, &b) }))
            }
        }
    }
}

fn picture(
    opened: &mut LoadedModel,
    renderer: &mut PlaneRenderer,
    request: &SceneRequest,
    paint: &PlaneColours,
) -> Result<EngineResponse> {
    check(request.size)?;
    if let Some(field) = &paint.field {
        let (pixels, bar) = FieldPlane::new(opened, request, field)?.picture(paint);
        return EngineResponse::with(&bar, pixels);
    }
    let model = opened.shown(request)?;
    let (pixels, range) = renderer.picture(model, |shown| request.scene(model, shown), request, paint)?;
    EngineResponse::with(&json!({ "range": range }), pixels)
}

/// The tone curve of an opacity and a splat radius: levels at the depths of [`Response`]'s table, and FXAA's ratio and
/// blur.
fn tone(opacity: f64, radius_pixels: f64) -> Result<EngineResponse> {
    use particlegs_core::splat::{FxaaMean, fxaa_blur};
    let levels = Response::new(opacity).levels().iter().flat_map(|v| v.to_le_bytes()).collect();
    let mean = FxaaMean::new(opacity, radius_pixels);
    let (depths, ratios) = mean.nodes();
    EngineResponse::with(
        &json!({ "depths": depths, "ratios": ratios, "blur": fxaa_blur(opacity, radius_pixels) }),
        levels,
    )
}
