//! LAMMPS text out: one frame, `id type x y z` and masses where they are known.

use crate::fields::{OutField, StandardField};
use particlegs_core::context::Context;
use particlegs_core::model::Mass;
use particlegs_core::space::Cell;
use particlegs_core::text::one_line;
use particlegs_core::{Error, Result, parallel};
use particlegs_files::output;
use particlegs_particles::{Number, Run, SelectedParticles};
use std::fmt::Write as _;
use std::path::Path;

/// Runs formatted at once, at most: some MB of text each.
const BATCH: usize = 8;

/// Writes `particles` as one frame; gives the bytes written. Numbers are the shortest text that gives the same bits
/// when it is read again. A particle's type is its layer's number, from 1; its mass stands in a
/// column `mass` where all masses are known.
pub fn write(particles: &SelectedParticles<'_>, out: &Path, context: &Context<'_>) -> Result<u64> {
    let frame = FrameOut::new(particles, context)?;
    context.begin("writing", particles.total());
    let (mut bytes, mut failed) = (0, None);
    let done = output::write_atomic(out, |to| {
        let mut put = |text: &[u8]| {
            bytes += text.len() as u64;
            to.write_all(text).map_err(|e| Error::io(out, e))
        };
        let written = put(frame.header().as_bytes()).and_then(|()| frame.rows(context, &mut put));
        // Why it was stopped says more than that it was.
        written.map_err(|e| {
            failed = Some(e);
            std::io::Error::other("stopped")
        })
    });
    done.map_err(|e| failed.unwrap_or(e))?;
    context.end();
    Ok(bytes)
}

struct FrameOut<'a> {
    kept: &'a SelectedParticles<'a>,
    cell: Cell,
    /// Mass of a particle of weight 1, by layer; none where masses are not known, or are a field.
    masses: Option<Vec<f64>>,
    fields: Vec<Vec<OutField>>,
}

impl<'a> FrameOut<'a> {
    fn new(particles: &'a SelectedParticles<'a>, context: &Context<'_>) -> Result<Self> {
        let layers = particles.layers();
        let fields = common(particles);
        let known = !fields.iter().any(|f| f[0].name == "mass");
        let known = known && (particles.weighted() || layers.iter().all(|l| l.mass.unit().is_some()));
        // Beside layers with weights, the weights of others are their masses.
        let unit = |mass: Mass| if particles.weighted() && !mass.is_weighted() { 1.0 } else { mass.unit_or_one() };
        let masses = known.then(|| layers.iter().map(|l| unit(l.mass)).collect());
        let cell = match particles.meta().cell {
            Some(cell) => cell,
            None => bounds(particles, context)?,
        };
        Ok(FrameOut { kept: particles, cell, masses, fields })
    }

    fn header(&self) -> String {
        let mut text = String::new();
        if let Some(style) = style_of(self.kept) {
            let _ = writeln!(text, "ITEM: UNITS\n{style}");
        }
        if let Some(time) = self.kept.meta().epoch.time.filter(|t| t.is_finite()) {
            let _ = writeln!(text, "ITEM: TIME\n{}", zmij::Buffer::new().format(time));
        }
        let step = self.kept.meta().epoch.step.unwrap_or(0);
        let _ = writeln!(text, "ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{}", self.kept.total());
        box_bounds(&self.cell, &mut text);
        let mass = if self.masses.is_some() { " mass" } else { "" };
        let columns: String = self.others().flat_map(|f| names(&f[0])).map(|name| format!(" {name}")).collect();
        let _ = writeln!(text, "ITEM: ATOMS id type x y z{mass}{columns}");
        text
    }

    fn field(&self, name: &str, layer: usize) -> Option<&OutField> {
        self.fields.iter().find(|f| f[0].name == name)?.get(layer)
    }

    /// Fields that are columns behind the others.
    fn others(&self) -> impl Iterator<Item = &Vec<OutField>> {
        self.fields.iter().filter(|f| !OWN.contains(&&f[0].name[..]))
    }

