//! Notes on recovered particles in meta.json.

use super::options::Options;
use particlegs_core::model::{Certificate, LawKind, Metadata, MetricGroup, hex};
use serde_json::{Map, Value, json};

/// The first thing that a reader of meta.json should see.
const SYNTHETIC: &str = "SYNTHETIC: drawn at random from a mixture of Gaussians that was fitted to a simulation. \
No particle of it was simulated; there are no identifiers.";
/// Analyses that no recovered particles support, whatever was measured.
const NEVER: &str = "positions and velocities of individual particles; histories and merger trees; structure smaller \
than the Gaussians that it was drawn from";

/// Said where the file has no certificate.
const NOTHING: &str =
    "the model has no certificate: compare the particles with the source (`particlegs stats`) before use";

/// Said of models of the alpha-blend law.
const BY_OPACITY: &str = "numbers of particles follow the opacities of a model fitted to pictures alone: densities \
are what pictures show of them, and bright places may have fewer particles than the source";

/// The keys beside box and units.
pub(super) fn notes(
    metadata: &Metadata,
    certificate: Option<&Certificate>,
    model_hash: [u8; 32],
    options: &Options,
    particles: u64,
) -> Map<String, Value> {
    let is_own_count = particles == metadata.count;
    let mut notes = Map::new();
    notes.insert("synthetic".into(), SYNTHETIC.into());
    notes.insert(
        "recovered_from".into(),
        json!({
            "model": options.model_name,
            "model_blake3": hex(&model_hash),
            "law": metadata.law.name(),
            "source": metadata.source,
            "source_blake3": hex(&metadata.source_hash),
            "source_particles": metadata.count,
            "method": options.method.name(),
            "scale": options.scale,
            "seed": options.seed,
            "each_gaussian_has_its_own_count": is_own_count && !options.method.by_volume(metadata.law),
            "program": concat!("particlegs ", env!("CARGO_PKG_VERSION")),
        }),
    );
    let mut supports = supports(certificate, metadata.units.length_text(), options, is_own_count);
    if metadata.law == LawKind::AlphaBlend {
        supports.push(BY_OPACITY.into());
    }
    notes.insert("supports".into(), supports.into());
    notes.insert("does_not_support".into(), NEVER.into());
    notes
}

/// Analyses that the file's measurements support.
fn supports(
    certificate: Option<&Certificate>,
    unit: Option<&str>,
    options: &Options,
    is_own_count: bool,
) -> Vec<String> {
    let Some(c) = certificate else {
        return with_method(vec![NOTHING.into()], options, is_own_count);
    };
    let mut all = Vec::new();
    for (group, entries) in c.groups() {
        match (group.tag, entries) {
            (MetricGroup::DENSITY, Some(entries)) => all.push(format!(
                "{} (measured for the model itself when it was made; drawing particles adds shot noise)",
                group.describe(&entries, unit)
            )),
            (MetricGroup::SCIENCE, Some(entries)) => all.push(group.describe(&entries, unit)),
            (MetricGroup::SCIENCE, None) => all.push(
                "P(k), r(k) and groups were not measured when the model was made: compare with the source \
                 (`particlegs stats`) before use"
                    .into(),
            ),
            _ => {}
        }
    }
    with_method(all, options, is_own_count)
}

/// Adds what the method, the scale and the number of particles say.
fn with_method(mut all: Vec<String>, options: &Options, is_own_count: bool) -> Vec<String> {
    match options.method {
        super::Method::Count => {}
        super::Method::Spaced => all.push(
            "distances to the nearest neighbour, tuned with one simulation at one ratio: compare before use; clumps \
             smaller than a Gaussian are invented, so correlations and groups on that scale are not real"
                .into(),
        ),
        super::Method::Stratified => all.push(
            "counts in cells: their shot noise is below that of a random draw; distances to neighbours are too even"
                .into(),
        ),
        other => all.push(format!("method `{}` is meant for comparison: prefer `count`", other.name())),
    }
    if options.scale != 1.0 {
        all.push(format!("the Gaussians were scaled by {}: densities differ from the model's", options.scale));
    }
    if !is_own_count {
        all.push("the number of particles differs from the source's, so shot noise and spacing differ too".into());
    }
    all
}
