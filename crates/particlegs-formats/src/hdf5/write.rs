//! HDF5 out, in the layout of Gadget-4: one group a layer, one file, streamed.

use super::encode::{self, Attribute, OutDataSet, OutGroup, OutValue};
use super::units;
use crate::fields::{OutField, StandardField, outputs};
use crate::physical::{VelocityConvention, physical};
use particlegs_core::context::Context;
use particlegs_core::model::{Dimension, Layer, Mass, Unit, species_aliases};
use particlegs_core::{Error, Hint, Result, parallel};
use particlegs_files::output::PlacedFile;
use particlegs_particles::{Number, Run, SelectedParticles, SnapshotMeta, SourceField};
use std::ops::Range;
use std::path::Path;

/// Types in the order in which layers without a number get them: dark matter first, gas last.
const ORDER: [usize; 6] = [1, 2, 3, 4, 5, 0];

/// Writes what is kept as a snapshot; tells its bytes. The file appears whole or not at all.
pub fn write(particles: &SelectedParticles<'_>, out: &Path, context: &Context<'_>) -> Result<u64> {
    let layers = particles.layers();
    let types = types(&layers, out)?;
    let fields = fields(particles);
    let plan = encode::plan(&groups(particles, &layers, &types, &fields, out)?);
    let file = PlacedFile::create(out, plan.length)?;
    file.write_at(&plan.metadata, 0)?;
    context.begin("writing", particles.total());
    let scratch = parallel::Scratch::<Vec<u8>>::default();
    particles.for_each_run(context, &|id, run| {
        let index = particles.layer_of(id);
        let count = run.columns[0].len() as u64;
        // A run that keeps nothing may belong to a layer that keeps nothing, which has no group.
        if let Some(layer) = layers.get(index).filter(|_| count > 0) {
            let row = particles.first(id) - layer.content.start;
            let fields = fields.get(index).map_or(&[][..], |f| f);
            let sets = LayerDataSets { file: &file, mass: layer.mass, fields, data: &plan.data[FIRST + index] };
            scratch.with(|bytes| sets.write_run(row, (run, particles), bytes))?;
        }
        context.advance(count);
        Ok(())
    })?;
    context.end();
    file.finish()?;
    Ok(plan.length)
}

/// Groups before the first layer's.
const FIRST: usize = 2;

struct LayerDataSets<'a> {
    file: &'a PlacedFile,
    mass: Mass,
    fields: &'a [OutField],
    /// First bytes of the data sets: positions, masses where they are weights, fields.
    data: &'a [u64],
}

impl LayerDataSets<'_> {
    fn write_run(&self, row: u64, (run, particles): (&Run, &SelectedParticles<'_>), bytes: &mut Vec<u8>) -> Result<()> {
        let [x, y, z, w] = &run.columns;
        bytes.clear();
        match particles.is_wide() {
            true => bytes.extend((0..x.len()).flat_map(|i| run.wide(particles.origin(), i)).flat_map(f64::to_le_bytes)),
            false => bytes.extend((0..x.len()).flat_map(|i| [x[i], y[i], z[i]]).flat_map(f32::to_le_bytes)),
        }
        let mut places = self.data.iter();
        let mut put = |bytes: &[u8], width: u64| match places.next() {
            Some(place) => self.file.write_at(bytes, place + width * row),
            None => Ok(()),
        };
        put(bytes, if particles.is_wide() { 24 } else { 12 })?;
        if has_weights(self.mass, self.fields) {
            let unit = self.mass.unit_or_one();
            bytes.clear();
            bytes.extend(w.iter().flat_map(|&w| ((f64::from(w) * unit) as f32).to_le_bytes()));
            put(bytes, 4)?;
        }
        for field in self.fields {
            bytes.clear();
            field.append(run, bytes);
            put(bytes, field.number.bytes() * field.columns.len() as u64)?;
        }
        Ok(())
    }
}

/// Whether masses are written from weights: not where they are a field, which keeps its own type.
fn has_weights(mass: Mass, fields: &[OutField]) -> bool {
    mass.is_weighted() && !fields.iter().any(|f| f.name == MASSES)
}

const MASSES: &str = "Masses";
const IDS: &str = "ParticleIDs";

