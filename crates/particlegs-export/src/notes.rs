//! Notes of an exported file: its source, and what is lost.

use super::grid::lost_unit;
use super::{Group, Kind, ascii};
use particlegs_core::camera::Normalisation;
use particlegs_core::model::{LawKind, Model, Quantity};
use serde_json::{Map, Value, json};

pub struct Notes {
    /// The model, its snapshot, its units, for programs.
    pub facts: Map<String, Value>,
    /// The same for people, a line each.
    words: Vec<String>,
    /// Losses of the format, a sentence each.
    pub lost: Vec<String>,
}

impl Notes {
    /// Of a file whose cells get these `fields`.
    pub fn new(kind: Kind, model: &Model, name: &str, fields: &[Quantity]) -> Notes {
        let m = &model.metadata;
        let lost = lost(kind, m.law).iter().map(|s| s.to_string());
        let omitted = m.fields.iter().filter(|q| !fields.contains(q));
        let names: Vec<&str> = omitted.map(|q| &q.name[..]).collect();
        let without_fields = match (names.is_empty(), kind) {
            (true, _) | (_, Kind::Npz | Kind::Html) => None,
            (_, Kind::Csv) => Some("slopes of fields, and covariances of vectors".to_string()),
            _ => Some(format!("the fields: {}", names.join(", "))),
        };
        let without_unit = lost_unit(kind, m.units.length_text());
        let lost = lost.chain(without_fields).chain(without_unit).collect();
        let mut notes = Notes { facts: facts(model, name), words: words(model, name), lost };
        if kind.group() == Group::Splats {
            let frame = Normalisation::new(&m.bounds);
            let frame_in_words = match kind {
                Kind::Ply => "(world - center) * scale, x and y negated: y down, as published files have it",
                _ => "(world - center) * scale, y up",
            };
            notes.set("frame", frame_in_words);
            notes.set("center", json!(frame.center));
            notes.set("scale", json!(frame.scale));
        }
        notes
    }

    pub fn set(&mut self, key: &str, value: impl Into<Value>) {
        self.facts.insert(key.into(), value.into());
    }

    pub fn say(&mut self, line: String) {
        self.words.push(line);
    }

    pub fn text(&self, key: &str) -> Option<&str> {
        self.facts.get(key).and_then(Value::as_str)
    }

    pub fn number(&self, key: &str) -> Option<f64> {
        self.facts.get(key).and_then(Value::as_f64)
    }

    pub fn json(&self) -> Value {
        let mut all = self.facts.clone();
        all.insert("lost".into(), self.lost.clone().into());
        all.into()
    }

    /// All of it as lines of ASCII for people.
    pub fn lines(&self) -> Vec<String> {
        let lost = self.lost.iter().map(|loss| format!("lost: {loss}"));
        self.words.iter().cloned().chain(lost).map(|line| ascii(&line)).collect()
    }
}

/// Facts about a model; unknown ones are left out.
fn facts(model: &Model, name: &str) -> Map<String, Value> {
    let m = &model.metadata;
    let layers = model.layers.iter().map(|l| json!({ "name": l.name, "particles": l.count() }));
    let all = json!({
        "made_by": concat!("particlegs ", env!("CARGO_PKG_VERSION"), ", export"),
        "model": name,
        "source": m.source,
        "law": m.law.name(),
        "particles": m.count,
        "gaussians": model.gaussians(),
        "layers": layers.collect::<Value>(),
        "mass": model.mass(),
        "length_unit": m.units.length_text(),
        "mass_unit": m.units.mass_text().filter(|_| model.has_masses()),
        "weights": m.weight_name(),
        "comoving": m.units.comoving,
        "scale_factor": m.epoch.scale_factor,
        "hubble": m.cosmology.hubble,
        "time": m.epoch.time,
        "bounds": m.bounds,
        "cell": m.cell,
    });
    let Value::Object(all) = all else { return Map::new() };
    all.into_iter().filter(|(_, value)| !value.is_null()).collect()
}

fn words(model: &Model, name: &str) -> Vec<String> {
    let m = &model.metadata;
    let version = env!("CARGO_PKG_VERSION");
    let mut lines = vec![
        format!("written by particlegs {version}, export, from the model {name} of {}", m.source),
        format!("{} particles as {} Gaussians of the {} law", m.count, model.gaussians(), m.law.name()),
    ];
    let layers: Vec<String> = model.layers.iter().map(|l| format!("{} ({})", l.name, l.count())).collect();
    if layers.len() > 1 {
        lines.push(format!("layers (particles): {}", layers.join(", ")));
    }
    let comoving = if m.units.comoving == Some(true) { ", comoving" } else { "" };
    lines.push(format!("lengths in {}{comoving}", m.units.length_text().unwrap_or("an unstated unit")));
    if model.has_masses() {
        let weight_name = m.weight_name().unwrap_or("masses");
        lines.push(format!("{weight_name} in {}", m.units.mass_text().unwrap_or("an unstated unit")));
    }
    lines.extend(m.cell.as_ref().map(|cell| format!("box {cell}")));
    lines
}

fn lost(kind: Kind, law: LawKind) -> &'static [&'static str] {
    match (kind.group(), law) {
        (Group::Splats, LawKind::OpticalDepth) => &[
            "optical depth is approximated by alpha blending at the radius r and opacity a stated here: each Gaussian has \
             the peak opacity 1 - exp(-tau), tau its optical depth at the centre averaged over the directions of view, and \
             the covariance C + r^2 1 times Ein(tau) / (1 - exp(-tau)), so that it hides as much; neither r nor a can be \
             changed any more",
            "viewers widen splats by a fraction of a pixel and leave out what is fainter than 1/255: small Gaussians \
             far away look brighter, many faint ones vanish",
            "ParaView's rounded blending and FXAA",
            "counts, masses, the periodic box and the certificate",
        ],
        (Group::Splats, LawKind::AlphaBlend) => &[
            "the VizMapper: the radius and opacity are fixed",
            "the model was trained with a low-pass of one square pixel whose opacity is made up for; viewers widen splats \
             by 0.3 square pixels, most without that: small Gaussians far away look brighter",
            "counts, the periodic box and the certificate",
        ],
        (Group::Grid, _) => &[
            "detail below the cell size, and layers: each value is the mean density of a cell",
            "accuracy of about 1 % in cells crossed by Gaussians oblique to the grid; the total is exact",
            "the certificate, which states the accuracy for each cell size",
        ],
        (Group::Page, _) => &[],
        (Group::Gaussians, LawKind::OpticalDepth) => &["the blocks and the certificate; the Gaussians are complete"],
        (Group::Gaussians, LawKind::AlphaBlend) => {
            &["the VizMapper, the blocks and the certificate; the Gaussians are complete"]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_ascii_and_single() {
        let lost = vec!["this".to_string()];
        let mut notes = Notes { facts: Map::new(), words: Vec::new(), lost };
        notes.say("of a\nb \u{1b}[31m Größe".into());
        notes.set("particles", 7);
        let lines = notes.lines();
        assert_eq!(lines.len(), 2);
        assert!(lines.iter().all(|l| l.bytes().all(|b| (b' '..=b'~').contains(&b))), "{lines:?}");
        assert_eq!(lines[1], "lost: this");
        assert_eq!((&notes.json()["lost"][0], &notes.json()["particles"]), (&"this".into(), &7.into()));
    }
}
