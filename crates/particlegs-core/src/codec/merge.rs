//! Model files into one: coded blocks are copied (docs/format.md, section 12).
//!
//! The merged file is a function of the set of its blocks and of what the parts say alike, so that
//! it does not matter in which order, or by which steps, parts were merged: every field of the
//! metadata is either equal in all parts, or computed anew from the blocks, or combined by an
//! operation that is associative, commutative and takes a value with itself to itself.

use super::container::{CORRELATION, FIELD, survives_merging};
use super::decode::check;
use super::file::{CodedFile, CodedLayer, StoredSection, order_key};
use super::header::BlockHeader;
use super::sums::compensated;
use crate::context::Context;
use crate::hash;
use crate::model::{Dimension, Metadata, Quantity, SharedSpecies, Unit, Units};
use crate::splat::DEFAULT_OPACITY;
use crate::{Error, Hint, Result};
use std::collections::{BTreeMap, BTreeSet};

/// Ends a text that stands for several: what all begin with.
const SEVERAL: char = '*';

/// Parts being merged: [`Merge::add`] one after the other, in any order, then [`Merge::finish`].
#[derive(Default)]
pub struct Merge {
    /// Names of the fields that are kept; `None` = all, which every part must have.
    fields: Option<Vec<String>>,
    /// Metadata of all parts so far, combined; and the first part's place, for refusals.
    known: Option<(Metadata, String)>,
    layers: BTreeMap<String, MergedLayer>,
    /// The first block so far and the network of the part that holds it.
    network: Option<(FirstBlockKey, Option<Vec<u8>>)>,
    /// Sections of unknown tags that belong to no block and are kept, each once.
    sections: BTreeSet<StoredSection>,
    bytes: u64,
}

/// Key that says which block is the first of a file: its layer's name, its bounds, its bytes.
type FirstBlockKey = (String, [u64; 6], Vec<u8>);

struct MergedLayer {
    coded: CodedLayer,
    /// The first part that has it.
    place: String,
}

impl Merge {
    /// Keeps these fields alone, which every part must have.
    pub fn with_fields(names: Vec<String>) -> Merge {
        Merge { fields: Some(names), ..Merge::default() }
    }

    /// Adds a model file's blocks. `place` names it in errors.
    pub fn add(&mut self, bytes: &[u8], place: &str, context: &Context<'_>) -> Result<()> {
        // A copy of the blocks now, and another when the file is put together.
        self.bytes += bytes.len() as u64;
        context.require_memory("the merge", self.bytes + bytes.len() as u64)?;
        // What is copied is read first: a block that cannot be decoded must not spread.
        check(bytes, place, context)?;
        let CodedFile { mut metadata, network, sections, mut layers } = CodedFile::read(bytes, place)?;
        if let Some(names) = &self.fields {
            keep_fields(names, &mut metadata.fields, &mut layers, place)?;
        }
        let (survivors, others): (Vec<_>, Vec<_>) = sections.into_iter().partition(|s| survives_merging(s.tag));
        self.sections.extend(survivors);
        others
            .iter()
            .for_each(|s| context.message(&format!("note: {place}: section `{}` is dropped", s.tag.escape_ascii())));
        metadata.recipe = metadata.recipe.merged();
        self.known = Some(match self.known.take() {
            None => (metadata, place.to_string()),
            Some((known, first)) => {
                refuse_unlike(&known, &metadata, &first, place)?;
                (combined(known, &metadata), first)
            }
        });
        // The network of the part with the first block of all is kept, whatever the order of parts (section 12).
        if let Some(first) = first_block(&layers, place)?
            && self.network.as_ref().is_none_or(|network| first < network.0)
        {
            self.network = Some((first, network));
        }
        layers.into_iter().try_for_each(|layer| self.add_layer(layer, place))
    }

