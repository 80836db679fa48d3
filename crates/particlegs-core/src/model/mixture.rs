//! A mixture of Gaussians that carry counts, masses and other named columns.

use super::{Certificate, FieldMoments, Law, LawKind, Layer, Mass, Metadata, VizMapper, is_species};
use crate::math::{Sym3, each_axis};
use crate::space::Bounds;
use std::sync::Arc;

/// Gaussians in columns; all columns have the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mixture {
    /// Means: x, y and z, world units.
    pub mean: [Vec<f64>; 3],
    /// Covariances: xx, xy, xz, yy, yz, zz, world units squared.
    pub cov: [Vec<f64>; 6],
    /// Particles that each stands for. Whole numbers once decoded.
    pub count: Vec<f64>,
    /// Columns of one value a Gaussian. [`MASS`] is the mass that each stands for where particles have
    /// weights of their own; without it every particle has the mass 1.
    pub columns: Columns<Vec<f64>>,
    /// Moments of the fields that their particles carry, by the names of [`Metadata::fields`].
    pub fields: Columns<FieldMoments>,
    /// The law that they are drawn by. The counts of the alpha-blend law stand in proportion to opacity: a
    /// Gaussian's share of the particles that recovery draws.
    pub law: Law,
}

impl Mixture {
    /// No Gaussians yet, of the optical-depth law; with masses where particles are `weighted`.
    pub fn new(weighted: bool) -> Self {
        let mut columns = Columns::default();
        if weighted {
            columns.set(MASS, Vec::new());
        }
        Mixture { columns, ..Mixture::default() }
    }

    /// Masses of the Gaussians, where particles have weights of their own.
    pub fn masses(&self) -> Option<&Vec<f64>> {
        self.columns.get(MASS)
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.count.len()
    }

    /// Whether it has no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.count.is_empty()
    }

    /// Mean of Gaussian `i`.
    #[inline]
    pub fn mean_of(&self, i: usize) -> [f64; 3] {
        each_axis(|k| self.mean[k][i])
    }

    /// Covariance of Gaussian `i`.
    #[inline]
    pub fn cov_of(&self, i: usize) -> Sym3 {
        Sym3(std::array::from_fn(|k| self.cov[k][i]))
    }

    /// Multiplies the Gaussians' widths along an axis.
    pub fn stretch(&mut self, axis: usize, by: f64) {
        for i in 0..self.len() {
            let cov = self.cov_of(i).stretched(axis, by).0;
            (0..6).for_each(|k| self.cov[k][i] = cov[k]);
        }
    }

    /// Mass of Gaussian `i`: its own, or its count where particles are equal.
    pub fn mass_of(&self, i: usize) -> f64 {
        self.masses().map_or(self.count[i], |m| m[i])
    }

    /// Adds a Gaussian to a mixture of the optical-depth law. `mass` counts only where the mixture has masses.
    pub fn push(&mut self, mean: [f64; 3], cov: Sym3, count: f64, mass: f64) {
        for k in 0..3 {
            self.mean[k].push(mean[k]);
        }
        for k in 0..6 {
            self.cov[k].push(cov.0[k]);
        }
        self.count.push(count);
        if let Some(masses) = self.columns.get_mut(MASS) {
            masses.push(mass);
        }
    }

    /// Keeps some Gaussians of the optical-depth law, by their numbers.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let columns = self.mean.iter_mut().chain(&mut self.cov).chain([&mut self.count]);
        let columns = columns.chain(self.columns.iter_mut().map(|(_, column)| column));
        let fields = self.fields.iter_mut().flat_map(|(_, moments)| moments.all_columns_mut());
        for column in columns.chain(fields) {
            // `Vec::retain` gives values and not their places, so these are counted along.
            let mut next = 0..;
            column.retain(|_| next.next().is_some_and(&keep));
        }
    }

    /// Takes memory for so many Gaussians more, without their fields.
    pub fn reserve(&mut self, gaussians: usize) {
        let columns = self.mean.iter_mut().chain(&mut self.cov).chain([&mut self.count]);
        columns.chain(self.columns.get_mut(MASS)).for_each(|column| column.reserve(gaussians));
    }

    /// The correlations between what is left of two scalar fields, if they are known.
    pub fn correlation(&self, a: &str, b: &str) -> Option<&Vec<f64>> {
        let correlation_of = |a: &str, b: &str| self.fields.get(a)?.correlations.get(b);
        correlation_of(a, b).or_else(|| correlation_of(b, a))
    }

    /// Adds all of another's, of the same law and with the same columns. Fields that either lacks are left out.
    pub fn append(&mut self, other: &Mixture) {
        if self.is_empty() {
            self.fields = other.fields.map(FieldMoments::same_kind);
        }
        self.fields.retain(|name| other.is_empty() || other.fields.get(name).is_some());
        for k in 0..3 {
            self.mean[k].extend_from_slice(&other.mean[k]);
        }
        for k in 0..6 {
            self.cov[k].extend_from_slice(&other.cov[k]);
        }
        self.count.extend_from_slice(&other.count);
        for (name, column) in self.columns.iter_mut() {
            column.extend(other.columns.get(name).into_iter().flatten());
        }
        for (name, moments) in self.fields.iter_mut() {
            other.fields.get(name).into_iter().for_each(|others| moments.append(others));
        }
        if let (Some(columns), Some(others)) = (self.law.alpha_blend_mut(), other.law.alpha_blend()) {
            columns.opacity.extend_from_slice(&others.opacity);
            columns.grey.extend_from_slice(&others.grey);
        }
    }
}

