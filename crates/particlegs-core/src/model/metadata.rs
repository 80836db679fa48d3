//! Metadata: statements of a model file about its snapshot and its making.

use super::{LawKind, Recipe, SharedSpecies, Unit, Units};
use crate::space::{Bounds, Cell};
use crate::splat::DEFAULT_OPACITY;

/// Boxes of one run differ by less, over their size.
const SAME_BOX: f64 = 1e-6;

/// Everything a file carries beside its Gaussians. `None` = the source does not say.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Metadata {
    /// Image law.
    pub law: LawKind,
    /// Particles of the whole snapshot.
    pub count: u64,
    /// The sum of their weights, each 1 where a layer has none; see [`super::Model::mass`] for the
    /// mass in units.
    pub mass: f64,
    /// Bounds of the whole snapshot, world units.
    pub bounds: Bounds,
    /// Simulation cell.
    pub cell: Option<Cell>,
    /// Default particle radius, world units.
    pub default_radius: f64,
    /// Default opacity.
    pub default_opacity: f64,
    /// Source name, without its path.
    pub source: String,
    /// Hash that binds it to its source: BLAKE3 of its runs (docs/format.md).
    #[serde(with = "crate::hash::hexadecimal")]
    pub source_hash: [u8; 32],
    /// Units of its numbers.
    #[serde(flatten)]
    pub units: Units,
    /// Cosmology.
    #[serde(flatten)]
    pub cosmology: Cosmology,
    /// The moment of the snapshot.
    #[serde(flatten)]
    pub epoch: Epoch,
    /// Quantities kept of the snapshot beside positions and masses; see [`Metadata::quantities`].
    #[serde(default)]
    pub fields: Vec<Quantity>,
    /// Of a frame of a series: a hash of its fields' values, which tells whether a snapshot still has them (docs/format.md).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fields_hash: Option<[u8; 16]>,
    /// Species that share the Gaussians of one layer, in the file's order. A decoded model has a layer for each, and no list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shared_species: Vec<SharedSpecies>,
    /// The recipe of the model.
    pub recipe: Recipe,
    /// The program's version.
    pub tool_version: String,
}

/// Parameters of the cosmology that a snapshot is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cosmology {
    /// Hubble parameter h, the Hubble constant in 100 km/s/Mpc.
    pub hubble: Option<f64>,
    /// Matter's share of the critical density today.
    pub omega_matter: Option<f64>,
    /// The cosmological constant's.
    pub omega_lambda: Option<f64>,
    /// Baryons'.
    pub omega_baryon: Option<f64>,
}

impl Cosmology {
    /// The scale factor of a universe of matter, a cosmological constant and curvature, `seconds` after the big bang. `None`
    /// where parameters are missing, and where there is no such moment: no big bang, or a universe that shrinks again.
    pub fn scale_factor_at(&self, seconds: f64) -> Option<f64> {
        /// 100 km/s/Mpc, per second.
        const HUNDRED: f64 = 3.240_779_289e-18;
        let (hubble, matter, lambda) = (self.hubble?, self.omega_matter?, self.omega_lambda?);
        let is_flat = matter > 0.0 && (matter + lambda - 1.0).abs() < 1e-3;
        if is_flat && lambda > 0.0 {
            let grown = libm::sinh(1.5 * libm::sqrt(lambda) * HUNDRED * hubble * seconds);
            return (grown > 0.0).then(|| libm::cbrt(matter / lambda * grown * grown));
        }
        let elapsed = HUNDRED * hubble * seconds;
        let has_begun = matter > 0.0 || matter == 0.0 && lambda < 1.0;
        if !has_begun || elapsed.is_nan() || elapsed <= 0.0 {
            return None;
        }
        // Bisection for the root of a.
        let [mut low, mut high] = [0.0, 1.0];
        while self.age_at(high)? < elapsed {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if self.age_at(middle)? < elapsed { &mut low } else { &mut high }) = middle;
        }
        Some(high * high)
    }

    /// The age, over the Hubble time, at which the scale factor is `root` squared: the integral of
    /// 2 s^2 / sqrt(Omega_m + Omega_k s^2 + Omega_Lambda s^6) ds, by Simpson's rule. `None` where that has no value.
    fn age_at(&self, root: f64) -> Option<f64> {
        const STEPS: u32 = 512;
        let (matter, lambda) = (self.omega_matter?, self.omega_lambda?);
        let curvature = 1.0 - matter - lambda;
        // In the root of a the integrand is smooth at the big bang; in a itself it begins with an infinite slope.
        let rate = |s: f64| 2.0 * s * s / libm::sqrt(matter + s * s * (curvature + lambda * libm::pow(s, 4.0)));
        let step = root / f64::from(STEPS);
        let weight = |i: u32| if i == STEPS { 1.0 } else { 2.0 + 2.0 * f64::from(i % 2) };
        // The first point is left out: the integrand is 0 there, and without matter 0 / 0.
        let sum: f64 = (1..=STEPS).map(|i| weight(i) * rate(step * f64::from(i))).sum();
        (sum.is_finite() && root < 1e6).then_some(sum * step / 3.0)
    }
}