    fn add_layer(&mut self, layer: CodedLayer, place: &str) -> Result<()> {
        let Some(entry) = self.layers.get_mut(&layer.name) else {
            let name = layer.name.clone();
            self.layers.insert(name, MergedLayer { coded: layer, place: place.to_string() });
            return Ok(());
        };
        let mass = |m: Option<f64>| m.map_or_else(|| "unknown".to_string(), |m| m.to_string());
        let words = |weighted: bool| if weighted { "individual masses" } else { "no individual masses" };
        let (a, b) = (entry.coded.mass, layer.mass);
        let difference = if a.is_weighted() != b.is_weighted() {
            format!("have {}, but those in {} have {}", words(b.is_weighted()), entry.place, words(a.is_weighted()))
        } else if a.unit().map(f64::to_bits) != b.unit().map(f64::to_bits) {
            format!("have a mass of {}, but those in {} have {}", mass(b.unit()), entry.place, mass(a.unit()))
        } else {
            entry.coded.content.extend(layer.content);
            return Ok(());
        };
        let message = format!("particles of layer `{}` {difference}: they cannot form one layer", layer.name);
        Err(Error::input(place, message))
    }

    /// The merged file: no certificate, for nothing was measured on it.
    pub fn finish(self) -> Result<Vec<u8>> {
        let Some((mut metadata, _)) = self.known else {
            return Err(Error::argument("nothing to merge: name at least one model file"));
        };
        let layers: Vec<CodedLayer> = self.layers.into_values().map(|l| l.coded).collect();
        let digests = digests(&layers);
        if digests.windows(2).any(|w| w[0] == w[1]) {
            let hint = "name each model file once".to_string();
            return Err(Error::Argument { what: "the files hold the same block twice".into(), hint: hint.into() });
        }
        (metadata.count, metadata.mass) = sums(&layers)?;
        metadata.default_radius = metadata.bounds.default_radius(metadata.count);
        metadata.tool_version = env!("CARGO_PKG_VERSION").to_string();
        // Zeros stand for several sources, as `combined` left them.
        if metadata.source_hash == [0; 32] {
            metadata.source_hash = combined_digest(&digests);
        }
        let network = self.network.and_then(|n| n.1);
        let sections = self.sections.into_iter().collect();
        CodedFile { metadata, network, sections, layers }.write(None)
    }
}

/// Keeps the fields of these names, in their order.
fn keep_fields(names: &[String], fields: &mut Vec<Quantity>, layers: &mut [CodedLayer], place: &str) -> Result<()> {
    let mut kept_numbers: Vec<usize> = Vec::new();
    for name in names {
        let matches: Vec<usize> = (0..fields.len()).filter(|&n| fields[n].is_called(name)).collect();
        let Some(first) = matches.first() else {
            let hint = match fields.is_empty() {
                true => "it has none".to_string(),
                false => format!("its fields: {}", list(fields.iter())),
            };
            return Err(Error::input_with(place, format!("the model has no field `{name}`"), hint));
        };
        // The shares of a category go together.
        let category = fields[*first].class().map(|(name, _)| name.to_string());
        let same = |q: &Quantity| q.class().map(|(name, _)| name) == category.as_deref();
        let all = (0..fields.len()).filter(|&n| if category.is_some() { same(&fields[n]) } else { n == *first });
        all.for_each(|number| {
            if !kept_numbers.contains(&number) {
                kept_numbers.push(number);
            }
        });
    }
    *fields = kept_numbers.iter().map(|&number| fields[number].clone()).collect();
    // A section of a field begins with its number, one of a correlation with two.
    let number_count = |tag: [u8; 4]| [FIELD, CORRELATION].iter().position(|t| *t == tag).map_or(0, |place| place + 1);
    let place_of = |number: &u8| kept_numbers.iter().position(|k| *k == usize::from(*number));
    for block in layers.iter_mut().flat_map(|l| &mut l.content) {
        block.sections.retain_mut(|s| {
            let field_numbers = s.bytes.iter_mut().take(number_count(s.tag));
            field_numbers.map(|n| place_of(n).map(|place| *n = place as u8)).all(|place| place.is_some())
        });
        block.sections.sort_by_key(|s| (s.tag, s.bytes.iter().take(number_count(s.tag)).copied().collect::<Vec<_>>()));
    }
    Ok(())
}

fn list<'a>(fields: impl Iterator<Item = &'a Quantity>) -> String {
    fields.map(|q| &q.name[..]).collect::<Vec<_>>().join(", ")
}

