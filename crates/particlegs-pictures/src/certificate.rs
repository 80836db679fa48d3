//! The pictures beside a certificate: truth, model and error side by side, and the surface density.

use crate::figure_options::FigureOptions;
use crate::finish::{Finisher, bytes};
use crate::options::PictureOptions;
use crate::provenance::{PictureProvenance, PictureUnits, SourceFile};
use crate::subject::{Quantities, ViewSubject};
use crate::view_content::ViewContent;
use particlegs_core::camera::{View, base_distance, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::model::{Model, hex};
use particlegs_core::picture::{Colormap, Gray8, Plane, Rgb8, Size, diverging, masked_psnr};
use particlegs_core::render::Scene;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Result, render};
use particlegs_figure::ticks::TickMarks;
use particlegs_figure::{ColourBar, Figure, FigureImage, FileKind, Panel, number};
use particlegs_files::output::{FileSet, Outputs, kinds, write_bytes};
use particlegs_particles::Particles;
use particlegs_reference::Reference;
use std::path::{Path, PathBuf};

const PANEL: Size = Size { width: 640, height: 640 };
/// Width and largest height of the surface density in pixels; it shows the bounds along z.
const DENSITY_WIDTH: usize = 1200;
const DENSITY_HEIGHTS: [f64; 2] = [300.0, 2400.0];
/// Camera: azimuth and elevation in degrees, and distance in base distances.
const ANGLES: [f64; 2] = [30.0, 20.0];
const DISTANCE: f64 = 0.85;
/// Font size, for pictures that are shown at half size.
const LETTERS: f64 = 9.0;

/// Makes a folder, and declares its pictures as outputs.
///
/// # Errors
/// [`particlegs_core::Error::Output`] for what may not be replaced; [`particlegs_core::Error::Io`].
pub fn declare(folder: &Path, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
    outputs.make_folder(folder)?;
    paths(folder).iter().try_for_each(|path| outputs.writes(path, &kinds::PNG, context).map(drop))
}

fn paths(folder: &Path) -> [PathBuf; 2] {
    ["comparison.png", "density.png"].map(|name| folder.join(name))
}

/// Writes `comparison.png` and `density.png` into a folder, both or none; returns their paths, which must be declared before.
///
/// # Errors
/// [`particlegs_core::Error::Io`]; those of drawing.
pub fn write(folder: &Path, model: &Model, particles: &Particles, context: &Context<'_>) -> Result<Vec<PathBuf>> {
    let set = FileSet::in_folder(folder)?;
    let [compared, summed] = paths(set.path());
    comparison(&compared, model, particles, context)?;
    density(&summed, model, context)?;
    set.finish()
}

fn finish<'a>(
    model: &Model,
    options: &'a FigureOptions,
    quantities: &'a Quantities,
    subject: &'a ViewSubject,
) -> Finisher<'a> {
    let m = &model.metadata;
    let style = if subject.density { "density" } else { "paraview" };
    let about = PictureProvenance {
        of: vec![SourceFile { name: m.source.clone(), blake3: hex(&m.source_hash), moment: None }],
        units: Some(PictureUnits::new(m.unit_system(), subject.density.then(|| model.density_of()))),
        ..PictureOptions::default().provenance(style, quantities)
    };
    let (colormap, field, legend) = (Colormap::default(), None, Vec::new());
    Finisher { options, colormap, field, quantities, subject, legend, circles: Vec::new(), stamps: &[], about }
}

fn figure_options() -> FigureOptions {
    FigureOptions { scale_bar: true, font_size: Some(LETTERS), dpi: Some(200.0), ..FigureOptions::default() }
}

fn comparison(path: &Path, model: &Model, particles: &Particles, context: &Context<'_>) -> Result<()> {
    let m = &model.metadata;
    let distance = DISTANCE * base_distance(&m.bounds, PANEL);
    let view = View {
        name: "comparison".into(),
        camera: spherical_camera(m.bounds.center(), ANGLES[0], ANGLES[1], distance),
        radius: m.default_radius,
        opacity: m.default_opacity,
    };
    let truth = Reference::with_bounds(particles, m.bounds).draw(&view, PANEL, ToneStyle::Paraview, context)?;
    let picture = render::draw(&Scene::new(model), &view, PANEL, ToneStyle::Paraview, context)?;
    let score = masked_psnr(&truth, &picture).map_or("identical".into(), |s| format!("masked PSNR {s:.1} dB"));
    let captions = [
        format!("{} particles, as ParaView draws them", grouped(m.count)),
        format!("{} Gaussians, {score}", grouped(model.gaussians() as u64)),
        "error: model − truth".to_string(),
    ];
    let (error, bar) = error(&truth, &picture);
    let (options, quantities, subject) =
        (figure_options(), Quantities::from_model(model), ViewSubject::of_model(model, false));
    let finish = finish(model, &options, &quantities, &subject);
    let range = Plane::EMPTY_RANGE;
    let mut panels = [truth, picture]
        .map(|gray| finish.panel(ViewContent::Levels(gray), &view, range, FileKind::Png))
        .into_iter()
        .collect::<Result<Vec<Panel>>>()?;
    panels.push(Panel { scale: panels[0].scale.clone(), ..Panel::plain(error) });
    for (panel, caption) in panels.iter_mut().zip(captions) {
        panel.caption = Some(caption);
    }
    let figure = Figure { bar: Some(bar), ..finish.figure(panels, 3, range) };
    write_bytes(path, &bytes(&figure, &options, FileKind::Png, &finish.about(&[view], PANEL, range)?)?)
}

fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        // Four digits stand together, as journals print them.
        if i > 0 && (digits.len() - i).is_multiple_of(3) && digits.len() > 4 {
            out.push('\u{a0}');
        }
        out.push(c);
    }
    out
}

/// The signed difference, red where the model is brighter and blue where it is darker, with its bar.
fn error(truth: &Gray8, model: &Gray8) -> (FigureImage, ColourBar) {
    let differences: Vec<i32> =
        truth.data.iter().zip(&model.data).map(|(t, m)| i32::from(*m) - i32::from(*t)).collect();
    let reach = reach(&differences);
    let data = differences.iter().map(|&d| diverging(d as f32 / reach)).collect();
    let signed = |v: f32| format!("{}{}", if v > 0.0 { "+" } else { "" }, number(f64::from(v)));
    let major = [-1.0f32, -0.5, 0.0, 0.5, 1.0].map(|t| (0.5 + 0.5 * f64::from(t), signed(t * reach)));
    let bar = ColourBar {
        title: "difference (grey levels)".into(),
        colours: (0..=255).map(|i| diverging(2.0 * i as f32 / 255.0 - 1.0)).collect(),
        ticks: TickMarks { major: major.to_vec(), minor: Vec::new() },
    };
    (FigureImage::Color(Rgb8 { size: truth.size, data }), bar)
}

/// A round number of levels that 99.9 % of the lit differences stay within.
fn reach(differences: &[i32]) -> f32 {
    let mut sizes: Vec<i32> = differences.iter().map(|d| d.abs()).filter(|d| *d > 0).collect();
    sizes.sort_unstable();
    let high = sizes.get(sizes.len().saturating_sub(1 + sizes.len() / 1000)).copied().unwrap_or(0);
    [4, 10, 20, 40, 100, 200].into_iter().find(|r| *r >= high).unwrap_or(256) as f32
}

fn density(path: &Path, model: &Model, context: &Context<'_>) -> Result<()> {
    let m = &model.metadata;
    let (options, quantities, subject) =
        (figure_options(), Quantities::from_model(model), ViewSubject::of_model(model, true));
    let extent = m.bounds.extent_nonzero();
    let height = DENSITY_WIDTH as f64 * (extent[1] / extent[0]);
    let height = height.clamp(DENSITY_HEIGHTS[0], DENSITY_HEIGHTS[1]).round();
    let size = Size { width: DENSITY_WIDTH, height: height as usize };
    let scene = Scene::new(model);
    let window = render::whole_view("density", &scene, m.cell, size)?;
    let plane = render::surface_density(&scene, &window, size, context)?;
    let view =
        View { name: "density".into(), camera: window.camera, radius: m.default_radius, opacity: m.default_opacity };
    finish(model, &options, &quantities, &subject).write(path, ViewContent::Density(plane), &view, None, FileKind::Png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_their_sign_and_a_round_range() {
        let size = Size { width: 4, height: 1 };
        let gray = |data: [u8; 4]| Gray8 { size, data: data.to_vec() };
        let (image, bar) = error(&gray([100; 4]), &gray([100, 103, 96, 100]));
        let [same, brighter, darker] = [0, 1, 2].map(|x| image.pixel(x, 0));
        assert!(same == [0; 3] && brighter[0] > brighter[2] && darker[2] > darker[0]);
        assert_eq!(bar.ticks.major[4].1, "+4");
        assert_eq!([reach(&[0, 0]), reach(&[7; 100])], [4.0, 10.0]);
    }

    #[test]
    fn thousands_are_separated() {
        assert_eq!([2633, 20_000, 2_097_152].map(grouped), ["2633", "20\u{a0}000", "2\u{a0}097\u{a0}152"]);
    }
}