    /// Formats runs in parallel and gives their text in order.
    fn rows(&self, context: &Context<'_>, write: &mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let batch = (2 * parallel::threads()).min(BATCH);
        let mut scratch: Vec<(Run, Vec<u8>)> = (0..batch).map(|_| Default::default()).collect();
        let mut next = 0;
        while next < self.kept.runs() {
            let runs = next..self.kept.runs().min(next + batch as u64);
            let format = |(id, (run, text)): (u64, &mut (Run, Vec<u8>))| {
                context.check()?;
                text.clear();
                self.format(id, run, text)?;
                context.advance(run.columns[0].len() as u64);
                Ok(())
            };
            let work: Vec<_> = runs.clone().zip(&mut scratch).collect();
            parallel::try_for_each(work, format)?;
            for (_, text) in &scratch[..(runs.end - runs.start) as usize] {
                write(text)?;
            }
            next = runs.end;
        }
        Ok(())
    }

    fn format(&self, id: u64, run: &mut Run, text: &mut Vec<u8>) -> Result<()> {
        self.kept.load(id, run)?;
        let layer = self.kept.layer_of(id);
        let [x, y, z, weights] = &run.columns;
        let mut number = zmij::Buffer::new();
        let (ids, types) = (self.field("id", layer), self.field("type", layer));
        let others: Vec<&OutField> = self.others().filter_map(|f| f.get(layer)).collect();
        for i in 0..x.len() {
            match ids {
                Some(field) => push_field(field, run, i, text),
                None => push_whole(self.kept.first(id) + i as u64 + 1, text),
            }
            text.push(b' ');
            match types {
                Some(field) => push_field(field, run, i, text),
                None => push_whole(layer as u64 + 1, text),
            }
            for k in 0..3 {
                text.push(b' ');
                text.extend_from_slice(match self.kept.is_wide() {
                    true => number.format(run.wide(self.kept.origin(), i)[k]).as_bytes(),
                    false => number.format([x, y, z][k][i]).as_bytes(),
                });
            }
            if let Some(masses) = &self.masses {
                text.push(b' ');
                // A weight that is the mass itself keeps its bits.
                let mass = match weights.get(i) {
                    Some(&weight) if masses[layer] == 1.0 => number.format(weight),
                    Some(&weight) => number.format(f64::from(weight) * masses[layer]),
                    None => number.format(masses[layer]),
                };
                text.extend_from_slice(mass.as_bytes());
            }
            for field in &others {
                text.push(b' ');
                push_field(field, run, i, text);
            }
            text.push(b'\n');
        }
        Ok(())
    }
}

const OWN: [&str; 2] = ["id", "type"];
/// LAMMPS's names of fields, and those of others.
const STANDARD: [StandardField; 2] = [
    ("id", 1, &["ParticleIDs", "ID", "ids", "ParticleID", "particle_id", "pid"]),
    ("mass", 1, &["Masses", "MASS", "Mass", "masses"]),
];
const MOST_COLUMNS: usize = 1000;

pub fn common(particles: &SelectedParticles<'_>) -> Vec<Vec<OutField>> {
    let mut all = crate::fields::common(particles, &STANDARD, &["x", "y", "z"]);
    let is_whole = |f: &OutField| f.columns.len() == 1 && f.number.is_whole();
    all.retain(|f| !OWN.contains(&&f[0].name[..]) || is_whole(&f[0]));
    let mut columns = 0;
    all.retain(|f| {
        columns += f[0].columns.len();
        columns <= MOST_COLUMNS
    });
    all
}

/// Names of a field's columns: `vx vy vz` of velocities, `name[1]` of others.
fn names(field: &OutField) -> Vec<String> {
    let name = one_line(&field.name).replace(char::is_whitespace, "_");
    let is_velocity = ["velocities", "velocity", "vel", "velo", "v"].contains(&&name.to_ascii_lowercase()[..]);
    match field.columns.len() {
        1 => vec![name],
        3 if is_velocity => ["vx", "vy", "vz"].map(String::from).to_vec(),
        count => (1..=count).map(|k| format!("{name}[{k}]")).collect(),
    }
}

fn push_field(field: &OutField, run: &Run, i: usize, text: &mut Vec<u8>) {
    for (k, &column) in field.columns.iter().enumerate() {
        if k > 0 {
            text.push(b' ');
        }
        let stored = run.field(column, i);
        let value = field.number.value(stored);
        match field.number {
            Number::F32 => text.extend_from_slice(zmij::Buffer::new().format(value as f32).as_bytes()),
            Number::F64 => text.extend_from_slice(zmij::Buffer::new().format(value).as_bytes()),
            // By their bits: f64 does not hold all whole numbers of 64 bits.
            Number::U64 => push_whole(stored.bits(), text),
            Number::I64 => text.extend_from_slice((stored.bits() as i64).to_string().as_bytes()),
            _ => text.extend_from_slice((value as i64).to_string().as_bytes()),
        }
    }
}

