//! Properties of a snapshot or model that pictures depend on: what views show of it, and the units of its density.

use particlegs_core::camera::{DensityView, Extent, View, ViewSet};
use particlegs_core::math::each_axis;
use particlegs_core::model::{Model, Units};
use particlegs_core::picture::Size;
use particlegs_core::render::{self, Scene};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::splat::DEFAULT_OPACITY;
use particlegs_particles::Particles;

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

/// Units of a snapshot or model, and the meaning of its density.
#[derive(Clone, Debug)]
pub struct Quantities {
    length_unit: Option<String>,
    mass_unit: Option<String>,
    /// Name of the weights, if they are not masses.
    weight_name: Option<String>,
    /// Whether lengths are comoving.
    pub comoving: bool,
    /// Number of neighbours that particles are smoothed over.
    pub smooth: Option<usize>,
}

impl Quantities {
    /// For a snapshot, whose particles may be smoothed over neighbours.
    pub fn from_particles(p: &Particles, smooth: Option<usize>) -> Self {
        let (m, known) = (&p.meta, p.weights().is_some() || p.meta.particle_mass.is_some());
        Quantities { smooth, ..Quantities::new(&m.units, known, m.weight_name.as_deref()) }
    }

    pub fn from_model(model: &Model) -> Self {
        let m = &model.metadata;
        Quantities::new(&m.units, model.has_masses(), m.weight_name())
    }

    fn new(units: &Units, has_masses: bool, weight_name: Option<&str>) -> Self {
        Quantities {
            length_unit: units.length_text().map(str::to_string),
            mass_unit: has_masses.then(|| units.mass_text().unwrap_or("mass").to_string()),
            weight_name: weight_name.map(str::to_string),
            comoving: units.comoving == Some(true),
            smooth: None,
        }
    }

    /// Unit of length, as the file has it.
    pub fn length_unit(&self) -> Option<&str> {
        self.length_unit.as_deref()
    }

    /// The summed quantity, if it is not mass: ` of Charge`.
    pub fn of_what(&self) -> String {
        self.weight_name.as_ref().map_or_else(String::new, |name| format!(" of {name}"))
    }

    /// Unit of surface density: `Msun/h / (Mpc/h)²`, or particles where no mass is known.
    pub fn unit(&self) -> String {
        let mass = self.mass_unit.as_deref().unwrap_or("particles");
        match self.length_unit.as_deref() {
            None => format!("{mass} / length²"),
            Some(l) if l.contains(['/', ' ']) => format!("{mass} / ({l})²"),
            Some(l) => format!("{mass} / {l}²"),
        }
    }
}
