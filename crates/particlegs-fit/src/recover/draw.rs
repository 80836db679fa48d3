//! A run of particles from its Gaussians.

use super::joint::correlated_normals;
use super::normals::Draws;
use super::options::Method;
use super::plan::{LayerPlan, RecoveryPlan};
use super::spaced::Cascade;
use super::stratified::stratify;
use super::two_phases::logarithms;
use super::wrap::PeriodicWrap;
use particlegs_core::context::Level;
use particlegs_core::math::{Purpose, Random, Sym3};
use particlegs_core::model::{FieldMoments, Metadata, Quantity};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};
use particlegs_particles::Run;
use std::ops::Range;

/// Cells of [`Method::Grid`] along each axis.
const GRID: f64 = 512.0;
/// Radius of [`Method::Ellipsoid`], in standard deviations.
const REACH: f64 = 3.0;

/// Settings that all runs are drawn by.
pub(super) struct DrawRules {
    pub method: Method,
    /// Factor on standard deviations.
    pub scale: f64,
    pub seed: u64,
    /// Bounds of the snapshot.
    pub bounds: Bounds,
    /// Particles drawn in a unit of volume of the snapshot, for [`Method::Spaced`].
    pub mean_density: f64,
    pub wrap: Option<PeriodicWrap>,
    /// Whether the output has a column of weights.
    pub weighted: bool,
    /// Names of fields that are sums, whose values are over weights.
    pub extensive: Vec<String>,
    /// The classes of each category: a field's name, and the value that its particles get.
    pub categories: Vec<Vec<(String, f64)>>,
    pub simd: Level,
}

#[derive(Default)]
pub(super) struct DrawScratch {
    draws: Draws,
    flat: Vec<f64>,
    radii: Vec<f64>,
    position: [Vec<f64>; 3],
    left: Vec<f64>,
}

/// Particles of a layer, one after the other.
struct ParticleRun<'a> {
    layer: &'a LayerPlan,
    stream: u64,
    /// The first one's place in the layer.
    first: u64,
}

/// A Gaussian ready to be drawn from.
struct SampledGaussian {
    mean: [f64; 3],
    /// Lower triangle of a root of the covariance: xx, yx, yy, zx, zy, zz.
    root: [f64; 6],
}

impl DrawRules {
    /// For the particles of a plan, those of the snapshot that `metadata` describes.
    pub(super) fn new(
        method: Method,
        scale: f64,
        seed: u64,
        metadata: &Metadata,
        plan: &RecoveryPlan,
        simd: Level,
    ) -> DrawRules {
        let volume: f64 = metadata.bounds.extent_nonzero().iter().product();
        DrawRules {
            method,
            scale,
            seed,
            bounds: metadata.bounds,
            mean_density: plan.total as f64 / volume,
            wrap: PeriodicWrap::new(metadata.cell.as_ref(), &metadata.bounds),
            weighted: plan.weighted(),
            categories: categories(&metadata.fields),
            extensive: metadata.fields.iter().filter(|q| q.extensive).map(|q| q.name.clone()).collect(),
            simd,
        }
    }

