//! The page's queries, and the engine's responses to them.

use particlegs_core::Result;
use particlegs_core::camera::{Camera, DensityView, View};
use particlegs_core::picture::Size;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use serde::{Deserialize, Serialize};

/// A query about a model.
#[derive(Deserialize)]
pub(crate) struct EngineQuery {
    /// The model's index, from 0, in the order of opening.
    #[serde(default)]
    pub model: usize,
    #[serde(flatten)]
    pub what: QueryKind,
}

#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
pub(crate) enum QueryKind {
    /// Decodes one step; answers the decoded share.
    Decode,
    /// Takes the bytes of a series' frame, which follow the query.
    AddFrame { frame: usize },
    /// Shows a series at a time of its clock, for all later queries; answers a `MomentSummary`.
    SetTime { time: f64 },
    /// A picture: RGBA, four bytes per pixel.
    Picture { scene: SceneRequest, paint: PlaneColours },
    /// Optical depths or surface densities, or values of a field, as f32.
    Values { scene: SceneRequest, style: PlaneStyle, field: Option<FieldRequest> },
    /// The footprints of all Gaussians for the GPU, 8 f32 each.
    Strokes { scene: SceneRequest, style: PlaneStyle },
    /// The tone curve of a view: 1153 f32 levels.
    Tone { opacity: f64, radius_pixels: f64 },
    /// The 256 RGB triples of core's `DensityColors`; with a `scale` those of a field's values.
    Colors { name: String, white: bool, scale: Option<String> },
    /// The window in which an orthographic view shows the whole box.
    Window { scene: SceneRequest },
    /// The Gaussian seen at a pixel.
    Probe { scene: SceneRequest, pixel: [f64; 2] },
    /// The contents of a sphere.
    Sphere { center: [f64; 3], radius: f64, layers: Option<Vec<bool>>, clip: Option<Bounds> },
    /// The position of Gaussian `index`.
    Gaussian { index: usize },
    /// The base distance for a picture of this size.
    BaseDistance { size: Size },
    /// The masked PSNR of two pictures of this size, whose levels follow the query.
    Score { size: Size },
}

/// The request of a scene: the parts to draw, and the camera.
#[derive(Clone, Deserialize)]
pub(crate) struct SceneRequest {
    /// Picture size, pixels.
    pub size: Size,
    pub camera: Camera,
    /// Particle radius, world units.
    pub radius: f64,
    pub opacity: f64,
    /// Whether each layer is drawn; all by default.
    pub layers: Option<Vec<bool>>,
    /// The clip box, world units.
    pub clip: Option<Bounds>,
    /// Whether to draw a smaller or partly decoded model. All other queries decode the whole model.
    #[serde(default)]
    pub coarse: bool,
    /// Whether to draw the periodic images of the box.
    #[serde(default)]
    pub images: bool,
}

/// The quantity of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PlaneStyle {
    Depth,
    /// Surface density, per world unit squared.
    Density,
}

/// The colours of a plane.
#[derive(Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct PlaneColours {
    /// A style; `None` = surface density.
    pub look: Option<ToneStyle>,
    pub white: bool,
    /// The colour map of density or of a field, whose scale has its own if this is empty.
    pub colormap: String,
    /// A field that is drawn instead of a style.
    pub field: Option<FieldRequest>,
    /// Values of the first and the last colour; automatic by default.
    pub range: Option<[f64; 2]>,
    /// Stops by which grey levels are brightened.
    pub exposure: f32,
    /// Whether each layer has its own colour.
    pub by_layer: bool,
}

/// A field to draw, as `render` draws it.
#[derive(Clone, PartialEq, Deserialize)]
pub(crate) struct FieldRequest {
    /// Its name, as `render --field` takes it.
    pub name: String,
    /// Whether the mean motion of all drawn particles is subtracted from a vector.
    pub bulk: bool,
    /// The scale of its colours; what suits the values if empty.
    pub scale: String,
    /// Whether surface density shades the colours.
    pub shade: bool,
}

impl SceneRequest {
    pub(crate) fn view(&self) -> Result<View> {
        let view = View { name: "view".into(), camera: self.camera, radius: self.radius, opacity: self.opacity };
        view.check(self.size)?;
        Ok(view)
    }

    /// The same camera for surface density.
    pub(crate) fn density_view(&self, bounds: &Bounds) -> Result<DensityView> {
        Ok(DensityView::of_view(&self.view()?, bounds))
    }
}

/// JSON and numbers. As bytes: u32 length of the JSON, the JSON, padding to a multiple of 8, the numbers. An error is
/// the JSON `{"error": "one line"}` without numbers.
#[derive(Debug)]
pub struct EngineResponse {
    pub json: String,
    pub numbers: Vec<u8>,
}

impl EngineResponse {
    /// `json` without numbers.
    pub(crate) fn new(json: &impl Serialize) -> Result<EngineResponse> {
        EngineResponse::with(json, Vec::new())
    }

    /// `json` and numbers.
    pub(crate) fn with(json: &impl Serialize, numbers: Vec<u8>) -> Result<EngineResponse> {
        let json = serde_json::to_string(json).map_err(|e| particlegs_core::Error::argument(e.to_string()))?;
        Ok(EngineResponse { json, numbers })
    }

    /// The response, or the error as JSON.
    pub(crate) fn or_error(result: Result<EngineResponse>) -> EngineResponse {
        result.unwrap_or_else(|error| {
            let json = serde_json::json!({ "error": error.to_string() }).to_string();
            EngineResponse { json, numbers: Vec::new() }
        })
    }

    pub fn into_bytes(self) -> Vec<u8> {
        let start = (4 + self.json.len()).next_multiple_of(8);
        let mut bytes = Vec::with_capacity(start + self.numbers.len());
        bytes.extend((self.json.len() as u32).to_le_bytes());
        bytes.extend(self.json.as_bytes());
        bytes.resize(start, 0);
        bytes.extend(self.numbers);
        bytes
    }
}
