//! The particles that groups and distances are measured on: all, or those of a region of a large snapshot.
//!
//! A random sample has other groups and distances than the whole; a region that keeps all its particles has the same
//! but at its faces, which cut those drawn alike.

use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Block, LawKind, Layer, Metadata, Mixture, Model, Sample};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};
use particlegs_fit::recover::draw;
use particlegs_particles::{Domain, Particles, Selection, Storage};
use std::borrow::Cow;

/// Particles of a region, at most and but for the scatter of the positions that it is cut by.
const IN_REGION: u64 = 2 << 20;
/// Positions that a region is cut by.
const POSITIONS: usize = 1 << 18;
/// Gaussians whose means are further than so many deviations from a region have nothing in it.
const REACH: f64 = 5.0;

/// Particles, and the model of them.
pub struct ParticlesWithModel<'a> {
    /// The model, or its Gaussians that reach into the region.
    pub model: Cow<'a, Model>,
    /// All particles, or those of the region.
    pub particles: Cow<'a, Particles>,
    /// Box of the whole.
    pub domain: Domain,
    /// The mean spacing of the whole.
    pub spacing: f64,
    /// Bounds of the region and the number of its particles; `None` where it is the whole.
    pub sample: Option<Sample>,
}

impl<'a> ParticlesWithModel<'a> {
    /// The whole of at most `most` particles, else a region that `seed` chooses; `None` where that holds next to
    /// nothing.
    pub fn new(
        model: &'a Model,
        particles: &'a Particles,
        seed: u64,
        most: u64,
        context: &Context<'_>,
    ) -> Result<Option<Self>> {
        let domain = Domain::from_particles(particles);
        let (count, spacing) = (particles.len() as u64, domain.spacing(particles.len()));
        if count <= most {
            let (model, particles) = (Cow::Borrowed(model), Cow::Borrowed(particles));
            return Ok((count >= 2).then_some(ParticlesWithModel { model, particles, domain, spacing, sample: None }));
        }
        let Some((inside, bounds)) = particles_of_region(particles, &domain, seed, most, context)? else {
            return Ok(None);
        };
        let sample = Some(Sample { particles: inside.len() as u64, bounds });
        let region_domain = Domain::upright(bounds.min, bounds.extent(), [false; 3]);
        let sound = inside.len() >= 2 && region_domain.length.iter().all(|l| *l > 0.0);
        let near_model = near(model, &domain, &bounds);
        let (model, particles) = (Cow::Owned(near_model), Cow::Owned(inside));
        let scope = ParticlesWithModel { model, particles, domain: region_domain, spacing, sample };
        Ok((sound && scope.model.gaussians() > 0).then_some(scope))
    }

    /// As many particles as the model has there, drawn with `seed`; `None` where tails of Gaussians lie at the end of
    /// float32, or none are drawn.
    pub fn draw(&self, seed: u64, context: &Context<'_>) -> Result<Option<Particles>> {
        let (origin, weighted) = (self.particles.origin, self.particles.weights().is_some());
        let drawn = match draw(&self.model, seed, origin, weighted, context) {
            Err(Error::Input { .. }) => return Ok(None),
            drawn => drawn?,
        };
        let Some(sample) = self.sample else { return Ok(Some(drawn)) };
        let whole = Domain::from_model(&self.model);
        match drawn.select(cropped(&whole, sample.bounds), &Storage::Memory, context) {
            Err(Error::Argument { .. } | Error::Input { .. }) => Ok(None),
            drawn => drawn.map(Some),
        }
    }
}

/// The particles of a region of at most `most`, which `seed` chooses; `None` where there are none.
pub fn particles_of_region(
    particles: &Particles,
    domain: &Domain,
    seed: u64,
    most: u64,
    context: &Context<'_>,
) -> Result<Option<(Particles, Bounds)>> {
    let bounds = region(particles, domain, seed, most.min(IN_REGION));
    match particles.select(cropped(domain, bounds), &Storage::Memory, context) {
        // Nothing is there, or images of a box that is none.
        Err(Error::Argument { .. } | Error::Input { .. }) => Ok(None),
        inside => Ok(Some((inside?, bounds))),
    }
}

