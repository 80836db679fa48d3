//! From a model to files of particles, run by run.

use super::draw::{DrawRules, DrawScratch};
use super::notes::notes;
use super::options::Options;
use super::plan::{RecoveryPlan, meta_of, moved, origin_of};
use particlegs_core::context::Context;
use particlegs_core::math::float32_holds;
use particlegs_core::model::{Block, FieldMoments, Layer, Model, Quantity, QuantityKind};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::input::{Begins, Form, read_own};
use particlegs_files::memory::require;
use particlegs_particles::{Number, RUN, RawForm, Run, SnapshotDescription, SnapshotLayout, SnapshotWriter};
use std::path::Path;

impl Options {
    /// Notes on particles drawn from `model` by these options: the keys that meta.json has beside box and units.
    pub fn notes(&self, model: &Model, model_hash: [u8; 32]) -> serde_json::Value {
        notes(&model.metadata, model.certificate.as_ref(), model_hash, self, self.total(model)).into()
    }

    /// Whether the particles that [`recover`] would draw from `model` by these options are in the folder `out`, as far
    /// as its meta.json and the length of its files say.
    pub fn is_there(&self, out: &Path, model: &Model, model_hash: [u8; 32]) -> Result<bool> {
        let total = self.total(model);
        let origin = origin_of(&model.metadata);
        let is_far = origin != [0.0; 3];
        let length = |name: &str| out.join(name).metadata().map_or(0, |m| m.len());
        let fields = field_files(model);
        let whole = match self.form {
            RawForm::Columns => {
                let positions = ["xx.f32", "yy.f32", "zz.f32"].into_iter().map(|name| (name, 4));
                let field_columns = fields.iter().map(|(name, number)| (&name[..], number.bytes()));
                positions.chain(field_columns).all(|(name, bytes)| length(name) == bytes * total)
            }
            RawForm::NpyFolder if is_far => length("positions.npy") == 24 * total + NPY_HEADER,
            RawForm::NpyFolder => length("positions.npy") == 12 * total + NPY_HEADER,
            RawForm::Npy => false,
        };
        let text = match read_own(&out.join("meta.json"), META) {
            Ok(Some(text)) if whole => text,
            Err(e @ Error::Io { .. }) => return Err(e),
            _ => return Ok(false),
        };
        let stored_notes: serde_json::Value = serde_json::from_slice(&text).unwrap_or_default();
        let mut expected_notes = notes(&model.metadata, model.certificate.as_ref(), model_hash, self, total);
        if is_far && self.form == RawForm::Columns {
            expected_notes.insert("origin".into(), serde_json::json!(origin));
        }
        Ok(expected_notes.iter().all(|(key, value)| stored_notes.get(key) == Some(value)))
    }
}

/// The files that the columns of a model's fields get in a folder, `velocity_x.f32`, `luminosity.f64`, and the type of
/// their numbers. A field that a layer with particles lacks has none.
fn field_files(model: &Model) -> Vec<(String, Number)> {
    let files = |q: &Quantity| {
        let number = number_of(model, q);
        let ending = if number == Number::F64 { "f64" } else { "f32" };
        column_names(q).map(|name| (format!("{name}.{ending}"), number)).collect::<Vec<_>>()
    };
    common_fields(model).iter().flat_map(files).collect()
}

/// The type that holds a field's drawn values: float64 where float32 does not.
pub(super) fn number_of(model: &Model, q: &Quantity) -> Number {
    let of_blocks = |m: &FieldMoments| (0..m.components()).all(|k| float32_holds(m.value_range(k)));
    let moments = model.blocks().filter_map(|b| b.gaussians.fields.get(&q.name));
    let classes = model.metadata.fields.iter().filter_map(Quantity::class).filter(|(category, _)| *category == q.name);
    let is_held = |class: &str| class.parse::<f64>().is_ok_and(|v| f64::from(v as f32) == v);
    let held = moments.into_iter().all(of_blocks) && classes.into_iter().all(|(_, class)| is_held(class));
    if held { Number::F32 } else { Number::F64 }
}

