//! What `compress --pictures` writes: truth beside model beside error, and the surface density.

use crate::annotate::{DensityPicture, PanelImage, ScaleBar, annotate_density, panels};
use crate::density_args::Quantities;
use particlegs::Result;
use particlegs::camera::{DensityView, View, Window, base_distance, spherical_camera};
use particlegs::model::Model;
use particlegs::particles::Particles;
use particlegs::picture::{Colormap, Size, masked_psnr, write_png};
use particlegs::progress::Progress;
use particlegs::reference::Reference;
use particlegs::render::{self, Scene};
use particlegs::splat::Look;
use particlegs_files::output::FileSet;
use std::path::{Path, PathBuf};

/// One panel.
const PANEL: Size = Size { width: 640, height: 640 };
/// Pixels across the surface density, and at most down; the window is the bounds seen along z.
const DENSITY_WIDTH: usize = 1200;
const DENSITY_HEIGHTS: [f64; 2] = [300.0, 2400.0];
/// Where the camera stands: degrees, and times the base distance.
const ANGLES: [f64; 2] = [30.0, 20.0];
const DISTANCE: f64 = 0.85;

/// The pictures of a folder.
pub fn paths(folder: &Path) -> [PathBuf; 2] {
    ["comparison.png", "density.png"].map(|name| folder.join(name))
}

/// Writes them, both or none; the paths written. Their places have been looked at before.
pub fn write(folder: &Path, model: &Model, particles: &Particles, progress: &dyn Progress) -> Result<Vec<PathBuf>> {
    let set = FileSet::in_folder(folder)?;
    let [compared, summed] = paths(set.path());
    comparison(&compared, model, particles, progress)?;
    density(&summed, model, progress)?;
    set.finish()
}

fn comparison(path: &Path, model: &Model, particles: &Particles, progress: &dyn Progress) -> Result<()> {
    let m = &model.metadata;
    let distance = DISTANCE * base_distance(&m.bounds, PANEL);
    let view = View {
        name: "comparison".into(),
        camera: spherical_camera(m.bounds.center(), ANGLES[0], ANGLES[1], distance),
        radius: m.default_radius,
        opacity: m.default_opacity,
    };
    let truth = Reference::with_bounds(particles, m.bounds).draw(&view, PANEL, Look::Paraview, progress)?;
    let drawn = render::draw(&Scene::of(model), &view, PANEL, Look::Paraview, progress)?;
    let score = masked_psnr(&truth, &drawn).map_or("identical".into(), |s| format!("masked PSNR {s:.1} dB"));
    let captions =
        [format!("{} particles, as ParaView draws them", m.count), format!("{} Gaussians, {score}", model.gaussians())];
    let picture = panels(&[
        (&captions[0], PanelImage::Gray(&truth)),
        (&captions[1], PanelImage::Gray(&drawn)),
        ("error: model - truth", PanelImage::Error { truth: &truth, model: &drawn }),
    ]);
    write_png(path, picture.size, picture.data.as_flattened())
}

fn density(path: &Path, model: &Model, progress: &dyn Progress) -> Result<()> {
    let m = &model.metadata;
    let quantities = Quantities::of_model(model);
    let extent = m.bounds.extent_nonzero();
    let height = DENSITY_WIDTH as f64 * (extent[1] / extent[0]);
    let height = height.clamp(DENSITY_HEIGHTS[0], DENSITY_HEIGHTS[1]).round();
    let size = Size { width: DENSITY_WIDTH, height: height as usize };
    let width = extent[0].max(extent[1] * DENSITY_WIDTH as f64 / height);
    let window = Window { center: m.bounds.center(), angles_deg: [0.0; 2], width, depth: None };
    let view = DensityView::orthographic("density", &window, size, &m.bounds, m.cell)?;
    let plane = render::surface_density(&Scene::of(model), &view, size, progress)?;
    let picture = annotate_density(
        &plane,
        &DensityPicture {
            colormap: Colormap::default(),
            range: None,
            unit: quantities.unit(),
            scale_bar: ScaleBar {
                world_per_pixel: width / DENSITY_WIDTH as f64,
                unit: m.length_unit.clone().unwrap_or_default(),
                comoving: m.comoving == Some(true),
                note: String::new(),
            },
            annotations: true,
        },
    );
    write_png(path, picture.size, picture.data.as_flattened())
}
