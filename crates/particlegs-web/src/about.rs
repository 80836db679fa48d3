//! What a page says of a model.

use particlegs_core::codec::FileInfo;
use particlegs_core::model::{LawKind, Metadata, hex, species_title};
use particlegs_core::picture::{Colormap, Rgb8, journal_unit};
use serde::Serialize;

/// One model, as its file says without its Gaussians.
#[derive(Serialize)]
pub(crate) struct ModelSummary<'a> {
    metadata: &'a Metadata,
    /// BLAKE3 of the file.
    blake3: String,
    /// The names of colour maps.
    colormaps: Vec<&'static str>,
    gaussians: usize,
    /// Are masses known, so that densities have units?
    has_masses: bool,
    /// Of all particles, where it is known.
    mass: Option<f64>,
    /// Bytes of the particles as float32 columns.
    raw_bytes: u64,
    layers: Vec<LayerSummary<'a>>,
    /// Can it be drawn by adding up footprints, as a graphics card does?
    adds_up: bool,
    units: SummaryUnits,
    /// Radii and opacities (lowest and highest) at which the certificate has pictures.
    certified: Option<[[f64; 2]; 2]>,
}

/// Units as the command prints them; that of length is empty where it is not known.
#[derive(Serialize)]
struct SummaryUnits {
    length: String,
    mass: String,
    surface: String,
    /// Of number and mass density.
    number: String,
    density: String,
}

impl SummaryUnits {
    fn new(m: &Metadata, has_masses: bool) -> Self {
        let mass = if has_masses { m.units.mass_text().unwrap_or("mass") } else { "particles" };
        let length = m.units.length_text();
        let per = |what: &str, power: u32| journal_unit(&format!("{what} / ({})^{power}", length.unwrap_or("length")));
        SummaryUnits {
            length: journal_unit(length.unwrap_or_default()),
            mass: journal_unit(mass),
            surface: per(mass, 2),
            number: per("particles", 3),
            density: per(mass, 3),
        }
    }
}

#[derive(Serialize)]
struct LayerSummary<'a> {
    name: &'a str,
    /// The species as people call it.
    title: String,
    particles: u64,
    gaussians: usize,
    color: [u8; 3],
}

impl<'a> ModelSummary<'a> {
    pub(crate) fn new(info: &'a FileInfo, file: &[u8]) -> Self {
        let layers = info.layers.iter().enumerate().map(|(place, l)| LayerSummary {
            color: Rgb8::layer_color(place),
            name: &l.name,
            title: species_title(&l.name),
            particles: l.content.iter().map(|b| b.count).sum(),
            gaussians: l.content.iter().map(|b| b.gaussians as usize).sum(),
        });
        let layers: Vec<LayerSummary<'_>> = layers.collect();
        ModelSummary {
            metadata: &info.metadata,
            blake3: hex(blake3::hash(file).as_bytes()),
            colormaps: Colormap::ALL.iter().map(|c| c.name()).collect(),
            gaussians: info.gaussians(),
            has_masses: info.mass().is_some(),
            mass: info.mass(),
            raw_bytes: layers.iter().zip(&info.layers).map(|(a, l)| a.particles * l.mass.particle_bytes()).sum(),
            layers,
            adds_up: info.metadata.law == LawKind::OpticalDepth,
            units: SummaryUnits::new(&info.metadata, info.mass().is_some()),
            certified: certified(info),
        }
    }
}

/// The settings with pictures, or the default ones alone.
fn certified(info: &FileInfo) -> Option<[[f64; 2]; 2]> {
    let certificate = info.certificate.as_ref()?;
    let m = &info.metadata;
    let settings = certificate.pictures.as_ref().map(|p| &p.settings);
    let around = |of: &dyn Fn(usize) -> f64, default: f64| {
        let values = (0..settings.map_or(0, |s| s.len())).map(of);
        values.fold([default; 2], |[low, high], v| [low.min(v), high.max(v)])
    };
    let radius = |i: usize| settings.map_or(1.0, |s| s[i].radius) * m.default_radius;
    let opacity = |i: usize| settings.map_or(1.0, |s| s[i].opacity);
    Some([around(&radius, m.default_radius), around(&opacity, m.default_opacity)])
}