/// The names of a field's columns in a folder.
fn column_names(q: &Quantity) -> impl Iterator<Item = String> {
    q.component_names().into_iter().map(|name| file_name(&name))
}

/// The columns of fields in a folder that [`recover`] wrote, which another run may replace; none in any other folder.
pub fn drawn_fields(folder: &Path) -> Vec<String> {
    let notes = read_own(&folder.join("meta.json"), META).ok().flatten();
    let notes: serde_json::Value = notes.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
    let entries = std::fs::read_dir(folder).ok().filter(|_| notes.get("synthetic").is_some());
    let names = entries.into_iter().flatten().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|name| name.ends_with(".f32") || name.ends_with(".f64")).collect()
}

/// The fields that every layer has, with a scalar in the place of the classes of a category.
pub(super) fn common_fields(model: &Model) -> Vec<Quantity> {
    drawn(model, |q| model.layers.iter().all(|l| has(l, q)))
}

/// The fields that any layer has, in the same form.
pub(super) fn fields_of_layers(model: &Model) -> Vec<Quantity> {
    drawn(model, |q| model.layers.iter().any(|l| has(l, q)))
}

fn has(layer: &Layer<Vec<Block>>, q: &Quantity) -> bool {
    layer.content.iter().all(|b| b.gaussians.is_empty() || b.gaussians.fields.get(&q.name).is_some())
}

fn drawn(model: &Model, wanted: impl Fn(&Quantity) -> bool) -> Vec<Quantity> {
    let mut quantities: Vec<Quantity> = Vec::new();
    for q in model.metadata.fields.iter().filter(|q| wanted(q)) {
        match q.class() {
            None => quantities.push(q.clone()),
            Some((category, _)) if quantities.last().is_some_and(|d| d.name == category) => {}
            Some((category, _)) => quantities.push(Quantity::new(category, QuantityKind::Scalar)),
        }
    }
    quantities
}

/// A name with what some file systems refuse replaced.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// Draws particles from `model` (whose file has the BLAKE3 `model_hash`) and writes them to `out`
/// with a meta.json that says what they are. Memory stays at the model and a few runs a thread,
/// whatever the number of particles; the same model, options and seed give the same bytes for any
/// number of threads.
pub fn recover(
    model: Model,
    model_hash: [u8; 32],
    options: &Options,
    out: &Path,
    context: &Context<'_>,
) -> Result<u64> {
    options.check()?;
    require("drawing", (parallel::threads() * RUN * BYTES_A_DRAW + model.gaussians() * 8) as u64)?;
    let fields = if options.form == RawForm::Columns { field_files(&model) } else { Vec::new() };
    let common = common_fields(&model);
    let unit_of = |q: &Quantity| q.unit.as_ref().map(|u| u.text.clone());
    let of_columns = |q| Some((unit_of(q)?, column_names(q)));
    let units = common.iter().filter_map(of_columns);
    let field_units = units.flat_map(|(unit, names)| names.map(move |name| (name, unit.clone()))).collect();
    let (metadata, certificate) = (model.metadata.clone(), model.certificate);
    let origin = origin_of(&metadata);
    // Drawn about an origin near them, as float32 may not hold the places themselves.
    let model = moved(model, origin);
    let local = model.metadata.clone();
    let mut plan = RecoveryPlan::new(model, options.particles, options.method)?;
    // Triples have no columns of fields.
    plan.keep_fields(if options.form == RawForm::Columns { &common } else { &[] });
    let weighted = plan.weighted();
    let rules = DrawRules::new(options.method, options.scale, options.seed, &local, &plan, context.simd());
    let (form, count, wide) = (options.form, plan.total, origin != [0.0; 3]);
    let layout = SnapshotLayout { form, count, weighted, origin, wide, fields: &fields };
    let writer = SnapshotWriter::create(out, &layout)?;
    let bytes = writer.particle_bytes(weighted) * plan.total;
    context.begin("drawing particles", plan.total);
    let scratch_pool = parallel::Scratch::<(DrawScratch, Run, Vec<_>)>::default();
    parallel::try_for_each(0..plan.runs(), |id| {
        context.check()?;
        let (layer, number, range) = plan.run(id);
        let (first, count) = (layer.first + range.start, range.end - range.start);
        scratch_pool.with(|(scratch, run, triples)| {
            rules.fill(layer, number, range, scratch, run)?;
            // Each run has its place in the files, in whatever order threads come to it.
            writer.write(first, run, triples)
        })?;
        context.advance(count);
        Ok::<_, Error>(())
    })?;
    let layers = plan.described();
    let mut meta = meta_of(&metadata, &layers);
    if options.form == RawForm::Columns {
        meta.field_units = field_units;
    }
    writer.finish(&SnapshotDescription {
        meta: &meta,
        origin,
        layers,
        order: "layer by layer, Gaussian by Gaussian",
        notes: notes(&metadata, certificate.as_ref(), model_hash, options, plan.total),
    })?;
    context.end();
    Ok(bytes)
}