/// The moment of a snapshot.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Epoch {
    /// Cosmological scale factor.
    pub scale_factor: Option<f64>,
    /// Simulation time, in the unit of time.
    pub time: Option<f64>,
    /// Frame that was read, from 0, of a file that holds several.
    pub frame: Option<u64>,
    /// Time step, as the source numbers it.
    pub step: Option<i64>,
}

impl Epoch {
    /// Redshift from the scale factor.
    pub fn redshift(&self) -> Option<f64> {
        self.scale_factor.map(|a| 1.0 / a - 1.0)
    }
}

/// A quantity that was kept of each particle of a snapshot.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Quantity {
    /// Name, at most 255 bytes in a file.
    pub name: String,
    /// Kind of its values.
    pub kind: QuantityKind,
    /// Their unit, where it is known.
    pub unit: Option<Unit>,
    /// Bytes of it a particle, as the float32 or whole numbers that were compressed.
    pub bytes: u16,
    /// Whether its means are weighted by the particles' masses; else all particles count alike.
    #[serde(default)]
    pub by_mass: bool,
    /// Whether its moments describe the natural logarithm of its values, as those of a positive scalar over decades.
    #[serde(default)]
    pub logarithmic: bool,
    /// Whether it is a sum over particles, such as a charge; its values then are those of a particle over its weight.
    #[serde(default)]
    pub extensive: bool,
}

impl Quantity {
    /// A quantity that is known by its name and kind alone.
    pub fn new(name: impl Into<String>, kind: QuantityKind) -> Self {
        let name = name.into();
        Quantity { name, kind, unit: None, bytes: 0, by_mass: false, logarithmic: false, extensive: false }
    }

    /// The category and the class of `CATEGORY=CLASS`, whose values are shares.
    pub fn class(&self) -> Option<(&str, &str)> {
        self.name.split_once('=').filter(|_| self.kind == QuantityKind::Category)
    }

    /// Whether `name` is its own name, or that of the category that it is a class of.
    pub fn is_called(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
            || self.class().is_some_and(|(category, _)| category.eq_ignore_ascii_case(name))
    }

    /// The names of its components: `velocity_x`, `velocity_y`, `velocity_z` of a vector, its own of what is one number.
    pub fn component_names(&self) -> Vec<String> {
        match self.kind {
            QuantityKind::Vector => ["x", "y", "z"].map(|axis| format!("{}_{axis}", self.name)).into(),
            _ => vec![self.name.clone()],
        }
    }

    /// The unit of its mean at a place, by the unit of length; of a sum that of how much there is in a unit of volume.
    pub fn place_unit(&self, length: Option<&str>) -> Option<String> {
        let unit_text = self.unit.as_ref().map(|u| u.text.clone());
        match self.extensive {
            true => length.map(|length| format!("{} / ({length})^3", unit_text.as_deref().unwrap_or("1"))),
            false => unit_text,
        }
    }

    /// The unit of its dispersion. A sum has none.
    pub fn dispersion_unit(&self) -> Option<String> {
        if self.logarithmic { Some("dex".into()) } else { self.unit.as_ref().map(|u| u.text.clone()) }
    }

    /// Kind of its values, in a word or two.
    pub fn describe_kind(&self) -> &'static str {
        match (self.extensive, self.logarithmic) {
            _ if self.class().is_some() => "share",
            (true, _) => "sum",
            (_, true) => "scalar by its logarithm",
            _ => self.kind.name(),
        }
    }
}

crate::named_values! {
    /// Kinds of the values of a [`Quantity`], in the order of their numbers in a file, which begin at 1.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum QuantityKind {
        /// A number.
        Scalar = "scalar",
        /// Three numbers.
        Vector = "vector",
        /// A number that tells particles apart.
        Id = "id",
        /// One of a few, as a chemical element.
        Category = "category",
    }
}

impl Metadata {
    /// Weighting of particles in means and shapes of Gaussians: all alike, whatever their masses, which are sums.
    pub const WEIGHTING: &'static str = "count";

    /// Of a snapshot of `count` particles in `bounds` that says nothing else: masses of 1, the default radius and
    /// opacity.
    pub fn new(law: LawKind, count: u64, bounds: Bounds) -> Self {
        Metadata {
            law,
            count,
            mass: count as f64,
            bounds,
            cell: None,
            default_radius: bounds.default_radius(count),
            default_opacity: DEFAULT_OPACITY,
            source: String::new(),
            source_hash: [0; 32],
            units: Units::default(),
            cosmology: Cosmology::default(),
            epoch: Epoch::default(),
            fields: Vec::new(),
            fields_hash: None,
            shared_species: Vec::new(),
            recipe: Recipe::default(),
            tool_version: env!("CARGO_PKG_VERSION").to_string(),
        }
    }

