//! Output of `info` for a snapshot.

use crate::common::CommandContext;
use crate::report::wrapped;
use particlegs_core::Result;
use particlegs_core::model::{Cosmology, Dimension, Epoch, Units};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::text::one_line;
use particlegs_formats::{Choice, Description, SpeciesField, SpeciesMass};
use particlegs_particles::SnapshotMeta;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Serialize)]
struct SnapshotInfoReport<'a> {
    #[serde(flatten)]
    description: &'a Description,
    particles: u64,
    redshift: Option<f64>,
    /// One per species, in order; empty if they were not read.
    bounds: &'a [Bounds],
}

pub fn print(context: &CommandContext, paths: &[PathBuf], choice: &Choice, bounds: bool) -> Result<()> {
    let (description, bounds) = choice.describe(paths, bounds, context)?;
    let report = SnapshotInfoReport {
        particles: description.species.iter().map(|s| s.count).sum(),
        redshift: description.meta.epoch.redshift(),
        description: &description,
        bounds: &bounds,
    };
    context.finish(&text(&report), &report)
}

fn text(r: &SnapshotInfoReport<'_>) -> String {
    let (d, m) = (r.description, &r.description.meta);
    let mut out = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "{}", wrapped(&format!("{name:<18} "), &one_line(&value), 19));
    };
    row("format", d.format.clone());
    row("files", files(&d.files));
    if let Some(f) = &d.frames {
        let step = f.step.map_or(String::new(), |s| format!(", step {s}"));
        row("frames", format!("{}; this is frame {}{step} (choose another with --frame)", f.count, f.chosen));
    }
    row("particles", format!("{}", r.particles));
    row("cell", m.cell.as_ref().map_or("not stated, so not periodic (set it with --box)".into(), |c| cell(c, m)));
    let length = length(&m.units);
    row("unit of length", if m.units.length.is_some() { length } else { length + " (set it with --length-unit)" });
    moment(&m.units, &m.cosmology, &m.epoch).into_iter().for_each(|(name, value)| row(name, value));
    for (i, species) in d.species.iter().enumerate() {
        let aliases =
            if species.aliases.is_empty() { String::new() } else { format!(" ({})", species.aliases.join(", ")) };
        let unit = m.units.mass_text().unwrap_or("");
        let mass = match &species.mass {
            SpeciesMass::Unknown => "mass not stated".to_string(),
            // The unit may be empty, which leaves two blanks.
            SpeciesMass::Each(mass) => format!("mass {mass} {unit} each").replace("  ", " "),
            SpeciesMass::Field(field) => format!("masses in `{field}`"),
        };
        row("species", format!("`{}`{aliases}: {} particles, {mass}", species.name, species.count));
        if let Some(b) = r.bounds.get(i) {
            row("  bounds", format!("{} to {}", point(b.min), point(b.max)));
        }
        row("  positions", species.positions.clone());
        row("  fields", species.fields.iter().map(field).collect::<Vec<_>>().join(", "));
    }
    for note in &d.notes {
        row("note", note.clone());
    }
    out.trim_end().to_string()
}

fn files(files: &[PathBuf]) -> String {
    match files {
        [one] => one.display().to_string(),
        [first, .., last] => format!("{}: {} to {}", files.len(), first.display(), last.display()),
        [] => "none".into(),
    }
}

fn field(f: &SpeciesField) -> String {
    let shape = if f.components == 1 { String::new() } else { format!("[{}]", f.components) };
    let unit = f.unit.as_deref().map_or(String::new(), |u| format!(" {u}"));
    format!("{} {}{shape}{unit}", f.name, f.kind)
}

fn cell(c: &Cell, m: &SnapshotMeta) -> String {
    let unit = m.units.length_text().map_or(String::new(), |u| format!(" ({u})"));
    format!("{c}{unit}")
}

pub fn length(units: &Units) -> String {
    let comoving = match units.comoving {
        Some(true) => ", comoving",
        Some(false) => ", physical",
        None => "",
    };
    let size = units.length.as_ref().map_or_else(String::new, |u| u.describe_size(Dimension::Length));
    said(units.length_text()) + comoving + &size
}

/// Other known units, the time and the cosmology, by name.
pub fn moment(units: &Units, cosmology: &Cosmology, epoch: &Epoch) -> Vec<(&'static str, String)> {
    let c = cosmology;
    let factor = epoch.redshift().zip(epoch.scale_factor).map(|(z, a)| format!("{a} (z = {z:.4})"));
    let mut rows = vec![
        ("unit of mass", said(units.mass.as_ref().map(|u| u.describe(Dimension::Mass)))),
        ("scale factor", said(factor)),
    ];
    rows.push(("h", said(c.hubble)));
    let omegas = [("Omega_m", c.omega_matter), ("Omega_Lambda", c.omega_lambda), ("Omega_b", c.omega_baryon)];
    rows.extend(omegas.into_iter().filter_map(|(name, v)| Some((name, v?.to_string()))));
    let time_unit = units.time.as_ref().map_or(String::new(), |u| format!(" {}", u.text));
    rows.push(("time", said(epoch.time.map(|t| format!("{t}{time_unit}")))));
    rows.extend(epoch.frame.map(|frame| ("frame", frame.to_string())));
    rows.extend(epoch.step.map(|step| ("time step", step.to_string())));
    rows
}

pub fn point(p: [f64; 3]) -> String {
    format!("({}, {}, {})", p[0], p[1], p[2])
}

fn said(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "not stated".into(), |v| v.to_string())
}
