//! Ratios of the masses of layers, from cell to cell. Species of one distribution have one ratio everywhere, but for
//! the noise of their sampling; a model fits each by Gaussians of its own, and its ratio has their scatter.

use super::cells::Masses;
use crate::stats::{Assignment, Grid, Subject, deposit, deposit_steps};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{LayerRatio, LayerRatios, Model};
use particlegs_particles::{Domain, Particles};

/// Edge of the smallest cells in mean spacings: 64 particles in a cell on average.
const SMALLEST: f64 = 4.0;
/// Cells along the longest edge at most: 70 MB of two layers.
const MOST_CELLS: f64 = 128.0;
/// Particles of both layers in a cell that is compared: of fewer the noise of a logarithm is no Gaussian's.
const ENOUGH: f64 = 20.0;
/// Cells that make a comparison.
const LEAST_CELLS: u32 = 64;
/// Cells that lack a layer altogether are off by a factor of ten.
const MOST_ERROR: f64 = 1.0;

/// The ratios of each further layer to the first, in cells of the size at which the error is largest for the noise;
/// `None` of one layer.
pub(super) fn layer_ratios(
    model: &Model,
    particles: &Particles,
    domain: &Domain,
    context: &Context<'_>,
) -> Result<Option<LayerRatios>> {
    let Some(mut ratios) = LayerRatios::new(model.layers.len()) else { return Ok(None) };
    let edge = (SMALLEST * domain.spacing(particles.len())).max(domain.longest() / MOST_CELLS);
    if !edge.is_normal() {
        return Ok(Some(ratios));
    }
    let grid = Grid::stretched(domain, each_axis(|k| (domain.length[k] / edge).round().max(1.0) as usize));
    let Some(first) = LayerNumbers::new(model, 0, particles, &grid, context)? else { return Ok(Some(ratios)) };
    for (ratio, place) in ratios.to_first.iter_mut().flatten().zip(1..) {
        if let Some(other) = LayerNumbers::new(model, place, particles, &grid, context)? {
            *ratio = largest([&first, &other], grid.side.into_iter().fold(0.0, f64::max));
        }
    }
    Ok(Some(ratios))
}

/// A layer's particles in cells, and the model's: as numbers of equal particles that have as much noise.
struct LayerNumbers {
    truth: Masses,
    model: Masses,
}

impl LayerNumbers {
    /// `None` where the particles have no such layer.
    fn new(
        model: &Model,
        place: usize,
        particles: &Particles,
        grid: &Grid,
        context: &Context<'_>,
    ) -> Result<Option<LayerNumbers>> {
        let layer = &model.layers[place];
        let Some(particle_layer) = particles.layers().iter().find(|l| l.name == layer.name) else { return Ok(None) };
        let layer_particles = particles.of_layer(particle_layer);
        let alone = Model { layers: vec![layer.clone()], certificate: None, metadata: model.metadata.clone() };
        let pair = [Subject::Particles(&layer_particles), Subject::Model(&alone)];
        context.begin("layers in cells", pair.map(|subject| deposit_steps(subject, grid)).iter().sum());
        let unit = layer_particles.meta.particle_mass.unwrap_or(1.0);
        // As many equal particles have as much noise: (sum w)^2 / sum w^2.
        let (sum, squares) = layer_particles.weights().map_or((1.0, 1.0), |weights| {
            weights.iter().map(|w| f64::from(*w)).fold((0.0, 0.0), |(sum, squares), w| (sum + w, squares + w * w))
        });
        let masses_of = |subject| -> Result<Masses> {
            let mut masses = Masses::from_field(deposit(subject, grid, Assignment::Ngp, 0.0, context)?);
            masses.mass.iter_mut().for_each(|m| *m *= sum / (squares * unit));
            Ok(masses)
        };
        let [truth, model] = [masses_of(pair[0])?, masses_of(pair[1])?];
        context.end();
        Ok(Some(LayerNumbers { truth, model }))
    }

    fn coarser(&self) -> LayerNumbers {
        LayerNumbers { truth: self.truth.coarser(), model: self.model.coarser() }
    }
}

/// At the size of cells where the error is the largest multiple of the noise; `edge` is that of the given ones.
fn largest(pair: [&LayerNumbers; 2], edge: f64) -> LayerRatio {
    let at_least = |r: &LayerRatio| if r.cells < LEAST_CELLS { 0.0 } else { r.error / r.noise };
    let mut largest_ratio = compared(pair, edge);
    let (mut coarse, mut edge) = (pair.map(LayerNumbers::coarser), 2.0 * edge);
    while coarse[0].truth.mass.len() >= LEAST_CELLS as usize {
        let ratio = compared(coarse.each_ref(), edge);
        if at_least(&ratio) > at_least(&largest_ratio) {
            largest_ratio = ratio;
        }
        (coarse, edge) = (coarse.each_ref().map(|numbers| numbers.coarser()), 2.0 * edge);
    }
    if largest_ratio.cells < LEAST_CELLS { LayerRatio::default() } else { largest_ratio }
}

