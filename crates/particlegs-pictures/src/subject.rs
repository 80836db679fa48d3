//! Properties of a snapshot or model that views depend on.

use particlegs_core::camera::{DensityView, Extent, View, ViewSet};
use particlegs_core::math::each_axis;
use particlegs_core::model::Model;
use particlegs_core::picture::Size;
use particlegs_core::render::{self, Scene};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::splat::DEFAULT_OPACITY;

/// Properties of a snapshot or model that views depend on.
#[derive(Clone, Copy, Debug)]
pub struct ViewSubject {
    /// Bounds of the whole snapshot, world units.
    pub bounds: Bounds,
    /// Its cell, if it has one.
    pub cell: Option<Cell>,
    /// The extent that an orthographic picture shows completely.
    pub extent: Extent,
    /// Default particle radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
    /// Whether a surface density is drawn.
    pub density: bool,
    /// The centre of mass that pictures are about, if that was asked for.
    pub center: Option<[f64; 3]>,
}

impl ViewSubject {
    /// For a model.
    pub fn of_model(model: &Model, density: bool) -> Self {
        let m = &model.metadata;
        let (bounds, cell) = (m.bounds, m.cell);
        let extent = match density {
            true => render::extent(&Scene::new(model), cell.as_ref()),
            false => Extent::new(&bounds, cell.as_ref()),
        };
        ViewSubject {
            bounds,
            cell,
            extent,
            radius: m.default_radius,
            opacity: m.default_opacity,
            density,
            center: None,
        }
    }

    /// For `count` particles within bounds.
    pub fn of_particles(bounds: Bounds, cell: Option<Cell>, count: u64, density: bool) -> Self {
        let (extent, radius) = (Extent::new(&bounds, cell.as_ref()), bounds.default_radius(count));
        ViewSubject { bounds, cell, extent, radius, opacity: DEFAULT_OPACITY, density, center: None }
    }

    /// The subject of all pictures of a film, whose bounds move with what they are about.
    pub(crate) fn through(&self, set: &ViewSet) -> ViewSubject {
        let Some(center) = self.center else { return *self };
        let moved_bounds = |view: &View| {
            let shift: [f64; 3] = each_axis(|k| view.camera.focal_point[k] - center[k]);
            let [min, max] = [self.bounds.min, self.bounds.max].map(|p| each_axis(|k| p[k] + shift[k]));
            Bounds { min, max }
        };
        let bounds = set.views.iter().map(moved_bounds).fold(self.bounds, |all, bounds| all.union(&bounds));
        ViewSubject { bounds, ..*self }
    }

    pub(crate) fn repeats(&self) -> bool {
        self.density && self.cell.is_some_and(|c| c.periodic.contains(&true))
    }

    /// A view as one of its surface density.
    pub fn density_view(&self, view: &View, size: Size) -> DensityView {
        DensityView::of_cell(view, size, &self.bounds, self.cell)
    }
}