/// Parts must have the same fields.
fn refuse_other_fields(a: &[Quantity], b: &[Quantity], first: &str, place: &str) -> Result<()> {
    let lacks = |fields: &[Quantity], q: &Quantity| fields.iter().all(|o| o.name != q.name);
    let common: Vec<&Quantity> = a.iter().filter(|q| b.contains(q)).collect();
    let hint = match common.is_empty() {
        true => Hint::from("merge them without fields by ").option("fields", "none"),
        false => Hint::from("merge the fields that all parts have by ")
            .option("fields", common.iter().map(|q| &q.name[..]).collect::<Vec<_>>().join(",")),
    };
    let unit = |q: &Quantity| q.unit.as_ref().map_or("no unit".to_string(), |u| format!("unit `{}`", u.text));
    let weights = |q: &Quantity| if q.by_mass { "mass" } else { "number" };
    let describe = |q: &Quantity| format!("a {} with {}, weighted by {}", q.kind.name(), unit(q), weights(q));
    let message = if let Some(q) = a.iter().find(|q| lacks(b, q)) {
        format!("the model has no field `{}`, which {first} has", q.name)
    } else if let Some(q) = b.iter().find(|q| lacks(a, q)) {
        format!("the model has the field `{}`, which {first} lacks", q.name)
    } else if let Some((p, q)) = a.iter().find_map(|p| b.iter().find(|q| p.name == q.name && p != *q).map(|q| (p, q))) {
        format!("field `{}` is {}, but in {first} it is {}", q.name, describe(q), describe(p))
    } else if a != b {
        format!("the fields are in another order than in {first}")
    } else {
        return Ok(());
    };
    Err(Error::input_with(place, message, hint))
}

/// The first block of a file: they come in order.
fn first_block(layers: &[CodedLayer], place: &str) -> Result<Option<FirstBlockKey>> {
    let Some((layer, block)) = layers.first().and_then(|l| Some((l, l.content.first()?))) else { return Ok(None) };
    let header = BlockHeader::read(&block.bytes).map_err(|message| Error::corrupt(place, message))?;
    Ok(Some((layer.name.clone(), order_key(&header), block.bytes.clone())))
}

/// The hash that stands in for the source's where blocks come from several sources: of the blocks
/// alone, whatever their order.
pub fn blocks_hash(layers: &[CodedLayer]) -> [u8; 32] {
    combined_digest(&digests(layers))
}

/// A digest of each block with its layer's name, sorted.
fn digests(layers: &[CodedLayer]) -> Vec<[u8; 32]> {
    let digest = |name: &str, block: &[u8]| {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&[name.len() as u8]).update(name.as_bytes());
        hash::update(&mut hasher, block);
        *hasher.finalize().as_bytes()
    };
    let mut all: Vec<_> = layers.iter().flat_map(|l| l.content.iter().map(|b| digest(&l.name, &b.bytes))).collect();
    all.sort_unstable();
    all
}

fn combined_digest(sorted: &[[u8; 32]]) -> [u8; 32] {
    *blake3::hash(sorted.as_flattened()).as_bytes()
}

/// Particles and mass of all blocks: the masses in rising order, so that no order of files shows.
pub fn sums(layers: &[CodedLayer]) -> Result<(u64, f64)> {
    let (mut count, mut masses) = (Some(0u64), Vec::new());
    for block in layers.iter().flat_map(|l| &l.content) {
        let header = BlockHeader::read(&block.bytes).map_err(Error::argument)?;
        count = count.and_then(|sum| sum.checked_add(header.count));
        masses.push(header.mass);
    }
    masses.sort_unstable_by(f64::total_cmp);
    let mass = compensated(&masses);
    match count {
        Some(count) if mass.is_finite() => Ok((count, mass)),
        _ => Err(Error::argument("the parts have too many particles or too much mass for one file")),
    }
}

/// Two parts that may be merged, as one. Count, mass and radius are set at the end; a hash of zeros
/// stands for several sources.
fn combined(a: Metadata, b: &Metadata) -> Metadata {
    let mut bounds = a.bounds.union(&b.bounds);
    // -0 and 0 are one place: adding 0 leaves one of them.
    [&mut bounds.min, &mut bounds.max].into_iter().flatten().for_each(|v| *v += 0.0);
    Metadata {
        bounds,
        default_opacity: if a.default_opacity == b.default_opacity { a.default_opacity } else { DEFAULT_OPACITY },
        source: common(&a.source, &b.source),
        units: Units {
            length: first(a.units.length, &b.units.length),
            mass: first(a.units.mass, &b.units.mass),
            time: first(a.units.time, &b.units.time),
            comoving: a.units.comoving,
        },
        source_hash: if a.source_hash == b.source_hash { a.source_hash } else { [0; 32] },
        fields_hash: None,
        recipe: a.recipe.joined(&b.recipe),
        shared_species: summed(a.shared_species, &b.shared_species),
        ..a
    }
}

