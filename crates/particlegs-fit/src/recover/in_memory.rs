//! Particles drawn into memory, to be measured.

use super::draw::{DrawRules, DrawScratch};
use super::job::{common_fields, fields_of_layers, number_of};
use super::options::{Method, Options};
use super::plan::{LayerPlan, RecoveryPlan, belongs, meta_of, moved, origin_of};
use particlegs_core::context::Context;
use particlegs_core::model::{Mass, Model, Quantity, QuantityKind};
use particlegs_core::{Result, parallel};
use particlegs_files::memory::require;
use particlegs_particles::{Column, LayerFields, Number, Particles, Run, SnapshotMeta, SourceField};

/// Runs drawn at once: bounds what is held beside the particles.
const BATCH: u64 = 32;

impl Options {
    /// The particles that [`super::recover`] writes by these options, in memory: in the model's layers, with the
    /// weights that these have.
    pub fn draw(&self, mut model: Model, context: &Context<'_>) -> Result<Particles> {
        model.drop_fields();
        Ok(self.draw_with_fields(model, context)?.0)
    }

    /// The same, and the fields of each layer of the particles: those that every layer of the model has.
    pub fn draw_with_fields(&self, model: Model, context: &Context<'_>) -> Result<(Particles, Vec<LayerFields>)> {
        let common = common_fields(&model);
        self.draw_fields(model, common, context)
    }

    /// The same, with all fields that a layer of the model has.
    pub fn draw_with_own_fields(&self, model: Model, context: &Context<'_>) -> Result<(Particles, Vec<LayerFields>)> {
        let all = fields_of_layers(&model);
        self.draw_fields(model, all, context)
    }

    fn draw_fields(
        &self,
        model: Model,
        mut drawn: Vec<Quantity>,
        context: &Context<'_>,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        self.check()?;
        // Vectors first, as readers give them.
        drawn.sort_by_key(|q| q.kind != QuantityKind::Vector);
        let names: Vec<String> = drawn.iter().map(|q| q.name.clone()).collect();
        let components: usize = drawn.iter().map(|q| q.component_names().len()).sum();
        let numbers: Vec<Number> = drawn.iter().map(|q| number_of(&model, q)).collect();
        let metadata = model.metadata.clone();
        let origin = origin_of(&metadata);
        let model = moved(model, origin);
        let local = model.metadata.clone();
        let mut plan = RecoveryPlan::new(model, self.particles, self.method)?;
        plan.keep_fields(&drawn);
        require("drawn particles", plan.total.saturating_mul(16 + 8 * components as u64))?;
        let rules = DrawRules::new(self.method, self.scale, self.seed, &local, &plan, context.simd());
        let (columns, values) = columns(&plan, &rules, plan.weighted(), &|_| 1.0, context)?;
        let layers = plan.described();
        let mut meta = meta_of(&metadata, &layers);
        meta.fields = names;
        let layers: Vec<_> = layers.into_iter().map(|l| l.map(|r| r.start as usize..r.end as usize)).collect();
        let of_layer = |(layer, layer_columns): (&LayerPlan, Vec<Vec<f64>>)| {
            let has = |q: &&Quantity| layer.layer.content.fields.iter().any(|(name, _)| belongs(name, &q.name));
            let fields = drawn.iter().zip(&numbers).filter(|(q, _)| has(q)).map(|(q, n)| source_field(q, *n));
            LayerFields::from_columns(fields.collect(), layer_columns)
        };
        let fields = plan.layers.iter().zip(values).map(of_layer).collect();
        Ok((Particles::from_column_list(columns, origin, meta, layers).with_layer_masses()?, fields))
    }
}

fn source_field(q: &Quantity, number: Number) -> SourceField {
    let components = q.component_names().len() as u32;
    let unit = q.unit.as_ref().map(|u| u.text.clone());
    SourceField { name: q.name.clone(), number, components, unit, attributes: Vec::new(), physical: None }
}

/// As many particles as `model` stands for, by [`Method::Count`]: those that [`super::recover`]
/// writes with this seed, as f32 relative to `origin`. Each has its mass as weight where `weighted`
/// is set, else none.
pub fn draw(model: &Model, seed: u64, origin: [f64; 3], weighted: bool, context: &Context<'_>) -> Result<Particles> {
    require("drawn particles", model.metadata.count.saturating_mul(16))?;
    let mut moved = moved(model.clone(), origin);
    moved.drop_fields();
    let (metadata, plan) = (moved.metadata.clone(), RecoveryPlan::new(moved, None, Method::Count)?);
    let mut rules = DrawRules::new(Method::Count, 1.0, seed, &metadata, &plan, context.simd());
    rules.weighted = weighted;
    let (columns, _) = columns(&plan, &rules, weighted, &|mass| mass.unit_or_one(), context)?;
    let meta = SnapshotMeta { cell: model.metadata.cell, ..SnapshotMeta::default() };
    Ok(Particles::from_column_list(columns, origin, meta, Vec::new()))
}

