//! The certificate: figures of a model that were measured after decoding it, as its file has them.

use super::cells::cell_densities;
use super::density::{GRID, density_metrics};
use super::evaluate::ModelComparison;
use super::layers::layer_ratios;
use super::match_groups::GroupTally;
use super::pictures::{pictures, scores_of};
use super::region::ParticlesWithModel;
use super::science::{linking, mass_power, numbers_agree_from, science};
use super::subset::RandomSubset;
use super::views::{SIZE, view_metrics};
use super::{MeasurementFrame, PartSums, certificate_views, check_radius, density_of};
use crate::stats::{NeighbourOptions, nearest_distances};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{
    Certificate, CertificateLevel, GROUP_CLASSES, GoalResult, GroupClass, Limit, Model, OrbitMetrics, Pictures,
    SAMPLED_ABOVE, ScienceMetrics, Spacing, Subset, ViewMetrics,
};
use particlegs_particles::{Domain, Particles, check_box};
use particlegs_reference::Reference;

/// Particles whose nearest neighbour is sought.
const NEIGHBOURS: usize = 20_000;
/// Draws that groups are matched in.
const DRAWS: u64 = 8;

/// The particles that a decoded model is measured on, and options.
#[derive(Clone, Copy)]
pub struct CertificateInput<'a> {
    /// The particles that the model was made from.
    pub particles: &'a Particles,
    /// Seed of the views and draws.
    pub seed: u64,
    /// Level that decides which figures are measured.
    pub level: CertificateLevel,
    /// Memory that the pictures of all particles may take, bytes; no figure depends on it.
    pub memory: Option<u64>,
    /// The goal that was asked for, and the figure that this model reaches.
    pub reached: Option<GoalResult>,
}

/// Scores of the pictures of a certificate.
struct PictureMetrics {
    views: ViewMetrics,
    subset: Option<Subset>,
    pictures: Option<Pictures>,
}

impl CertificateInput<'_> {
    /// Measures `model`, best the decoded one, whose file has `bytes` without a certificate: pictures (`pictures_of`),
    /// and the density on a grid of 50 cells along the longest extent, over the periodic box where there is one; what
    /// an empty picture, a uniform box and a uniform density score there; then P(k), r(k) and groups (`science`),
    /// densities in cells and distances, and where all is asked for groups matched by position. The seed turns the
    /// views and draws the particles; measuring again with the certificate's own repeats it.
    pub fn certificate(&self, model: &Model, bytes: u64, context: &Context<'_>) -> Result<Certificate> {
        let &CertificateInput { particles, seed, level, .. } = self;
        let m = &model.metadata;
        check_radius(m, seed)?;
        if level == CertificateLevel::Blocks {
            let certificate = as_one_block(model, particles, seed, context)?;
            return Ok(Certificate { goal: self.reached, ..certificate });
        }
        check_box(&particles.bounds(), particles.meta.cell.as_ref(), &particles.meta.name)?;
        let domain = Domain::from_particles(particles);
        let PictureMetrics { views, subset, pictures } = self.pictures_of(model, bytes, &domain, context)?;
        let [density, uniform] = density_of(model, particles, &m.bounds, GRID, context)?;
        let scope = ParticlesWithModel::new(model, particles, seed, SAMPLED_ABOVE, context)?;
        let first = scope.as_ref().map(|s| s.draw(seed, context)).transpose()?.flatten();
        let scope = scope.as_ref().zip(first.as_ref());
        // Spectra are of all particles: those drawn for a region say nothing of them.
        let whole = scope.and_then(|(s, first)| s.sample.is_none().then_some(first));
        let science = science(model, particles, whole, &domain, context)?;
        let (densities, drawn_densities) = cell_densities(model, (particles, whole), &domain, context)?.unzip();
        let drawn_densities = drawn_densities.flatten();
        let groups = match scope {
            Some((scope, first)) if level == CertificateLevel::Full => matched(scope, first, seed, context)?,
            _ => None,
        };
        let (numbers, groups) =
            groups.map_or((Limit::NotMeasured, None), |(numbers, classes)| (numbers, Some(classes)));
        let science = science.map(|s| ScienceMetrics { groups_within_10_percent_from: numbers, ..s });
        Ok(Certificate {
            views,
            density: density_metrics([density, uniform]),
            densities,
            drawn_densities,
            science,
            // Where wave numbers are none that a file holds, neither are these.
            mass_power: match science {
                Some(_) => mass_power(model, particles, &domain, context)?,
                None => None,
            },
            sample: scope.and_then(|s| s.0.sample),
            spacing: scope.map(|(scope, first)| spacing(scope, first, seed, context)).transpose()?,
            groups,
            held_out: None,
            subset,
            pictures,
            blocks: None,
            goal: self.reached,
            layer_ratios: layer_ratios(model, particles, &domain, context)?,
            fields: None,
        })
    }

    /// One frame of each orbit at the model's default radius and opacity; the subset of the same bytes there; where all
    /// is asked for, other radii and opacities.
    fn pictures_of(&self, model: &Model, bytes: u64, domain: &Domain, context: &Context<'_>) -> Result<PictureMetrics> {
        let m = &model.metadata;
        let truth = Reference::new(self.particles).within(self.memory.unwrap_or(u64::MAX));
        let spacing = domain.spacing(self.particles.len());
        let thinned = RandomSubset::new(&truth, spacing, bytes, self.seed, context)?;
        let whole = self.level == CertificateLevel::Full;
        let comparison = ModelComparison::new(model, &truth, thinned.as_ref().map(|t| (t, whole)));
        let evaluation = comparison.evaluate(&certificate_views(m, SIZE, self.seed), SIZE, context)?;
        let orbits = each_axis(|k| {
            let v = &evaluation.views[k];
            let [paraview, paraview_no_fxaa, expected] =
                [v.paraview, v.paraview_no_fxaa, v.expected].map(|scores| scores_of(&[scores]));
            OrbitMetrics { paraview, paraview_no_fxaa, expected }
        });
        let views = view_metrics(self.seed, orbits);
        let subset = thinned.as_ref().map(|t| Subset { kept: t.kept, bytes: t.bytes });
        let pictures = match self.level {
            CertificateLevel::Full => Some(pictures(&comparison, m, self.seed, context)?),
            _ => None,
        };
        Ok(PictureMetrics { views, subset, pictures })
    }
}