/// Bytes before the triples of a positions.npy.
const NPY_HEADER: u64 = 128;
/// The file beside recovered particles.
const META: Form =
    Form { title: "the notes of recovered particles", begins: Begins::Object, most: 16 << 20, expansion: 24 };

/// Bytes of a particle in a thread's scratch space: numbers and positions in f64, columns and
/// triples in f32.
const BYTES_A_DRAW: usize = 8 * 7 + 4 * 7;

#[cfg(test)]
mod tests {
    use super::super::options::Method;
    use super::super::plan::tests::{model, options};
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::each_axis;
    use particlegs_core::model::Mass;
    use particlegs_particles::Particles;

    fn drawn(model: Model, options: &Options) -> Result<Particles> {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let number = options.total(&model);
        let outcome = recover(model, [0; 32], options, &out, &Context::SILENT);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), usize::from(outcome.is_ok()));
        let bytes = outcome?;
        let files = ["xx.f32", "yy.f32", "zz.f32", "ww.f32"].map(|n| out.join(n)).into_iter().filter(|p| p.exists());
        let files: Vec<_> = files.collect();
        let p = Particles::open_raw(&files)?;
        let written: u64 = files.iter().map(|f| f.metadata().unwrap().len()).sum();
        assert_eq!((p.len() as u64, written), (number, bytes));
        Ok(p)
    }

    #[test]
    fn every_method_has_the_mean_and_the_spread_of_the_gaussian() {
        let lone = || model(&[("particles", &[(0, None), (0, None), (0, None), (0, None), (20_000, None)])]);
        for (method, spread) in [
            (Method::Count, 1.0),
            (Method::Volume, 1.0),
            (Method::Stratified, 1.0),
            // A ball of 3 standard deviations: 9 / 5.
            (Method::Ellipsoid, 1.8),
        ] {
            let p = drawn(lone(), &options(method)).unwrap();
            let (mean, cov) = moments(&p);
            assert!((mean[0] - 4.5).abs() < 0.01 && (mean[1] - 5.0).abs() < 0.01, "{method:?} {mean:?}");
            for (got, want) in cov.iter().zip([0.04, 0.01, 0.0, 0.02, -0.005, 0.01]) {
                assert!((got - spread * want).abs() < 0.04 * 0.04 * spread, "{method:?} {cov:?}");
            }
        }
        let wide = drawn(lone(), &Options { scale: 2.0, ..options(Method::Count) }).unwrap();
        assert!((moments(&wide).1[0] - 0.16).abs() < 0.007);
        // The grid's cell that holds the centre.
        let p = drawn(lone(), &options(Method::Grid)).unwrap();
        assert!((0..p.len()).all(|i| (p.position(i)[0] - 4.5).abs() < 10.0 / 512.0));
    }

    fn moments(p: &Particles) -> ([f64; 3], [f64; 6]) {
        let n = p.len() as f64;
        let mut mean = [0.0; 3];
        (0..p.len()).for_each(|i| (0..3).for_each(|k| mean[k] += p.position(i)[k] / n));
        let mut cov = [0.0; 6];
        for i in 0..p.len() {
            let d: [f64; 3] = each_axis(|k| p.position(i)[k] - mean[k]);
            let products = [d[0] * d[0], d[0] * d[1], d[0] * d[2], d[1] * d[1], d[1] * d[2], d[2] * d[2]];
            (0..6).for_each(|k| cov[k] += products[k] / n);
        }
        (mean, cov)
    }

    #[test]
    fn layers_and_masses_come_back() {
        let two = || model(&[("dm", &[(100_000, None), (7, None)]), ("gas", &[(300, Some(30.0)), (50, Some(1.0))])]);
        let p = drawn(two(), &options(Method::Count)).unwrap();
        let layers = p.layers();
        assert_eq!(
            (&layers[0].name[..], layers[0].content.clone(), layers[0].mass),
            ("dm", 0..100_007, Mass::Each(2.0))
        );
        assert_eq!(
            (&layers[1].name[..], layers[1].content.clone(), layers[1].mass.is_weighted()),
            ("gas", 100_007..100_357, true)
        );
        let weights = p.weights().unwrap();
        assert!(weights[100_007..100_307].iter().all(|&w| w == 0.1) && weights[100_307..].iter().all(|&w| w == 0.02));
        // Beside weights, a layer's particles weigh their mass.
        assert_eq!(weights[0], 2.0);
        // A layer alone has the same particles.
        let alone = drawn(two().only(&["gas".into()]).unwrap(), &options(Method::Count)).unwrap();
        assert!((0..350).all(|i| alone.position(i) == p.position(100_007 + i)));
        let npy = Options { form: RawForm::NpyFolder, ..options(Method::Count) };
        assert!(drawn(two(), &npy).is_err());
    }

    #[test]
    fn far_from_zero_particles_keep_their_places() {
        let at = [98_765.4, 12_345.7, 200_000.25];
        let mut far = moved(model(&[("particles", &[(20_000, None)])]), at.map(|v: f64| -v));
        far.metadata.cell = None;
        far.metadata.default_radius = 1e-3;
        far.layers[0].content[0].gaussians.cov.iter_mut().for_each(|c| c[0] *= 1e-4);
        let spread = |p: &Particles| moments(p).1[0].sqrt();
        let expected = spread(&options(Method::Count).draw(far.clone(), &Context::SILENT).unwrap());
        let p = drawn(far.clone(), &options(Method::Count)).unwrap();
        assert!(p.origin != [0.0; 3] && (spread(&p) / 0.002 - 1.0).abs() < 0.05, "{:?} {}", p.origin, spread(&p));
        assert_eq!(spread(&p), expected);
        // One file of triples has no place for an origin: it has float64.
        let dir = tempfile::tempdir().unwrap();
        let npy = Options { form: RawForm::NpyFolder, ..options(Method::Count) };
        assert_eq!(
            recover(far.clone(), [0; 32], &npy, &dir.path().join("out"), &Context::SILENT).unwrap(),
            24 * 20_000
        );
        let bytes = std::fs::read(dir.path().join("out/positions.npy")).unwrap();
        let first = f64::from_le_bytes(bytes[NPY_HEADER as usize..][..8].try_into().unwrap());
        assert_eq!(first, p.position(0)[0]);
        assert!(npy.is_there(&dir.path().join("out"), &far, [0; 32]).unwrap());
    }

    #[test]
    fn particles_beyond_float32_are_refused() {
        let mut far = model(&[("particles", &[(10, None)])]);
        far.metadata.cell = None;
        far.layers[0].content[0].gaussians.mean[0][0] = 1e39;
        assert!(drawn(far, &options(Method::Count)).is_err());
    }
}