/// Columns x, y, z and perhaps weights, these times what their layer's masses give; and those of each layer's fields.
fn columns(
    plan: &RecoveryPlan,
    rules: &DrawRules,
    weighted: bool,
    unit: &(dyn Fn(Mass) -> f64 + Sync),
    context: &Context<'_>,
) -> Result<(Vec<Column>, Vec<Vec<Vec<f64>>>)> {
    let width = if weighted { 4 } else { 3 };
    let mut columns: Vec<_> = (0..width).map(|_| Vec::with_capacity(plan.total as usize)).collect();
    context.begin("drawing particles", plan.total);
    let mut values: Vec<Vec<Vec<f64>>> = Vec::new();
    let scratch_pool = parallel::Scratch::<DrawScratch>::default();
    for first in (0..plan.runs()).step_by(BATCH as usize) {
        let runs = parallel::try_map(first..plan.runs().min(first + BATCH), |id| {
            context.check()?;
            let (layer, number, range) = plan.run(id);
            let mut run = Run::default();
            scratch_pool.with(|scratch| rules.fill(layer, number, range, scratch, &mut run))?;
            let unit = unit(layer.layer.mass) as f32;
            run.columns[3].iter_mut().for_each(|w| *w *= unit);
            context.advance(run.columns[0].len() as u64);
            Ok((number, run.columns, run.fields))
        })?;
        for (number, run_columns, fields) in runs {
            columns.iter_mut().zip(&run_columns).for_each(|(all, part)| all.extend_from_slice(part));
            // Run 0 is the first of a layer and begins its columns.
            match values.last_mut().filter(|_| number > 0) {
                Some(layer) => layer.iter_mut().zip(&fields).for_each(|(all, part)| all.extend_from_slice(part)),
                None => values.push(fields),
            }
        }
    }
    context.end();
    Ok((columns.into_iter().map(Column::owned).collect(), values))
}

#[cfg(test)]
mod tests {
    use super::super::plan::tests::{model, options};
    use super::super::recover;
    use super::*;
    use particlegs_core::context::Context;

    #[test]
    fn drawn_particles_are_those_that_are_written() {
        let m = model(&[("dm", &[(100_000, None), (7, None)]), ("gas", &[(300, None)])]);
        let drawn = draw(&m, 5, [0.0; 3], false, &Context::SILENT).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let options = options(Method::Count);
        recover(m.clone(), [0; 32], &options, &out, &Context::SILENT).unwrap();
        let written = Particles::open_raw(&["xx.f32", "yy.f32", "zz.f32"].map(|n| out.join(n))).unwrap();
        assert_eq!(drawn.len(), 100_307);
        let whole = options.draw(m.clone(), &Context::SILENT).unwrap();
        assert!((0..drawn.len()).all(|i| whole.position(i) == written.position(i)));
        assert_eq!(
            whole.layers().iter().map(|l| l.content.clone()).collect::<Vec<_>>(),
            [0..100_007, 100_007..100_307]
        );
        assert!((0..drawn.len()).all(|i| drawn.position(i) == written.position(i)) && drawn.weights().is_none());
        // About an origin far away they are the same, but for rounding.
        let far = draw(&m, 5, [-1000.0, 0.0, 500.0], false, &Context::SILENT).unwrap();
        let off = |i: usize| (0..3).map(|k| (far.position(i)[k] - drawn.position(i)[k]).abs()).fold(0.0, f64::max);
        // Two points on both sides of the seam are the same place.
        assert!((0..drawn.len()).all(|i| off(i) < 1e-3 || off(i) > 9.99));
    }

    #[test]
    fn weights_are_masses() {
        let m = model(&[("dm", &[(100, None)]), ("gas", &[(50, Some(25.0))])]);
        let drawn = draw(&m, 5, [0.0; 3], true, &Context::SILENT).unwrap();
        let w = drawn.weights().unwrap();
        assert_eq!((w.len(), w[0], w[149]), (150, 2.0, 0.5));
    }
}
