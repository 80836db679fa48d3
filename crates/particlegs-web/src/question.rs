//! What a page asks.

use particlegs_core::Result;
use particlegs_core::camera::{Camera, DensityView, View};
use particlegs_core::picture::Size;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use serde::Deserialize;

/// A question about the model that was opened as number `model`.
#[derive(Deserialize)]
pub(crate) struct EngineQuery {
    /// Which model, from 0.
    #[serde(default)]
    pub model: usize,
    #[serde(flatten)]
    pub what: QueryKind,
}

#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
pub(crate) enum QueryKind {
    /// Decodes a step more of the model: which share of it is decoded.
    Decode,
    /// A picture: RGBA, four bytes a pixel.
    Picture { scene: SceneRequest, paint: PlaneColours },
    /// The plane behind a picture: optical depth, or surface density, as f32.
    Values { scene: SceneRequest, style: PlaneStyle },
    /// The footprints of all Gaussians as a graphics card adds them up, 8 f32 each.
    Strokes { scene: SceneRequest, style: PlaneStyle },
    /// The tone curve of a view: 1153 f32 levels.
    Tone { opacity: f64, radius_pixels: f64 },
    /// 256 RGB triples for densities, as core's `DensityColors` has them.
    Colors { name: String, white: bool },
    /// Which window a view along parallel lines shows the whole box in.
    Window { scene: SceneRequest },
    /// What is seen at a pixel.
    Probe { scene: SceneRequest, pixel: [f64; 2] },
    /// Mass in a sphere.
    Sphere { center: [f64; 3], radius: f64, layers: Option<Vec<bool>>, clip: Option<Bounds> },
    /// Where Gaussian `index` is.
    Gaussian { index: usize },
    /// The base distance of cameras, for a picture of this size.
    BaseDistance { size: Size },
    /// The masked PSNR of two pictures of this size, whose levels stand behind the question.
    Score { size: Size },
}

/// What is drawn, and from where.
#[derive(Clone, Deserialize)]
pub(crate) struct SceneRequest {
    /// Picture size, pixels.
    pub size: Size,
    pub camera: Camera,
    /// Particle radius, world units.
    pub radius: f64,
    /// Opacity.
    pub opacity: f64,
    /// Which layers are drawn; all where it is left out.
    pub layers: Option<Vec<bool>>,
    /// Particles outside are left out, world units.
    pub clip: Option<Bounds>,
    /// Is it drawn in fewer Gaussians, for motion, or of what is decoded by now? Whatever else is asked of a model
    /// decodes all of it.
    #[serde(default)]
    pub coarse: bool,
    /// Is the periodic box repeated about itself?
    #[serde(default)]
    pub images: bool,
}

/// What a plane holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PlaneStyle {
    Depth,
    /// Surface density, mass a world unit squared.
    Density,
}

/// How a plane is coloured.
#[derive(Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct PlaneColours {
    /// A look; `None` = surface density.
    pub look: Option<ToneStyle>,
    pub white: bool,
    /// The colour map of density.
    pub colormap: String,
    /// Densities of the first and the last colour; found where it is left out.
    pub range: Option<[f64; 2]>,
    /// Stops by which grey levels are brightened.
    pub exposure: f32,
    /// Are layers told apart by colour?
    pub by_layer: bool,
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