/// The same species with the particles of both.
fn summed(mut a: Vec<SharedSpecies>, b: &[SharedSpecies]) -> Vec<SharedSpecies> {
    a.iter_mut().zip(b).for_each(|(a, b)| a.count = a.count.saturating_add(b.count));
    a
}

/// One unit that both write, in the text that comes first.
fn first(a: Option<Unit>, b: &Option<Unit>) -> Option<Unit> {
    if b.as_ref().map(|u| &u.text) < a.as_ref().map(|u| &u.text) { b.clone() } else { a }
}

/// The common beginning of both texts, then `*`; the text itself where they are the same. A `*` at an end is one that
/// this put there.
fn common(a: &str, b: &str) -> String {
    if a == b {
        return a.to_string();
    }
    let [p, q] = [a, b].map(|t| t.strip_suffix(SEVERAL).unwrap_or(t));
    let same = p.chars().zip(q.chars()).take_while(|(x, y)| x == y).map(|(x, _)| x);
    same.chain([SEVERAL]).collect()
}

/// Names and masses of the species that share Gaussians.
fn species(m: &Metadata) -> Option<String> {
    let describe =
        |s: &SharedSpecies| format!("{} (mass {})", s.name, s.mass.map_or("unknown".into(), |m| m.to_string()));
    let all: Vec<String> = m.shared_species.iter().map(describe).collect();
    (!all.is_empty()).then(|| all.join(", "))
}

/// Statements of metadata on the source's space and time, by name: for the comparison of two files, and in words. Two
/// texts of one size are one unit.
pub fn source_statements(m: &Metadata) -> Vec<(&'static str, [String; 2])> {
    fn said<T: ToString>(v: Option<T>) -> String {
        v.map_or_else(|| "not stated".to_string(), |v| v.to_string())
    }
    let unit = |u: &Option<Unit>, dimension| {
        let size = u.as_ref().and_then(|u| u.si).map(|si| format!("{si:?}"));
        let words = u.as_ref().map(|u| format!("`{}`", u.describe(dimension)));
        [size.unwrap_or_else(|| said(words.as_ref())), said(words)]
    };
    let same = |text: String| [text.clone(), text];
    let (u, c, e) = (&m.units, &m.cosmology, &m.epoch);
    vec![
        ("image law", same(m.law.name().to_string())),
        ("`comoving`", same(said(u.comoving))),
        ("unit of length", unit(&u.length, Dimension::Length)),
        ("unit of mass", unit(&u.mass, Dimension::Mass)),
        ("unit of time", unit(&u.time, Dimension::Time)),
        ("cell", same(said(m.cell))),
        ("scale factor", same(said(e.scale_factor))),
        ("h", same(said(c.hubble))),
        ("Omega_m", same(said(c.omega_matter))),
        ("Omega_Lambda", same(said(c.omega_lambda))),
        ("Omega_b", same(said(c.omega_baryon))),
        ("time", same(said(e.time))),
        ("frame", same(said(e.frame))),
        ("time step", same(said(e.step))),
        ("list of species that share Gaussians", same(said(species(m)))),
        ("list of fields", same(said((!m.fields.is_empty()).then(|| format!("{:?}", m.fields))))),
    ]
}