/// Gaussians of one region, coded on their own: merging files copies blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Bounds of the particles that the block was fitted to, world units.
    pub bounds: Bounds,
    /// Particles.
    pub count: u64,
    /// Their mass.
    pub mass: f64,
    /// The Gaussians.
    pub gaussians: Mixture,
}

/// A model file's whole content.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Statements about the snapshot and the fit.
    pub metadata: Metadata,
    /// Layers, at least one.
    pub layers: Vec<Layer<Vec<Block>>>,
    /// Measurements after decoding.
    pub certificate: Option<Certificate>,
}

impl Layer<Vec<Block>> {
    /// Particles.
    pub fn count(&self) -> u64 {
        self.content.iter().map(|b| b.count).sum()
    }
}

impl Model {
    /// Leaves out all fields, from the metadata too.
    pub fn drop_fields(&mut self) {
        self.metadata.fields.clear();
        for block in self.layers.iter_mut().flat_map(|l| &mut l.content) {
            block.gaussians.fields = Columns::default();
        }
    }

    /// Mass of all particles in the unit of mass, where it is known.
    pub fn mass(&self) -> Option<f64> {
        let mass = |l: &Layer<Vec<Block>>| l.mass.unit_or_one() * l.content.iter().map(|b| b.mass).sum::<f64>();
        self.has_masses().then(|| self.layers.iter().map(mass).sum())
    }

    /// Whether the mass of particles is known: all layers have weights, or a particle mass.
    pub fn has_masses(&self) -> bool {
        self.layers.iter().all(|l| l.mass != Mass::Unknown)
    }

    /// The same of other Gaussians, block by block; what is said of the particles stays.
    pub fn with_gaussians(&self, convert: impl Fn(&Mixture) -> Mixture) -> Self {
        let block = |b: &Block| Block { gaussians: convert(&b.gaussians), ..*b };
        let layers = self.layers.iter().map(|l| l.with(l.content.iter().map(block).collect())).collect();
        Model { metadata: self.metadata.clone(), layers, certificate: self.certificate }
    }

    /// [`Model::only`], or the whole model without names.
    pub fn only_named(self, names: &[String]) -> crate::Result<Self> {
        if names.is_empty() { Ok(self) } else { self.only(names) }
    }

    /// The model of some layers alone. Bounds, radius, opacity and all that is known stay those of
    /// the whole snapshot, so that pictures of layers match; the certificate is of the whole, and
    /// goes.
    pub fn only(mut self, names: &[String]) -> crate::Result<Self> {
        let mut which = self.which(names)?.into_iter();
        self.layers.retain(|_| which.next() == Some(true));
        self.metadata.count = self.layers.iter().map(Layer::count).sum();
        self.metadata.mass = self.blocks().map(|b| b.mass).sum();
        self.certificate = None;
        Ok(self)
    }