fn cropped(domain: &Domain, bounds: Bounds) -> Selection {
    Selection { crop: Some(bounds), wrap: domain.periodic.contains(&true), ..Selection::all() }
}

/// The box halved again and again across its longest edge, where half of its particles lie on either side, until no
/// more than `most` are left; bits of `seed` choose the halves.
fn region(particles: &Particles, domain: &Domain, seed: u64, most: u64) -> Bounds {
    let (n, positions) = (particles.len(), POSITIONS.min(particles.len()));
    // Particles at even steps; the product of two of their numbers may not fit into 64 bits.
    let place = |i: usize| domain.local(particles.position((i as u128 * n as u128 / positions as u128) as usize));
    let mut left: Vec<[f64; 3]> = (0..positions).map(place).collect();
    let (mut min, mut max) = ([0.0; 3], domain.length);
    // The edges of a tilted box are no axes: the region is cut out of the particles' own bounds.
    if domain.tilt.is_some() {
        let mut around = Bounds::empty();
        left.iter().for_each(|p| around.include(*p));
        (min, max) = (around.min, around.max);
    }
    let mut count = n as u64;
    let mut choice = seed;
    while count > most && left.len() > 1 {
        let axis = (0..3).fold(0, |a, k| if max[k] - min[k] > max[a] - min[a] { k } else { a });
        left.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
        let middle = left[left.len() / 2][axis];
        // Particles that all lie in one place cannot be divided.
        if !(middle > min[axis] && middle < max[axis]) {
            break;
        }
        if choice & 1 == 0 {
            max[axis] = middle;
            left.retain(|p| p[axis] < middle);
        } else {
            min[axis] = middle;
            left.retain(|p| p[axis] >= middle);
        }
        (count, choice) = (count.div_ceil(2), choice >> 1);
    }
    Bounds { min: each_axis(|k| domain.min[k] + min[k]), max: each_axis(|k| domain.min[k] + max[k]) }
}

/// The Gaussians that reach into `bounds`, around the box where that repeats.
fn near(model: &Model, domain: &Domain, bounds: &Bounds) -> Model {
    let (center, half) = (bounds.center(), bounds.extent().map(|e| 0.5 * e));
    let reaches = |m: &Mixture, i: usize| {
        let (mean, cov) = (m.mean_of(i), m.cov_of(i).0);
        let d = domain.shortest_way(each_axis(|k| mean[k] - center[k]));
        let deviation = [cov[0], cov[3], cov[5]].map(|v| v.max(0.0).sqrt());
        (0..3).all(|k| d[k].abs() <= half[k] + REACH * deviation[k])
    };
    let block = |b: &Block| {
        let g = &b.gaussians;
        let mut near_gaussians = Mixture::new(g.masses().is_some());
        (0..g.len())
            .filter(|&i| reaches(g, i))
            .for_each(|i| near_gaussians.push(g.mean_of(i), g.cov_of(i), g.count[i], g.mass_of(i)));
        let count = near_gaussians.count.iter().map(|&c| c as u64).sum();
        let mass = (0..near_gaussians.len()).map(|i| near_gaussians.mass_of(i)).sum();
        Block { bounds: b.bounds, count, mass, gaussians: near_gaussians }
    };
    let layer = |l: &Layer<Vec<Block>>| l.with(l.content.iter().map(block).filter(|b| b.count > 0).collect::<Vec<_>>());
    let layers: Vec<_> = model.layers.iter().map(layer).filter(|l| !l.content.is_empty()).collect();
    // What is drawn goes by counts and shapes alone, which all laws have.
    let mut metadata = Metadata { law: LawKind::OpticalDepth, ..model.metadata.clone() };
    metadata.count = layers.iter().map(Layer::count).sum();
    metadata.mass = layers.iter().flat_map(|l| &l.content).map(|b: &Block| b.mass).sum();
    Model { metadata, layers, certificate: None }
}