/// Gadget's names of fields, and those of others.
const STANDARD: [StandardField; 9] = [
    (IDS, 1, &["ID", "id", "ids", "ParticleID", "particle_id", "pid"]),
    (VELOCITIES, 3, &["VEL", "Velocity", "velocities", "velocity", "velo", "vel", "v"]),
    (MASSES, 1, &["Mass", "MASS", "masses", "mass"]),
    (ENERGY, 1, &["InternalEnergies", "U", "u"]),
    ("Density", 1, &["RHO", "rho", "density"]),
    ("SmoothingLength", 1, &["HSML", "hsml"]),
    ("Potential", 1, &["POT", "potential"]),
    ("Acceleration", 3, &["ACCE", "acceleration"]),
    ("TimeStep", 1, &["TSTP"]),
];

pub fn fields(particles: &SelectedParticles<'_>) -> Vec<Vec<OutField>> {
    let named = |field: &OutField| {
        // A slash parts groups in HDF5, and the length of a link's name has one byte here.
        !field.name.is_empty() && field.name.len() <= 200 && !field.name.contains('/') && field.name != "."
    };
    let meta = particles.meta();
    let outputs_of = |fields: &&[SourceField]| {
        let mut all = outputs(fields, &STANDARD, &["Coordinates"]);
        all.retain(named);
        all.retain_mut(|field| match field.name == VELOCITIES || field.name == ENERGY {
            true => make_gadgets(field, meta),
            false => true,
        });
        all
    };
    particles.fields().iter().map(outputs_of).collect()
}

const VELOCITIES: &str = "Velocities";
const ENERGY: &str = "InternalEnergy";

/// Whether the file is that of a cosmological run. Its lengths may be physical: then their unit says so.
fn is_cosmological(meta: &SnapshotMeta) -> bool {
    meta.epoch.scale_factor.is_some() && (meta.units.comoving != Some(false) || meta.units.length.is_some())
}

/// Velocities and energies as Gadget has them: in km/s, over sqrt(a) in cosmological runs, and in (km/s)^2. False where
/// they would be read as other ones: it is not known what they are, and a counts.
fn make_gadgets(field: &mut OutField, meta: &SnapshotMeta) -> bool {
    let is_velocity = field.name == VELOCITIES;
    let a = meta.epoch.scale_factor.filter(|_| is_cosmological(meta)).unwrap_or(1.0);
    let (source, dimension) = if is_velocity { ("velocity", 3) } else { (ENERGY, 1) };
    let of_unit = || physical((source, dimension), field.unit.as_deref(), &[], &VelocityConvention::default(), meta);
    let factor = field.physical.or_else(|| of_unit().map(|p| p.factor));
    let Some(factor) = factor.filter(|_| !matches!(field.number, Number::I64 | Number::U64)) else {
        return !is_velocity || a == 1.0;
    };
    let (power, cgs) = match (is_velocity, is_cosmological(meta)) {
        (true, true) => (0.5, 1e5),
        (true, false) => (0.0, 1e5),
        (false, _) => (0.0, 1e10),
    };
    let factor = factor / a.powf(power);
    // What is Gadget's already keeps its bits.
    if (factor - 1.0).abs() > 1e-9 {
        field.factor = factor;
        field.number = if field.number == Number::F32 { Number::F32 } else { Number::F64 };
    }
    let said = [("a_scaling", power), ("h_scaling", 0.0), ("to_cgs", cgs)];
    (field.unit, field.attributes) = (None, said.map(|(name, v)| (name.to_string(), v)).into());
    true
}

/// The type of each layer: `PartTypeN` keeps its number, as do gas, dm and others of those names; the rest get free ones in
/// order.
fn types(layers: &[Layer<Range<u64>>], out: &Path) -> Result<Vec<usize>> {
    let type_of = |l: &Layer<Range<u64>>| {
        let name = l.name.to_lowercase();
        let number = |t: &usize| name.strip_prefix("parttype") == Some(&t.to_string());
        ORDER.into_iter().find(|t| number(t) || species_aliases(*t)[1..].contains(&name))
    };
    let mut types: Vec<Option<usize>> = layers.iter().map(type_of).collect();
    for i in 0..types.len() {
        // Of two layers by the same number the first keeps it.
        if types[i].is_none() || types[..i].contains(&types[i]) {
            types[i] = ORDER.into_iter().find(|t| !types.contains(&Some(*t)));
        }
    }
    types.into_iter().collect::<Option<_>>().ok_or_else(|| {
        let message =
            format!("{} layers, but a Gadget snapshot has at most {} particle types", layers.len(), ORDER.len());
        Error::input_with(out, message, Hint::choose_species())
    })
}