fn push_whole(mut value: u64, text: &mut Vec<u8>) {
    let mut digits = [0; 20];
    let mut at = digits.len();
    loop {
        at -= 1;
        digits[at] = b'0' + (value % 10) as u8;
        value /= 10;
        if value == 0 {
            break;
        }
    }
    text.extend_from_slice(&digits[at..]);
}

/// The box around particles that have no cell; it repeats nowhere.
fn bounds(particles: &SelectedParticles<'_>, context: &Context<'_>) -> Result<Cell> {
    context.begin("finding the box", particles.total());
    let ends = particles.map_runs(context, |id, run| {
        particles.load(id, run)?;
        context.advance(run.columns[0].len() as u64);
        Ok([0, 1, 2].map(|k| {
            let both = |(low, high): (f64, f64), v: f64| (low.min(v), high.max(v));
            let all = (0..run.columns[0].len()).map(|i| run.wide(particles.origin(), i)[k]);
            all.fold((f64::INFINITY, f64::NEG_INFINITY), both)
        }))
    })?;
    context.end();
    let (mut origin, mut lengths) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let low = ends.iter().map(|e| e[k].0).fold(f64::INFINITY, f64::min);
        let high = ends.iter().map(|e| e[k].1).fold(f64::NEG_INFINITY, f64::max);
        // A box has some thickness.
        let room = if low < high { 0.0 } else { 0.5 };
        origin[k] = low - room;
        lengths[k] = high + room - origin[k];
    }
    Ok(Cell { origin, periodic: [false; 3], ..Cell::orthogonal(lengths) })
}

/// The style of units in which lengths and masses are what they are. Styles that share both are told
/// apart by quantities that are not written.
fn style_of(particles: &SelectedParticles<'_>) -> Option<&'static str> {
    let meta = particles.meta();
    if meta.units.comoving == Some(true) {
        return None;
    }
    let styles = ["metal", "si", "cgs", "electron", "micro", "nano", "lj"];
    styles.into_iter().find(|style| {
        let [length, mass, _] = super::frame::units_of(style);
        length == meta.units.length_text() && (meta.units.mass.is_none() || meta.units.mass_text() == mass)
    })
}

/// The box as LAMMPS writes it: upright, tilted, or with any vectors.
fn box_bounds(cell: &Cell, text: &mut String) {
    let [a, b, c] = cell.vectors;
    let flags = cell.periodic.map(|p| if p { "pp" } else { "ff" }).join(" ");
    let low = cell.origin;
    // LAMMPS's usual spelling needs the first vector along x and the second in the plane of x and y.
    let is_upper = a[1] == 0.0 && a[2] == 0.0 && b[2] == 0.0 && a[0] > 0.0 && b[1] > 0.0 && c[2] > 0.0;
    let (shape, rows) = if !is_upper {
        ("abc origin ", (0..3).map(|k| [&cell.vectors[k][..], &low[k..=k]].concat()).collect())
    } else {
        let [xy, xz, yz] = [b[0], c[0], c[1]];
        // The bounds are those of the box around the tilted cell.
        let shifts = [vec![0.0, xy, xz, xy + xz], vec![0.0, yz], vec![0.0]];
        let row = |k: usize| {
            let least = shifts[k].iter().copied().fold(0.0, f64::min);
            let most = shifts[k].iter().copied().fold(0.0, f64::max);
            vec![low[k] + least, low[k] + cell.vectors[k][k] + most]
        };
        let mut rows: Vec<Vec<f64>> = (0..3).map(row).collect();
        let is_tilted = xy != 0.0 || xz != 0.0 || yz != 0.0;
        if is_tilted {
            rows.iter_mut().zip([xy, xz, yz]).for_each(|(row, tilt)| row.push(tilt));
        }
        (if is_tilted { "xy xz yz " } else { "" }, rows)
    };
    let _ = writeln!(text, "ITEM: BOX BOUNDS {shape}{flags}");
    let mut number = zmij::Buffer::new();
    for row in rows as Vec<Vec<f64>> {
        let row: Vec<String> = row.iter().map(|v| number.format(*v).to_string()).collect();
        let _ = writeln!(text, "{}", row.join(" "));
    }
}