    /// Fills `run` with the particles `range` of a layer, its run number `number`.
    pub(super) fn fill(
        &self,
        layer: &LayerPlan,
        number: u64,
        range: Range<u64>,
        scratch: &mut DrawScratch,
        run: &mut Run,
    ) -> Result<()> {
        let n = (range.end - range.start) as usize;
        let particle_run = ParticleRun { layer, stream: self.stream(&layer.layer.name), first: range.start };
        let mut random = Random::from_purpose(Purpose::Recovery, particle_run.stream, number);
        scratch.position.iter_mut().for_each(|c| c.resize(n, 0.0));
        self.raw(n, &mut random, scratch);
        run.columns[3].clear();
        for (gaussian, part) in layer.parts(range.clone()) {
            self.place(&particle_run, gaussian, part.clone(), scratch);
            if self.weighted {
                let weight = layer.weights.get(gaussian).copied().unwrap_or(1.0);
                run.columns[3].resize(part.end, weight);
            }
        }
        run.fields.clear();
        // A field's numbers do not depend on which other fields there are, but for those that it correlates with.
        let random =
            |name: &str| Random::from_purpose(Purpose::RecoveredField, self.stream(name) ^ particle_run.stream, number);
        let joint = correlated_normals(
            (&layer.layer.content, &layer.phases),
            || layer.parts(range.clone()),
            |name| {
                let mut normals = vec![0.0; n];
                scratch.draws.normals(self.simd, &mut random(name), &mut normals);
                normals
            },
        );
        for (name, field) in layer.layer.content.fields.iter() {
            let category = self.categories.iter().find(|c| c.iter().any(|(class, _)| class == name));
            // The first of a category's classes draws the column for all of them.
            if category.is_some_and(|c| c[0].0 != name) {
                continue;
            }
            if let Some(category) = category {
                run.fields.push(self.draw_category(category, &particle_run, &mut random(name), scratch));
                continue;
            }
            self.draw_field((name, field, joint.get(name)), &particle_run, &mut random(name), scratch, &mut run.fields);
            // Values of sums are stored over weights: a particle gets its weight times as much.
            if !self.extensive.iter().any(|extensive_name| extensive_name == name) {
                continue;
            }
            let Some(column) = run.fields.last_mut() else { continue };
            for (gaussian, part) in layer.parts(range.clone()) {
                let weight = layer.weights.get(gaussian).map_or(1.0, |w| f64::from(*w));
                column[part].iter_mut().for_each(|v| *v *= weight);
            }
        }
        self.finish(layer, scratch, run)
    }

    /// The seed of a layer: its particles do not depend on which other layers are drawn.
    fn stream(&self, name: &str) -> u64 {
        let mut first = [0; 8];
        first.copy_from_slice(&blake3::hash(name.as_bytes()).as_bytes()[..8]);
        self.seed ^ u64::from_le_bytes(first)
    }

    /// Normal or uniform numbers, one column after the other.
    fn raw(&self, n: usize, random: &mut Random, scratch: &mut DrawScratch) {
        scratch.flat.resize(3 * n, 0.0);
        match self.method {
            Method::Count | Method::Volume => scratch.draws.normals(self.simd, random, &mut scratch.flat),
            Method::Ellipsoid => {
                scratch.draws.normals(self.simd, random, &mut scratch.flat);
                scratch.radii.resize(n, 0.0);
                scratch.draws.uniforms(self.simd, random, &mut scratch.radii);
            }
            Method::Grid | Method::Spaced => scratch.draws.uniforms(self.simd, random, &mut scratch.flat),
            Method::Stratified => {}
        }
    }

    /// Places the particles `range` of a run, which belong to one Gaussian.
    fn place(&self, particle_run: &ParticleRun<'_>, gaussian: usize, range: Range<usize>, scratch: &mut DrawScratch) {
        let &ParticleRun { layer, stream, first } = particle_run;
        let n = scratch.flat.len() / 3;
        let (x, rest) = scratch.flat.split_at_mut(n);
        let (y, z) = rest.split_at_mut(n);
        let mut raw = [&mut x[range.clone()], &mut y[range.clone()], &mut z[range.clone()]];
        let [x, y, z] = &mut scratch.position;
        let out = [&mut x[range.clone()], &mut y[range.clone()], &mut z[range.clone()]];
        let g = &layer.layer.content;
        // The Gaussian's name among all, and its first particle in the layer.
        let key = [stream, gaussian as u64];
        let begin = if gaussian == 0 { 0 } else { layer.ends[gaussian - 1] };
        let sampled_gaussian = SampledGaussian::new(g.mean_of(gaussian), &g.cov_of(gaussian), self.scale);
        match self.method {
            Method::Count | Method::Volume => {}
            Method::Ellipsoid => to_ball(&mut raw, &scratch.radii[range]),
            Method::Grid => return in_cell(&self.bounds, sampled_gaussian.mean, &raw, out),
            Method::Stratified => stratify(key, first + range.start as u64 - begin, &mut raw),
            Method::Spaced => {
                let count = layer.ends[gaussian] - begin;
                let density = count as f64 / (sampled_gaussian.volume() * self.mean_density);
                Cascade::new(key, count, density).apply(&mut raw);
            }
        }
        sampled_gaussian.apply(raw, out);
    }