    /// The classes of each category among `fields`.
    pub fn categories(fields: &[Quantity]) -> impl Iterator<Item = &[Quantity]> {
        let category = |q: &Quantity| q.class().map(|(category, _)| category.to_string());
        fields.chunk_by(move |a, b| category(a) == category(b)).filter(|classes| classes[0].class().is_some())
    }

    /// Whether a file stores the moments of field `number`: those of a category's last class follow from the others'.
    pub fn is_stored(fields: &[Quantity], number: usize) -> bool {
        let category = |n: usize| fields.get(n).and_then(Quantity::class).map(|(category, _)| category);
        category(number).is_none() || category(number) == category(number + 1)
    }

    /// Gaps of the listed fields, a sentence each, in layers of so many `blocks`; `has` says by layer, block, name and
    /// number of a field whether it is there. A layer may lack a field, but not some of its blocks alone.
    pub fn lacking_fields(&self, blocks: &[usize], has: &dyn Fn(usize, usize, &str, usize) -> bool) -> Vec<String> {
        let mut lacking = Vec::new();
        for (number, q) in self.fields.iter().enumerate().filter(|(n, _)| Self::is_stored(&self.fields, *n)) {
            let blocks_with = |layer: usize| (0..blocks[layer]).filter(|&b| has(layer, b, &q.name, number)).count();
            let of_layers: Vec<usize> = (0..blocks.len()).map(blocks_with).collect();
            let all = of_layers.iter().sum::<usize>();
            let some = of_layers.iter().zip(blocks).find(|(count, all)| **count > 0 && count < all);
            lacking.extend(match some {
                None if all == 0 => Some(format!("the field `{}` is listed, but no block has it", q.name)),
                Some((count, all)) => Some(format!("the field `{}` is in {count} of {all} blocks of a layer", q.name)),
                None => None,
            });
        }
        lacking
    }

    /// Difference of the `next` frame if it is not of the same run, as a sentence: other units, cosmology or axes, in a
    /// cosmological run another box, or other units of a field.
    pub fn difference_to_next(&self, next: &Metadata) -> Option<String> {
        let periodic_axes = |m: &Metadata| m.cell.map(|c| c.periodic);
        let differing = [
            ("units", self.units != next.units),
            ("cosmology", self.cosmology != next.cosmology),
            ("periodic axes", periodic_axes(self) != periodic_axes(next)),
        ];
        if let Some((subject, _)) = differing.into_iter().find(|d| d.1) {
            return Some(format!("its {subject} are not those of the frame before"));
        }
        if !self.has_box_of(next) {
            let shown = |m: &Metadata| m.cell.map_or("not stated".into(), |c| c.to_string());
            return Some(format!("its box is {}, that of the frame before {}", shown(next), shown(self)));
        }
        let unit = |q: &Quantity| q.unit.as_ref().map_or("not stated".into(), |u| u.text.clone());
        next.fields.iter().find_map(|field| {
            let same = self.fields.iter().find(|f| f.name == field.name);
            let same = same.filter(|f| f.unit != field.unit || f.kind != field.kind)?;
            let (before, now) = (unit(same), unit(field));
            Some(format!("the unit of its field `{}` is {now}, in the frame before {before}", field.name))
        })
    }

    /// Whether two moments of a cosmological run have one box: the same in comoving lengths, growing with the scale factor
    /// in physical ones. The cell of other runs may change.
    fn has_box_of(&self, next: &Metadata) -> bool {
        let (Some(before), Some(now)) = (self.epoch.scale_factor, next.epoch.scale_factor) else { return true };
        let (Some(a), Some(b)) = (self.cell, next.cell) else { return self.cell.is_none() == next.cell.is_none() };
        // Cells without volume have no lattice to compare, but may be equal.
        let grown_by = |factor: f64| a.scaled(factor) == b || a.scaled(factor).same_lattice(&b, SAME_BOX);
        match next.units.comoving {
            Some(true) => grown_by(1.0),
            Some(false) => grown_by(now / before),
            None => grown_by(1.0) || grown_by(now / before),
        }
    }

    /// All that was kept of the snapshot: positions, masses where particles of any layer are `weighted`, and
    /// [`Metadata::fields`].
    pub fn quantities(&self, weighted: bool) -> Vec<Quantity> {
        let quantity = |name: &str, kind, unit: &Option<Unit>, bytes| Quantity {
            unit: unit.clone(),
            bytes,
            ..Quantity::new(name, kind)
        };
        let mut all = vec![quantity("positions", QuantityKind::Vector, &self.units.length, 12)];
        all.extend(weighted.then(|| quantity("masses", QuantityKind::Scalar, &self.units.mass, 4)));
        all.extend(self.fields.iter().cloned());
        all
    }
}