    /// Whether each layer is meant by `names`: its own, or those of its species ([`is_species`]).
    pub fn which(&self, names: &[String]) -> crate::Result<Vec<bool>> {
        let called = |name: &str, query: &String| match self.layers.iter().any(|l| l.name == *query) {
            true => name == query,
            false => is_species(name, query),
        };
        if let Some(name) = names.iter().find(|n| !self.layers.iter().any(|l| called(&l.name, n))) {
            let layer_names: Vec<&str> = self.layers.iter().map(|l| &l.name[..]).collect();
            return Err(crate::Error::argument(format!(
                "no layer `{name}`; the layers are {}",
                layer_names.join(", ")
            )));
        }
        Ok(self.layers.iter().map(|l| names.iter().any(|n| called(&l.name, n))).collect())
    }

    /// All blocks of all layers.
    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        self.layers.iter().flat_map(|l| &l.content)
    }

    /// The network of the alpha-blend law, where it has one.
    pub fn vizmapper(&self) -> Option<&Arc<VizMapper>> {
        self.blocks().find_map(|b| b.gaussians.law.alpha_blend()?.vizmapper.as_ref())
    }

    /// Bytes of what the model holds as the snapshot did: positions as float32, 12 a particle, masses where they differ, 4
    /// more, and the fields.
    pub fn raw_bytes(&self) -> u64 {
        let of_fields = |b: &Block| {
            let fields = self.metadata.fields.iter().filter(|q| b.gaussians.fields.get(&q.name).is_some());
            fields.map(|q| u64::from(q.bytes)).sum::<u64>()
        };
        let of_block =
            |l: &Layer<Vec<Block>>, b: &Block| b.count.saturating_mul(l.mass.particle_bytes() + of_fields(b));
        let all = self.layers.iter().flat_map(|l| l.content.iter().map(move |b| of_block(l, b)));
        all.fold(0, u64::saturating_add)
    }

    /// Leaves out Gaussians that stand for no particle, as those that fade between two frames; alpha-blend models draw
    /// theirs whatever their counts.
    pub fn drop_empty(&mut self) {
        for block in self.layers.iter_mut().flat_map(|l| &mut l.content) {
            let counts = block.gaussians.count.clone();
            if self.metadata.law == LawKind::OpticalDepth && counts.contains(&0.0) {
                block.gaussians.retain(|i| counts[i] > 0.0);
            }
        }
    }

    /// Number of Gaussians.
    pub fn gaussians(&self) -> usize {
        self.blocks().map(|b| b.gaussians.len()).sum()
    }
}

/// Columns in the order in which they were added, each under a name of its own. All have the length of
/// what carries them.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns<T>(Vec<(String, T)>);

/// Weights of particles, masses of Gaussians.
pub const MASS: &str = "mass";

impl<T> Default for Columns<T> {
    fn default() -> Self {
        Columns(Vec::new())
    }
}

impl<T> Columns<T> {
    /// The column of that name.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.0.iter().find(|c| c.0 == name).map(|c| &c.1)
    }

    /// The column of that name, to be changed.
    pub fn get_mut(&mut self, name: &str) -> Option<&mut T> {
        self.0.iter_mut().find(|c| c.0 == name).map(|c| &mut c.1)
    }

    /// Adds a column, or replaces the one of that name.
    pub fn set(&mut self, name: &str, column: T) {
        match self.get_mut(name) {
            Some(old_column) => *old_column = column,
            None => self.0.push((name.to_string(), column)),
        }
    }

    /// Takes a column away.
    pub fn remove(&mut self, name: &str) -> Option<T> {
        let at = self.0.iter().position(|c| c.0 == name)?;
        Some(self.0.remove(at).1)
    }

    /// All columns and their names.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &T)> {
        self.0.iter().map(|(name, column)| (&name[..], column))
    }

    /// All columns and their names, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (&str, &mut T)> {
        self.0.iter_mut().map(|(name, column)| (&name[..], column))
    }

    /// Leaves out the columns that `keep` does not want.
    pub fn retain(&mut self, keep: impl Fn(&str) -> bool) {
        self.0.retain(|(name, _)| keep(name));
    }

    /// The same names, with what `f` makes of each column.
    pub fn map<U>(&self, f: impl Fn(&T) -> U) -> Columns<U> {
        Columns(self.0.iter().map(|(name, column)| (name.clone(), f(column))).collect())
    }
}