    /// Appends a field's columns: its means at the particles' places, before these are wrapped, and a draw of its
    /// spread, by `joint` normal numbers if the field correlates with others.
    fn draw_field(
        &self,
        (name, field, joint): (&str, &FieldMoments, Option<&Vec<f64>>),
        particle_run: &ParticleRun<'_>,
        random: &mut Random,
        scratch: &mut DrawScratch,
        columns: &mut Vec<Vec<f64>>,
    ) {
        let layer = particle_run.layer;
        let (n, components, first) = (scratch.position[0].len(), field.components(), columns.len());
        let DrawScratch { draws, position, left, .. } = scratch;
        // A draw from two phases takes two normal ones.
        left.resize((components + usize::from(field.excess.is_some())) * n, 0.0);
        match joint {
            Some(joint) => left[..n].copy_from_slice(joint),
            None => draws.normals(self.simd, random, left),
        }
        columns.resize_with(first + components, || vec![0.0; n]);
        let (g, phases) = (&layer.layer.content, layer.phases.get(name));
        for (gaussian, part) in layer.parts(particle_run.first..particle_run.first + n as u64) {
            let mean = g.mean_of(gaussian);
            let spread = match components {
                1 => Sym3([field.spread[0][gaussian], 0.0, 0.0, 0.0, 0.0, 0.0]),
                _ => Sym3(std::array::from_fn(|k| field.spread[k][gaussian])),
            };
            let [a, b, c, d, e, f] = SampledGaussian::new([0.0; 3], &spread, 1.0).root;
            let normals = logarithms(field, phases, g, gaussian);
            for i in part {
                let from_mean = [0, 1, 2].map(|k| position[k][i] - mean[k]);
                let z = [0, 1, 2].map(|k| left.get(k * n + i).copied().unwrap_or(0.0));
                let drawn = [a * z[0], b * z[0] + c * z[1], d * z[0] + e * z[1] + f * z[2]];
                if let Some(normals) = &normals {
                    let [least, largest] = field.range[0];
                    // Phases are the same everywhere.
                    let place = if phases.is_some() { [0.0; 3] } else { from_mean };
                    let log = field.mean_at(0, gaussian, place)
                        + if joint.is_some() { normals.quantile(z[0]) } else { normals.draw([z[0], z[1]]) };
                    // Of libm, which gives the same bits on every machine.
                    columns[first][i] = libm::exp(log.max(least).min(largest));
                    continue;
                }
                for (k, [least, largest]) in field.range.iter().enumerate() {
                    let value = field.mean_at(k, gaussian, from_mean) + drawn[k];
                    columns[first + k][i] = value.max(*least).min(*largest);
                }
            }
        }
    }

    /// A category's column: for each particle the value of a class, by the shares at its place.
    fn draw_category(
        &self,
        classes: &[(String, f64)],
        particle_run: &ParticleRun<'_>,
        random: &mut Random,
        scratch: &mut DrawScratch,
    ) -> Vec<f64> {
        let (layer, n) = (particle_run.layer, scratch.position[0].len());
        let DrawScratch { draws, position, left, .. } = scratch;
        left.resize(n, 0.0);
        draws.uniforms(self.simd, random, left);
        let g = &layer.layer.content;
        let class_fields: Vec<_> =
            classes.iter().filter_map(|(name, value)| Some((g.fields.get(name)?, *value))).collect();
        let mut column = vec![0.0; n];
        for (gaussian, part) in layer.parts(particle_run.first..particle_run.first + n as u64) {
            let mean = g.mean_of(gaussian);
            for i in part {
                let from_mean = [0, 1, 2].map(|k| position[k][i] - mean[k]);
                let share = |field: &FieldMoments| field.mean_at(0, gaussian, from_mean).clamp(0.0, 1.0);
                // Shares of a place need not sum to 1.
                let mut rest = left[i] * class_fields.iter().map(|(field, _)| share(field)).sum::<f64>();
                let drawn = class_fields.iter().find(|(field, _)| {
                    rest -= share(field);
                    rest <= 0.0
                });
                // Rounding may leave a little beyond the last class.
                column[i] = drawn.or(class_fields.last()).map_or(0.0, |(_, value)| *value);
            }
        }
        column
    }