fn groups(
    particles: &SelectedParticles<'_>,
    layers: &[Layer<Range<u64>>],
    types: &[usize],
    fields: &[Vec<OutField>],
    out: &Path,
) -> Result<Vec<OutGroup>> {
    let meta = particles.meta();
    let (length, mass) = (&meta.units.length, &meta.units.mass);
    let group = |name: &str, attributes| OutGroup { name: name.into(), attributes, sets: Vec::new() };
    let mut groups =
        vec![group("Header", header(meta, layers, types, out)?), group("Parameters", parameters(meta, fields))];
    for (index, (layer, kind)) in layers.iter().zip(types).enumerate() {
        let layer_fields = fields.get(index).map_or(&[][..], |f| f);
        let rows = layer.content.end - layer.content.start;
        let comoving = meta.units.comoving.map(|c| if c { 1.0 } else { 0.0 });
        let set = |name: &str, number, columns, attributes| {
            let (name, source) = (name.into(), Vec::new());
            OutDataSet { name, number, rows, columns, attributes, source, hollow: false }
        };
        let number = if particles.is_wide() { Number::F64 } else { Number::F32 };
        let mut sets = vec![set("Coordinates", number, 3, scaling(length, comoving, Dimension::Length))];
        if has_weights(layer.mass, layer_fields) {
            sets.push(set(MASSES, Number::F32, 1, scaling(mass, Some(0.0), Dimension::Mass)));
        }
        for field in layer_fields {
            let attributes = match (&field.unit, field.name == MASSES) {
                (_, true) => scaling(mass, Some(0.0), Dimension::Mass),
                (Some(unit), _) => vec![("unit", OutValue::Text(unit.chars().take(200).collect()))],
                (None, _) => Vec::new(),
            };
            let is_new = |(name, _): &&(String, f64)| attributes.iter().all(|(n, _)| n != name);
            let source = field.attributes.iter().filter(is_new).cloned().collect();
            let columns = field.columns.len() as u64;
            sets.push(OutDataSet { source, ..set(&field.name, field.number, columns, attributes) });
        }
        if layer_fields.iter().all(|f| f.name != IDS) {
            // pynbody counts particles by their IDs. There are none here, and none are made up.
            let why = OutValue::Text("not known: nothing is stored, and 0 is read".into());
            sets.push(OutDataSet { hollow: true, ..set(IDS, Number::U64, 1, vec![("Description", why)]) });
        }
        let name = OutValue::Text(layer.name.chars().take(200).collect());
        groups.push(OutGroup { name: format!("PartType{kind}"), attributes: vec![("Layer", name)], sets });
    }
    Ok(groups)
}

fn header(meta: &SnapshotMeta, layers: &[Layer<Range<u64>>], types: &[usize], out: &Path) -> Result<Vec<Attribute>> {
    let mut counts = vec![0; ORDER.len()];
    let mut masses = vec![0.0; ORDER.len()];
    for (layer, &kind) in layers.iter().zip(types) {
        counts[kind] = layer.content.end - layer.content.start;
        masses[kind] = match layer.mass {
            Mass::Each(mass) => mass,
            _ => 0.0,
        };
    }
    let mut header = vec![
        ("NumPart_ThisFile", OutValue::Counts(counts.clone())),
        ("NumPart_Total", OutValue::Counts(counts)),
        // Totals are whole already, as Gadget-4's.
        ("NumPart_Total_HighWord", OutValue::Words(vec![0; ORDER.len()])),
        ("MassTable", OutValue::Numbers(masses)),
        ("NumFilesPerSnapshot", OutValue::Integer(1)),
    ];
    let cell = meta.cell.map(|c| c.reduced());
    let lengths = match &cell {
        None => [0.0; 3],
        Some(cell) => cell.lengths().ok_or_else(|| {
            let message = "a Gadget snapshot cannot store a cell that is not orthogonal";
            Error::input_with(out, message, "write a folder of columns instead")
        })?,
    };
    header.push(box_size(lengths));
    let moved = cell.filter(|c| c.origin != [0.0; 3]);
    header.extend(moved.map(|c| ("BoxOrigin", OutValue::Numbers(c.origin.to_vec()))));
    let open = cell.filter(|c| c.periodic != [true; 3]);
    header.extend(open.map(|c| ("BoxPeriodic", OutValue::Words(c.periodic.map(u32::from).to_vec()))));
    let factor = meta.epoch.scale_factor.filter(|a| *a > 0.0);
    header.extend(meta.epoch.time.or(factor).map(|time| ("Time", OutValue::Number(time))));
    if let Some(a) = factor {
        header.push(("Redshift", OutValue::Number(1.0 / a - 1.0)));
        // Without it Time is the scale factor.
        header.extend(meta.epoch.time.map(|_| ("Scale-factor", OutValue::Number(a))));
    }
    header.extend(meta.cosmology.hubble.map(|h| ("HubbleParam", OutValue::Number(h))));
    header.extend(omegas(meta));
    Ok(header)
}