/// The certificate that is added up from blocks, of all particles as one block.
fn as_one_block(model: &Model, particles: &Particles, seed: u64, context: &Context<'_>) -> Result<Certificate> {
    let frame = MeasurementFrame::new(&model.metadata, seed);
    let read = |_: u32, section| frame.measure(section, model, particles, context);
    PartSums { frame: &frame, seed, parts: 1, fields: 0, read: &read }.certificate(context)
}

/// Distances to the nearest neighbour among the particles and among those drawn.
fn spacing(scope: &ParticlesWithModel<'_>, drawn: &Particles, seed: u64, context: &Context<'_>) -> Result<Spacing> {
    let options = NeighbourOptions { sample: NEIGHBOURS, among_sample: false, seed };
    let distances_of = |p: &Particles| {
        let d = nearest_distances(p, &scope.domain, &options, context)?;
        let regularity = if d.median > 0.0 { d.percentiles[1] / d.median } else { 0.0 };
        Ok::<_, particlegs_core::Error>((d.median, regularity))
    };
    let ((median, regularity), (drawn_median, drawn_regularity)) =
        (distances_of(&scope.particles)?, distances_of(drawn)?);
    Ok(Spacing { median, regularity, drawn_median, drawn_regularity })
}

/// Groups of the particles against those of [`DRAWS`] draws, the first of which is there: from which size on that one's
/// numbers agree, and all matched by position.
fn matched(
    scope: &ParticlesWithModel<'_>,
    first: &Particles,
    seed: u64,
    context: &Context<'_>,
) -> Result<Option<(Limit, [GroupClass; GROUP_CLASSES.len()])>> {
    let Some(linking) = linking(&scope.domain, scope.spacing) else { return Ok(None) };
    let truth = linking.groups(&scope.particles, context)?;
    let drawn_groups = linking.groups(first, context)?;
    // What is drawn of a zoom whose masses the model mixes has no finest particles.
    if truth.finest.is_some() != drawn_groups.finest.is_some() {
        return Ok(None);
    }
    let numbers = numbers_agree_from(&truth.sizes, &drawn_groups.sizes);
    let mut tally = GroupTally::default();
    tally.add(&linking, &truth, &drawn_groups)?;
    for draw in 1..DRAWS {
        let Some(particles) = scope.draw(seed.wrapping_add(draw), context)? else { return Ok(None) };
        tally.add(&linking, &truth, &linking.groups(&particles, context)?)?;
    }
    Ok(Some((numbers, tally.finish())))
}