fn compared([a, b]: [&LayerNumbers; 2], edge: f64) -> LayerRatio {
    let (mut cells, mut sums) = (0u32, [0.0; 6]);
    for i in 0..a.truth.mass.len() {
        let [of_a, of_b] = [a.truth.mass[i], b.truth.mass[i]];
        if of_a < ENOUGH || of_b < ENOUGH {
            continue;
        }
        let truth = libm::log10(of_b / of_a);
        // A cell in which the model has neither layer has no ratio: it counts as off by the most.
        let modelled = libm::log10((b.model.mass[i] / a.model.mass[i]).clamp(f64::MIN_POSITIVE, f64::MAX));
        let error = if modelled.is_nan() { MOST_ERROR } else { (modelled - truth).clamp(-MOST_ERROR, MOST_ERROR) };
        // To first order, the natural logarithm of a number n of particles has the variance 1 / n.
        let (modelled, noise) = (truth + error, std::f64::consts::LOG10_E.powi(2) * (1.0 / of_a + 1.0 / of_b));
        let all = [modelled, modelled * modelled, truth, truth * truth, error * error, noise];
        sums.iter_mut().zip(all).for_each(|(sum, v)| *sum += v);
        cells += 1;
    }
    let [modelled, modelled_2, truth, truth_2, error, noise] = sums.map(|sum| sum / f64::from(cells.max(1)));
    let deviation = |mean: f64, square: f64| (square - mean * mean).max(0.0).sqrt();
    LayerRatio {
        edge,
        cells,
        scatter: deviation(modelled, modelled_2),
        particles_scatter: deviation(truth, truth_2),
        error: error.sqrt(),
        noise: noise.sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Sym3;
    use particlegs_core::model::{Layer, Mass};
    use particlegs_core::space::Cell;
    use particlegs_particles::Column;
    use particlegs_particles::testing::{model_of, poisson};

    const LENGTH: f64 = 8.0;
    const EACH: usize = 60_000;

    /// Two species spread evenly at random, the second five times as heavy.
    fn particles() -> Particles {
        let mut particles = poisson(2 * EACH, [LENGTH; 3], 7);
        particles.meta.cell = Some(Cell::orthogonal([LENGTH; 3]));
        let layer = |name: &str, content, mass| Layer { name: name.into(), mass: Mass::Each(mass), content };
        particles.with_layers(vec![layer("PartType0", 0..EACH, 1.0), layer("PartType1", EACH..2 * EACH, 5.0)])
    }

    /// Each species as an even density, the first with more particles in one half of the box.
    fn model(lumps: f64) -> Model {
        let layer = |name: &str, mass, lumps: f64| {
            let place = |i: usize| [i / 16, i / 4 % 4, i % 4].map(|k| (k as f64 + 0.5) * LENGTH / 4.0);
            let share = |i: usize| 1.0 + if i < 32 { lumps } else { -lumps };
            let even = (0..64).map(|i| (place(i), Sym3::scaled_identity(1.0), EACH as f64 / 64.0 * share(i)));
            let mut model = model_of(&even.collect::<Vec<_>>(), [LENGTH; 3]);
            Layer { name: name.into(), mass: Mass::Each(mass), content: model.layers.remove(0).content }
        };
        let layers = vec![layer("PartType0", 1.0, lumps), layer("PartType1", 5.0, 0.0)];
        Model { layers, ..model_of(&[], [LENGTH; 3]) }
    }

    fn measured(model: &Model, particles: &Particles) -> LayerRatio {
        let domain = Domain::from_particles(particles);
        layer_ratios(model, particles, &domain, &Context::SILENT).unwrap().unwrap().to_first[0].unwrap()
    }

    #[test]
    fn species_of_one_distribution_differ_by_the_noise_of_their_sampling() {
        let particles = particles();
        let even = measured(&model(0.0), &particles);
        assert!(!even.stands_out() && even.scatter < 0.2 * even.noise, "{even:?}");
        assert!((even.particles_scatter / even.noise - 1.0).abs() < 0.25, "{even:?}");
        assert!((even.error / even.noise - 1.0).abs() < 0.25, "{even:?}");
        let lumpy = measured(&model(0.9), &particles);
        assert!(lumpy.stands_out() && lumpy.scatter > lumpy.particles_scatter, "{lumpy:?}");
    }

    /// Masses that differ have more noise, and are not taken for a difference.
    #[test]
    fn unequal_masses_count_as_fewer_particles() {
        let equal = particles();
        let weights = (0..2 * EACH).map(|i| if i % 10 == 0 { 91.0 } else { 1.0 }).collect();
        let layers = equal
            .layers()
            .iter()
            .map(|l| Layer { mass: Mass::Weights(l.mass.unit().map(|m| 0.1 * m)), ..l.clone() })
            .collect();
        let unequal = equal.clone().with_weights(Column::owned(weights)).with_layers(layers);
        let [few, many] = [&unequal, &equal].map(|particles| measured(&model(0.0), particles));
        assert!(few.noise / few.edge.powf(-1.5) > 2.0 * many.noise / many.edge.powf(-1.5), "{few:?} {many:?}");
        assert!(!few.stands_out() && (few.particles_scatter / few.noise - 1.0).abs() < 0.3, "{few:?}");
    }

    #[test]
    fn what_cannot_be_compared_is_said_so() {
        let particles = particles();
        let domain = Domain::from_particles(&particles);
        let one = Model { layers: model(0.0).layers[..1].to_vec(), ..model(0.0) };
        assert!(layer_ratios(&one, &particles, &domain, &Context::SILENT).unwrap().is_none());
        let few = particles
            .select(
                particlegs_particles::Selection { every: 1000, ..particlegs_particles::Selection::all() },
                &particlegs_particles::Storage::Memory,
                &Context::SILENT,
            )
            .unwrap();
        let none = measured(&model(0.0), &few);
        assert!(none == LayerRatio::default() && !none.stands_out(), "{none:?}");
    }
}
