//! A summary of a model for the page.

use particlegs_core::codec::{FileInfo, FrameCoding, FrameEntry, SeriesFile};
use particlegs_core::model::{
    LawKind, Mass, Metadata, Model, Quantity, QuantityKind, Units, density_of, species_title,
};
use particlegs_core::picture::{Colormap, Rgb8, journal_unit};
use particlegs_core::render::FieldQuery;
use serde::Serialize;

/// A model's summary, read without its Gaussians.
#[derive(Serialize)]
pub(crate) struct ModelSummary<'a> {
    metadata: &'a Metadata,
    /// BLAKE3 of the file; empty of a series.
    blake3: String,
    colormaps: Vec<&'static str>,
    gaussians: usize,
    /// Whether masses are known, so that densities are in units of mass.
    has_masses: bool,
    /// The quantity that the density sums.
    density_of: &'a str,
    /// Total mass, if known.
    mass: Option<f64>,
    /// Bytes of what is stored as the snapshot held it.
    raw_bytes: u64,
    layers: Vec<LayerSummary>,
    /// Whether it can be drawn by adding footprints, which the GPU renderer does.
    adds_up: bool,
    units: SummaryUnits,
    fields: Vec<FieldSummary>,
    /// Lowest and highest radius and opacity of the certificate's pictures.
    certified: Option<[[f64; 2]; 2]>,
}

/// Units as the command prints them; `length` is empty if unknown.
#[derive(Serialize)]
struct SummaryUnits {
    length: String,
    mass: String,
    surface: String,
    /// Number density; mass density is `density`.
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

/// A field, and the maps of it that the page offers.
#[derive(Serialize)]
struct FieldSummary {
    name: String,
    /// As the command prints it; empty if unknown.
    unit: String,
    vector: bool,
    maps: Vec<FieldMapSummary>,
    /// Units of the mean and of the dispersion at a place.
    place_units: [String; 2],
}

#[derive(Serialize)]
struct FieldMapSummary {
    /// As `render --field` takes it.
    name: String,
    title: String,
    unit: String,
}

impl FieldSummary {
    /// By the unit of length.
    fn new(q: &Quantity, length: Option<&str>) -> Self {
        let vector = q.kind == QuantityKind::Vector;
        let mut names = FieldQuery::names(q);
        // Along the line of sight first.
        names.rotate_right(1);
        names.push(format!("dispersion.{}", names[0]));
        let map = |name: String| {
            let fields = std::slice::from_ref(q);
            let query = FieldQuery::new(&name, fields).ok()?;
            Some(FieldMapSummary { name, title: query.title(), unit: journal_unit(&query.unit(fields, length)) })
        };
        let unit = q.unit.as_ref().map_or(String::new(), |u| journal_unit(&u.text));
        let place_units = [q.place_unit(length), q.dispersion_unit()];
        FieldSummary {
            name: q.name.clone(),
            place_units: place_units.map(|u| u.map_or(String::new(), |u| journal_unit(&u))),
            unit,
            vector,
            maps: names.into_iter().filter_map(map).collect(),
        }
    }
}

#[derive(Serialize)]
struct LayerSummary {
    name: String,
    /// The name of the species for display.
    title: String,
    particles: u64,
    gaussians: usize,
    color: [u8; 3],
}

impl LayerSummary {
    fn new(place: usize, name: &str, particles: u64, gaussians: usize) -> Self {
        let (color, title) = (Rgb8::layer_color(place), species_title(name));
        LayerSummary { name: name.into(), title, particles, gaussians, color }
    }
}

/// A series' summary, read before its frames are decoded.
#[derive(Serialize)]
pub(crate) struct SeriesSummary {
    /// The quantity of its clock, such as `scale factor`.
    clock: &'static str,
    frames: Vec<FrameSummary>,
}

/// A frame that is there, and where its bytes are in the file.
#[derive(Serialize)]
struct FrameSummary {
    number: usize,
    keyframe: bool,
    time: f64,
    /// Its time as pictures show it.
    text: String,
    start: usize,
    length: usize,
}

impl SeriesSummary {
    pub(crate) fn new(series: &SeriesFile<'_>, units: &Units) -> Self {
        let stored_frames = series.frames.iter().enumerate().filter(|(_, f)| f.kind != FrameCoding::Missing);
        let frame = |(number, f): (usize, &FrameEntry)| FrameSummary {
            number,
            keyframe: f.kind == FrameCoding::Keyframe,
            time: f.time,
            text: series.clock.text(f.time, units),
            start: f.place.start,
            length: f.place.len(),
        };
        SeriesSummary { clock: series.clock.name(), frames: stored_frames.map(frame).collect() }
    }
}

/// The part of a [`ModelSummary`] that changes from one moment of a series to another.
#[derive(Serialize)]
pub(crate) struct MomentSummary<'a> {
    metadata: &'a Metadata,
    gaussians: usize,
    mass: Option<f64>,
    layers: Vec<LayerSummary>,
    /// The time as pictures show it.
    text: String,
    /// Whether it lies between two frames.
    interpolated: bool,
}

impl<'a> MomentSummary<'a> {
    pub(crate) fn new(model: &'a Model, text: String, interpolated: bool) -> Self {
        let layers = model.layers.iter().enumerate().map(|(place, l)| {
            let gaussians = l.content.iter().map(|b| b.gaussians.len()).sum();
            LayerSummary::new(place, &l.name, l.content.iter().map(|b| b.count).sum(), gaussians)
        });
        let metadata = &model.metadata;
        let mass = model.layers.iter().all(|l| l.mass != Mass::Unknown).then_some(metadata.mass);
        MomentSummary { metadata, gaussians: model.gaussians(), mass, layers: layers.collect(), text, interpolated }
    }
}

impl<'a> ModelSummary<'a> {
    pub(crate) fn new(info: &'a FileInfo, blake3: String) -> Self {
        let layers = info.species_layers().into_iter().enumerate();
        let layers =
            layers.map(|(place, l)| LayerSummary::new(place, &l.name, l.content.particles, l.content.gaussians));
        ModelSummary {
            metadata: &info.metadata,
            blake3,
            colormaps: Colormap::ALL.iter().map(|c| c.name()).collect(),
            gaussians: info.gaussians(),
            has_masses: info.mass().is_some(),
            density_of: density_of(info.mass().is_some(), info.metadata.weight_name()),
            mass: info.mass(),
            raw_bytes: info.raw_bytes(),
            layers: layers.collect(),
            adds_up: info.metadata.law == LawKind::OpticalDepth,
            units: SummaryUnits::new(&info.metadata, info.mass().is_some()),
            fields: info
                .metadata
                .fields
                .iter()
                .map(|q| FieldSummary::new(q, info.metadata.units.length_text()))
                .collect(),
            certified: certified(info),
        }
    }
}

/// The range of the certificate's settings, or only the default ones.
fn certified(info: &FileInfo) -> Option<[[f64; 2]; 2]> {
    let certificate = info.certificate.as_ref()?;
    let m = &info.metadata;
    let settings = certificate.pictures.as_ref().map(|p| &p.settings);
    let around = |setting_of: &dyn Fn(usize) -> f64, default: f64| {
        let values = (0..settings.map_or(0, |s| s.len())).map(setting_of);
        values.fold([default; 2], |[low, high], v| [low.min(v), high.max(v)])
    };
    let radius = |i: usize| settings.map_or(1.0, |s| s[i].radius) * m.default_radius;
    let opacity = |i: usize| settings.map_or(1.0, |s| s[i].opacity);
    Some([around(&radius, m.default_radius), around(&opacity, m.default_opacity)])
}