/// Parts must speak of one space and one time.
fn refuse_unlike(a: &Metadata, b: &Metadata, first: &str, place: &str) -> Result<()> {
    refuse_other_fields(&a.fields, &b.fields, first, place)?;
    let mut pairs = source_statements(a).into_iter().zip(source_statements(b));
    match pairs.find(|(x, y)| x.1[0] != y.1[0]) {
        None => Ok(()),
        Some(((name, [_, x]), (_, [_, y]))) => Err(Error::input_with(
            place,
            format!("the {name} is {y}, but that of {first} is {x}: they cannot form one model"),
            "merge models of one snapshot, or of snapshots in one box and unit at one time",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::{Precision, decode, encode};
    use crate::math::Sym3;
    use crate::model::{Block, Effort, Epoch, LawKind, Layer, Mass, Mixture, Model, Recipe, RecipeStep, Target};
    use crate::space::{Bounds, Cell};
    use proptest::prelude::*;

    /// A model of one Gaussian at `x`, of `count` particles.
    fn model(name: &str, x: f64, count: u64, mass: Option<f64>) -> Model {
        let mut gaussians = Mixture::new(mass.is_some());
        gaussians.push([x; 3], Sym3::scaled_identity(0.01), count as f64, mass.unwrap_or(0.0));
        let bounds = Bounds { min: [x - 1.0; 3], max: [x + 1.0; 3] };
        let mass = mass.unwrap_or(count as f64);
        let mut source_hash = [7; 32];
        source_hash[0] = x as u8 + 1;
        Model {
            metadata: Metadata {
                mass,
                cell: Some(Cell::orthogonal([100.0; 3])),
                default_radius: 0.1,
                source: format!("snap.{}.hdf5", x as u8),
                source_hash,
                units: Units::new(Some("Mpc/h"), None, Some(true)),
                epoch: Epoch { scale_factor: Some(1.0), ..Epoch::default() },
                recipe: Recipe {
                    target: Target::Ratio(count as f64),
                    effort: if count.is_multiple_of(3) { Effort::Fast } else { Effort::Default },
                    blocks: 1 + count as u32 % 2,
                    ..Recipe::default()
                },
                ..Metadata::new(LawKind::OpticalDepth, count, bounds)
            },
            layers: vec![Layer {
                name: name.into(),
                mass: Mass::new(gaussians.masses().is_some(), None),
                content: vec![Block { bounds, count, mass, gaussians }],
            }],
            certificate: None,
        }
    }

    fn coded(model: &Model) -> Vec<u8> {
        encode(model, &Precision::BALANCED).unwrap()
    }

    fn merge(parts: &[&[u8]]) -> Result<Vec<u8>> {
        let mut merge = Merge::default();
        parts
            .iter()
            .enumerate()
            .try_for_each(|(i, p)| merge.add(p, &format!("part {i}"), &crate::context::Context::SILENT))?;
        merge.finish()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Any order and any bracketing give the same bytes.
        #[test]
        fn merging_is_associative_and_order_free(
            parts in proptest::collection::btree_map(0u8..90, (1u64..1_000_000, 0.1f64..1e9, any::<bool>()), 3..8),
            opacities in proptest::collection::vec(prop_oneof![Just(0.05), Just(0.1)], 8),
            units in proptest::collection::vec(prop_oneof![Just("Mpc/h"), Just("h^-1 Mpc"), Just("cMpc h^-1")], 8),
            cut in 1usize..3,
        ) {
            let files: Vec<Vec<u8>> = parts.iter().zip(opacities.into_iter().zip(units)).map(|((&x, &(n, mass, heavy)), (opacity, unit))| {
                let mut m = model(if heavy { "gas" } else { "dm" }, f64::from(x), n, heavy.then_some(mass));
                m.metadata.default_opacity = opacity;
                m.metadata.units = Units::new(Some(unit), None, Some(true));
                coded(&m)
            }).collect();
            let all: Vec<&[u8]> = files.iter().map(|f| &f[..]).collect();
            let whole = merge(&all).unwrap();
            let (a, b) = all.split_at(cut);
            let (a, b) = (merge(a).unwrap(), merge(b).unwrap());
            prop_assert_eq!(&merge(&[&b, &a]).unwrap(), &whole);
            prop_assert_eq!(&merge(&[&whole]).unwrap(), &whole);
            let mut reversed = all.clone();
            reversed.reverse();
            prop_assert_eq!(merge(&reversed).unwrap(), whole);
        }

        #[test]
        fn texts_combine_in_any_order(t in proptest::collection::vec("[a-c]{0,4}\\*?|é{0,3}", 3)) {
            let [a, b, c] = [0, 1, 2].map(|i| &t[i][..]);
            prop_assert_eq!(common(&common(a, b), c), common(a, &common(c, b)));
        }

        #[test]
        fn recipes_combine_in_any_order(
            all in proptest::collection::vec((0u64..2, 0u32..2, 0u64..3, any::<bool>(), any::<bool>()), 3),
        ) {
            let recipe = |&(seed, blocks, k, fast, known): &(u64, u32, u64, bool, bool)| {
                let effort = if fast { Effort::Fast } else { Effort::Default };
                let recipe = Recipe { seed, blocks, effort, ..if known { Recipe::default() } else { Recipe::unknown() } };
                let steps = (0..k).map(|k| RecipeStep::Simplify(Target::Gaussians(k)));
                steps.fold(recipe, Recipe::then).merged()
            };
            let [a, b, c] = [0, 1, 2].map(|i| recipe(&all[i]));
            let join = |a: &Recipe, b: &Recipe| a.clone().joined(b);
            prop_assert_eq!(join(&join(&a, &b), &c), join(&a, &join(&c, &b)));
            prop_assert_eq!(join(&a, &a), a.clone());
            prop_assert_eq!(join(&a, &b).merged(), join(&b, &a));
        }
    }

    #[test]
    fn metadata_is_that_of_the_whole() {
        let files = [model("dm", 3.0, 10, None), model("dm", 9.0, 20, None), model("gas", 5.0, 5, Some(2.5))]
            .map(|m| coded(&m));
        let merged = merge(&[&files[2], &files[0], &files[1]]).unwrap();
        let merged_model = decode(&merged, "merged").unwrap();
        let m = &merged_model.metadata;
        assert_eq!((m.count, m.mass), (35, 32.5));
        assert_eq!((m.bounds.min, m.bounds.max), ([2.0; 3], [10.0; 3]));
        assert_eq!(m.default_radius, m.bounds.default_radius(35));
        let recipe_text = "merge of: compress --target * --effort default --seed 0 --blocks *";
        assert_eq!((&m.source[..], &m.recipe.to_string()[..]), ("snap.*", recipe_text));
        assert_eq!(
            merged_model.layers.iter().map(|l| (&l.name[..], l.content.len())).collect::<Vec<_>>(),
            [("dm", 2), ("gas", 1)]
        );
        assert_eq!(m.source_hash, blocks_hash(&crate::codec::coded_layers(&merged, "merged").unwrap()));
        // Blocks of one source keep its hash.
        let mut one = [model("dm", 3.0, 10, None), model("dm", 9.0, 20, None)];
        one[1].metadata.source_hash = one[0].metadata.source_hash;
        let [a, b] = one.each_ref().map(coded);
        let merged_hash = decode(&merge(&[&a, &b]).unwrap(), "merged").unwrap().metadata.source_hash;
        assert_eq!(merged_hash, one[0].metadata.source_hash);
    }

    #[test]
    fn unlike_models_are_refused_with_a_reason() {
        let a = model("dm", 3.0, 10, None);
        let says = |change: fn(&mut Model), text: &str| {
            let mut b = model("dm", 9.0, 20, None);
            change(&mut b);
            let error = merge(&[&coded(&a), &coded(&b)]).unwrap_err();
            assert!(matches!(error, Error::Input { .. }), "{error}");
            assert!(error.to_string().contains(text) && error.to_string().starts_with("part 1: "), "{error}");
        };
        says(|m| m.metadata.units = Units::new(Some("kpc"), None, Some(true)), "unit of length is `kpc (3.08");
        says(|m| m.metadata.units = Units::new(Some("Mpc/h"), Some("Msun"), Some(true)), "unit of mass");
        says(|m| m.metadata.units = Units::new(Some("Mpc/h"), None, None), "`comoving` is not stated");
        says(|m| m.metadata.cosmology.omega_matter = Some(0.3), "Omega_m is 0.3");
        says(|m| m.metadata.epoch.step = Some(-3), "time step is -3");
        says(|m| m.metadata.cell = None, "cell is not stated");
        says(|m| m.metadata.epoch.scale_factor = Some(0.5), "scale factor is 0.5");
        says(|m| m.metadata.epoch.time = Some(0.5), "time");
        says(|m| m.layers[0].mass = Mass::Each(2.0), "mass of 2");
        says(|m| *m = model("dm", 9.0, 20, Some(3.0)), "individual masses");
        assert!(merge(&[&coded(&a), &coded(&a)]).unwrap_err().to_string().contains("twice"));
        assert!(merge(&[]).is_err());
    }
}