fn box_size(lengths: [f64; 3]) -> Attribute {
    let cube = lengths[1] == lengths[0] && lengths[2] == lengths[0];
    ("BoxSize", if cube { OutValue::Number(lengths[0]) } else { OutValue::Numbers(lengths.to_vec()) })
}

/// The header's of Gadget-2 and the parameters' of Gadget-4.
fn omegas(meta: &SnapshotMeta) -> impl Iterator<Item = Attribute> + use<> {
    let c = meta.cosmology;
    let all = [("Omega0", c.omega_matter), ("OmegaLambda", c.omega_lambda), ("OmegaBaryon", c.omega_baryon)];
    all.into_iter().filter_map(|(name, value)| Some((name, OutValue::Number(value?))))
}

fn parameters(meta: &SnapshotMeta, fields: &[Vec<OutField>]) -> Vec<Attribute> {
    let (length, mass) = (cgs(&meta.units.length, Dimension::Length), cgs(&meta.units.mass, Dimension::Mass));
    let named = [("UnitLength_in_cm", length), ("UnitMass_in_g", mass), ("HubbleParam", meta.cosmology.hubble)];
    // Readers take a file's units only where there are three.
    let velocities = || fields.iter().flatten().filter(|f| f.name == VELOCITIES);
    let is_known = |f: &OutField| f.attributes.iter().any(|(name, _)| name == "to_cgs");
    let velocity = length.and(mass).filter(|_| velocities().all(is_known)).map(|_| 1e5);
    let named = named.into_iter().chain([("UnitVelocity_in_cm_per_s", velocity)]);
    let mut parameters: Vec<Attribute> = named.filter_map(|(n, v)| Some((n, OutValue::Number(v?)))).collect();
    parameters.extend(omegas(meta));
    parameters.extend(meta.cell.and_then(|c| c.reduced().lengths()).map(box_size));
    // A time that is no scale factor is told from one.
    let is_still = meta.epoch.scale_factor.is_none() && velocities().any(is_known);
    let comoving = match meta.units.comoving {
        Some(comoving) => Some(i32::from(comoving || is_cosmological(meta))),
        None => is_still.then_some(0),
    };
    parameters.extend(comoving.map(|on| ("ComovingIntegrationOn", OutValue::Integer(on))));
    parameters
}

fn cgs(unit: &Option<Unit>, dimension: Dimension) -> Option<f64> {
    Some(unit.as_ref()?.si?.factor * units::per_si(dimension))
}

/// A data set's unit: Gadget-4's powers and factor, or the text where it has none.
fn scaling(unit: &Option<Unit>, a: Option<f64>, dimension: Dimension) -> Vec<Attribute> {
    let Some(u) = unit else { return Vec::new() };
    let (Some(si), Some(cgs)) = (u.si, cgs(unit, dimension)) else {
        return vec![("unit", OutValue::Text(u.text.clone()))];
    };
    let is = |d| OutValue::Number(if d == dimension { 1.0 } else { 0.0 });
    let mut all = vec![
        ("h_scaling", OutValue::Number(si.h.into())),
        ("length_scaling", is(Dimension::Length)),
        ("mass_scaling", is(Dimension::Mass)),
        ("velocity_scaling", OutValue::Number(0.0)),
        ("to_cgs", OutValue::Number(cgs)),
    ];
    all.extend(a.map(|a| ("a_scaling", OutValue::Number(a))));
    all
}