    /// Wraps, rounds to f32 and checks.
    fn finish(&self, layer: &LayerPlan, scratch: &mut DrawScratch, run: &mut Run) -> Result<()> {
        if let Some(wrap) = &self.wrap {
            wrap.apply(&mut scratch.position);
        }
        for k in 0..3 {
            run.columns[k].clear();
            let column = scratch.position[k].iter();
            match &self.wrap {
                Some(wrap) => run.columns[k].extend(column.map(|&v| wrap.round(k, v))),
                None => run.columns[k].extend(column.map(|&v| v as f32)),
            }
            if run.columns[k].iter().any(|v| !v.is_finite()) {
                return Err(Error::input(&layer.layer.name, "some positions in this layer are too large for float32"));
            }
        }
        Ok(())
    }
}

/// The classes of each category among `fields`, with their values: numbers, or else their places.
fn categories(fields: &[Quantity]) -> Vec<Vec<(String, f64)>> {
    let class = |(k, q): (usize, &Quantity)| {
        (q.name.clone(), q.class().and_then(|(_, class)| class.parse().ok()).unwrap_or(k as f64))
    };
    let classes = |group: &[Quantity]| group.iter().enumerate().map(class).collect();
    Metadata::categories(fields).map(classes).collect()
}

impl SampledGaussian {
    /// A lower triangle L with L L^T = `cov` times the square of `scale`; directions without extent
    /// get none.
    fn new(mean: [f64; 3], cov: &Sym3, scale: f64) -> SampledGaussian {
        let [xx, xy, xz, yy, yz, zz] = cov.0;
        let over = |v: f64, root: f64| if root > 0.0 { v / root } else { 0.0 };
        let a = xx.max(0.0).sqrt();
        let (b, d) = (over(xy, a), over(xz, a));
        let c = (yy - b * b).max(0.0).sqrt();
        let e = over(yz - b * d, c);
        let f = (zz - d * d - e * e).max(0.0).sqrt();
        SampledGaussian { mean, root: [a, b, c, d, e, f].map(|v| v * scale) }
    }

    /// Volume that a Gaussian of one particle fills at its mean density, (4 pi)^(3/2) times the root
    /// of the determinant.
    fn volume(&self) -> f64 {
        const FOUR_PI: f64 = 4.0 * std::f64::consts::PI;
        FOUR_PI * FOUR_PI.sqrt() * self.root[0] * self.root[2] * self.root[5]
    }

    fn apply(&self, raw: [&mut [f64]; 3], out: [&mut [f64]; 3]) {
        let [x, y, z] = raw;
        let [u, v, w] = out;
        let ([mx, my, mz], [a, b, c, d, e, f]) = (self.mean, self.root);
        for i in 0..x.len() {
            u[i] = mx + a * x[i];
            v[i] = my + (b * x[i] + c * y[i]);
            w[i] = mz + (d * x[i] + e * y[i] + f * z[i]);
        }
    }
}

/// Normal draws to uniform ones in a ball of radius [`REACH`]: their directions, and radii whose
/// cubes are uniform.
fn to_ball(raw: &mut [&mut [f64]; 3], radii: &[f64]) {
    let [x, y, z] = raw;
    for i in 0..radii.len() {
        let length = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
        let factor = if length > 0.0 { REACH * libm::cbrt(radii[i]) / length } else { 0.0 };
        x[i] *= factor;
        y[i] *= factor;
        z[i] *= factor;
    }
}

/// Uniform draws in the grid's cell that holds `centre`.
fn in_cell(bounds: &Bounds, centre: [f64; 3], raw: &[&mut [f64]; 3], out: [&mut [f64]; 3]) {
    let extent = bounds.extent();
    for (k, out) in out.into_iter().enumerate() {
        let width = extent[k] / GRID;
        let cell = ((centre[k] - bounds.min[k]) / width).floor().clamp(0.0, GRID - 1.0);
        let low = if width > 0.0 { bounds.min[k] + cell * width } else { bounds.min[k] };
        out.iter_mut().zip(raw[k].iter()).for_each(|(to, u)| *to = low + width * u);
    }
}
