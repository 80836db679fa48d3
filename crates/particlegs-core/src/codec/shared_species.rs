//! Layers of single species, made of Gaussians that several share (docs/format.md, section 15).

use super::sums::whole_counts;
use crate::math::{Sym3, each_axis};
use crate::model::{Block, FieldMoments, Layer, Mass, Mixture, Model, SharedSpecies};

/// Distance at most of a species' mean from a Gaussian's, in its deviations along the way.
const FARTHEST: f64 = 0.9;

/// The model with a layer for each species of those that share Gaussians, in the place of their layer.
pub(super) fn separated(mut model: Model) -> Model {
    let all = std::mem::take(&mut model.metadata.shared_species);
    let layers = std::mem::take(&mut model.layers);
    for layer in layers {
        if SharedSpecies::share_layer(&all, &layer.name) {
            model.layers.extend(species_layers(layer.content, &all));
        } else {
            model.layers.push(layer);
        }
    }
    model
}

fn species_layers(blocks: Vec<Block>, all: &[SharedSpecies]) -> Vec<Layer<Vec<Block>>> {
    let mass = |s: &SharedSpecies| Mass::new(false, s.mass);
    let mut layers: Vec<Layer<Vec<Block>>> =
        all.iter().map(|s| Layer { name: s.name.clone(), mass: mass(s), content: Vec::new() }).collect();
    for block in blocks {
        for (layer, part) in layers.iter_mut().zip(block_of_species(&block, all)) {
            layer.content.extend(Some(part).filter(|part| part.count > 0));
        }
    }
    layers.retain(|l| !l.content.is_empty());
    layers
}

/// A block for each species.
fn block_of_species(block: &Block, all: &[SharedSpecies]) -> Vec<Block> {
    let g = &block.gaussians;
    let total: f64 = all.iter().map(|s| s.count as f64).sum();
    let mut left = block.count;
    let mut blocks = Vec::with_capacity(all.len());
    for (place, species) in all.iter().enumerate() {
        let moments = g.fields.get(&species.field_name());
        // A block that lacks stages has no shares: the species' part of all particles stands for them (section 15).
        let share = |i: usize| moments.map_or(species.count as f64 / total, |f| f.mean[0][i]);
        let mut counts: Vec<f64> = (0..g.len()).map(|i| g.count[i] * share(i)).collect();
        let sum = super::sums::compensated(&counts).round() as u64;
        // The last species gets what is left, so that the counts of all sum to the block's (section 15).
        let count = if place + 1 == all.len() { left } else { sum.min(left) };
        left -= count;
        whole_counts(&mut counts, count);
        let gaussians = mixture_of_species(g, moments, &counts, all);
        blocks.push(Block { bounds: block.bounds, count, mass: count as f64, gaussians });
    }
    blocks
}

/// The particles of a species in each Gaussian, of such whole `counts`, as Gaussians.
fn mixture_of_species(g: &Mixture, shares: Option<&FieldMoments>, counts: &[f64], all: &[SharedSpecies]) -> Mixture {
    let mut out = Mixture::new(false);
    out.fields = g.fields.map(FieldMoments::emptied);
    out.fields.retain(|name| all.iter().all(|s| s.field_name() != name));
    for i in (0..g.len()).filter(|&i| counts[i] > 0.0) {
        let (mean, cov) = (g.mean_of(i), g.cov_of(i));
        let shift = shares.map_or([0.0; 3], |shares| offset(shares, i, &cov));
        // Particles weighed by a share that is linear in place have this mean and the covariance C - d d' (section 15).
        let cov = cov.add(&Sym3::outer(shift).scale(-1.0));
        out.push(each_axis(|k| mean[k] + shift[k]), cov, counts[i], 0.0);
        for (name, moments) in out.fields.iter_mut() {
            g.fields.get(name).into_iter().for_each(|all| moments.push_moved(all, i, shift));
        }
    }
    out
}

/// From the mean of a Gaussian to that of a species' particles in it.
fn offset(shares: &FieldMoments, i: usize, cov: &Sym3) -> [f64; 3] {
    let (share, slope) = (shares.mean[0][i], each_axis(|k| shares.slope[0][k][i]));
    let far = cov.quadratic(slope).max(0.0).sqrt() / share;
    if !(far > 0.0 && far.is_finite()) {
        return [0.0; 3];
    }
    // From q = 1 on C - d d' would have no positive variance along d, so d is shortened before that.
    let factor = if far > FARTHEST { FARTHEST / far } else { 1.0 };
    let along = cov.apply(slope);
    each_axis(|k| along[k] / share * factor)
}

#[cfg(test)]
mod tests {
    use crate::codec::{
        Decoder, Encoder, FieldPrecision, Precision, SHARE, StoredBlock, StoredSection, assemble, decode, decode_block,
        encode_field,
    };
    use crate::context::Context;
    use crate::math::{Random, Sym3};
    use crate::model::{
        Block, FieldMoments, LawKind, Layer, Mass, Metadata, Mixture, Model, QuantityKind, SharedSpecies,
    };
    use crate::space::Bounds;

    /// A layer of Gaussians along x that `a` and `b` share: `a` in the place of the lower ones, and of the lower part of each.
    fn file() -> Vec<u8> {
        let mut gaussians = Mixture::new(false);
        for i in 0..200 {
            let mut r = Random::new(3, 0, i);
            let mean = [i as f64 / 20.0, r.uniform(), r.uniform()];
            gaussians.push(mean, Sym3::scaled_identity(0.04), 40.0 + (60.0 * r.uniform()).floor(), 0.0);
        }
        let count = gaussians.count.iter().sum::<f64>() as u64;
        let bounds = Bounds { min: [-1.0; 3], max: [11.0; 3] };
        let coded =
            Encoder::new(&Block { bounds, count, mass: count as f64, gaussians }).unwrap().encode(&Precision::BALANCED);
        let block = decode_block(&coded, "a block").unwrap();
        let g = &block.gaussians;
        let share = |i: usize| (1.0 - 0.1 * g.mean[0][i]).clamp(0.0, 1.0);
        let mut moments = FieldMoments::new(1);
        for i in 0..g.len() {
            moments.mean[0].push(share(i));
            moments.slope[0][0].push(if share(i) > 0.0 && share(i) < 1.0 { -0.5 } else { 0.0 });
            (1..3).for_each(|k| moments.slope[0][k].push(0.0));
            moments.spread[0].push(share(i) * (1.0 - share(i)));
        }
        let of_a = (0..g.len()).map(|i| g.count[i] * share(i)).sum::<f64>().round();
        let species = |name: &str, count: f64, mass| SharedSpecies { name: name.into(), count: count as u64, mass };
        let shared_species = vec![species("a", of_a, Some(2.0)), species("b", count as f64 - of_a, None)];
        let quantity = shared_species[0].quantity();
        let bytes = encode_field((0, &quantity), &moments, g, &[of_a], &FieldPrecision::default(), None);
        let stored = StoredBlock { bytes: coded, sections: vec![StoredSection { tag: SHARE, bytes }] };
        let layer = Layer { name: "a+b".into(), mass: Mass::Unknown, content: vec![stored] };
        let metadata = Metadata { shared_species, ..Metadata::new(LawKind::OpticalDepth, count, bounds) };
        assemble(&metadata, None, vec![layer]).unwrap()
    }

    /// Particles, mean and variance along x of a layer.
    fn moments(model: &Model, layer: usize) -> [f64; 3] {
        let g = &model.layers[layer].content[0].gaussians;
        let sum = |f: &dyn Fn(usize) -> f64| (0..g.len()).map(|i| g.count[i] * f(i)).sum::<f64>();
        let n = sum(&|_| 1.0);
        let mean = sum(&|i| g.mean[0][i]) / n;
        [n, mean, sum(&|i| g.cov[0][i] + (g.mean[0][i] - mean).powi(2)) / n]
    }

    #[test]
    fn species_that_share_gaussians_have_layers_of_their_own() {
        let file = file();
        let stored = Decoder::new(&file[..], "m", &Context::SILENT).unwrap().finish_stored().unwrap();
        assert_eq!((stored.layers.len(), stored.layers[0].content[0].gaussians.fields.iter().count()), (1, 2));
        let model = decode(&file, "m").unwrap();
        let layer = |l: usize| (&model.layers[l].name[..], model.layers[l].mass, model.layers[l].count());
        let species = &stored.metadata.shared_species;
        assert_eq!(layer(0), ("a", Mass::Each(2.0), species[0].count));
        assert_eq!(layer(1), ("b", Mass::Unknown, species[1].count));
        let whole: Vec<u64> =
            model.layers.iter().map(|l| l.content[0].gaussians.count.iter().sum::<f64>() as u64).collect();
        assert_eq!(whole, [species[0].count, species[1].count]);
        let ([na, xa, va], [nb, xb, vb]) = (moments(&model, 0), moments(&model, 1));
        assert!(xa < 5.0 && xb > 5.0 && model.metadata.shared_species.is_empty());
        // Both together are as the shared Gaussians are.
        let [n, x, v] = moments(&stored, 0);
        let (xs, vs) = ((na * xa + nb * xb) / n, (na * va + nb * vb + na * nb / n * (xa - xb).powi(2)) / n);
        assert!((x - xs).abs() < 0.03 && (v / vs - 1.0).abs() < 0.02, "{x} {xs} {v} {vs}");
        assert!(model.layers.iter().all(|l| l.content[0].gaussians.fields.iter().count() == 0));
    }

    #[test]
    fn a_class_is_called_after_its_species() {
        let quantity = SharedSpecies { name: "x=1".into(), count: 1, mass: None }.quantity();
        assert_eq!((quantity.class(), quantity.kind), (Some(("species", "x=1")), QuantityKind::Category));
    }
}
