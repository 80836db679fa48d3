//! Velocity dispersions of particles about given centres.

use super::Domain;
use super::aperture::quantile;
use super::haloes::HaloPlaces;
use super::points::{PointGrid, local_positions};
use super::presentation::*;
use super::velocities::ParticleFields;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::{Error, Result, parallel};

/// Particles of both sides in a sphere that is compared, at least.
const LEAST: u64 = 10;

/// Velocity dispersions within the largest radius about centres, and those of the other over the truth's. A dispersion
/// is the rms velocity about the mean of the same particles, weighted by mass, in three dimensions.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct HaloDispersions {
    /// Centres, world units.
    #[serde(skip)]
    pub centers: Vec<[f64; 3]>,
    /// Radius about each, world units.
    #[serde(skip)]
    pub radii: Vec<f64>,
    /// Particles about each centre: truth and other.
    #[serde(skip)]
    pub particles: [Vec<u64>; 2],
    /// Dispersions about each centre, in the unit of velocities: truth and other.
    #[serde(skip)]
    pub dispersion: [Vec<f64>; 2],
    /// Number of centres.
    pub count: u64,
    /// Centres with at least ten particles of both sides, which are compared.
    pub compared: u64,
    /// Their median of other / truth.
    pub median: Option<f64>,
    /// A quarter of them are below and above these.
    pub quartiles: Option<[f64; 2]>,
}

impl HaloDispersions {
    /// Dispersion of the other over the truth's about a centre; none of too few particles or where the truth has none.
    pub fn ratio(&self, center: usize) -> Option<f64> {
        let enough = self.particles.iter().all(|n| n[center] >= LEAST);
        let [truth, other] = self.dispersion.each_ref().map(|d| d[center]);
        (enough && truth > 0.0).then(|| other / truth)
    }
}

/// Compares dispersions.
pub fn halo_dispersions(
    pair: [&ParticleFields; 2],
    domain: &Domain,
    places: &HaloPlaces<'_>,
    context: &Context<'_>,
) -> Result<HaloDispersions> {
    context.begin("velocity dispersions", 2 * places.centers.len() as u64);
    let [a, b] = pair.map(|side| about_each(side, domain, places, context));
    let ((particles_a, a), (particles_b, b)) = (a?.into_iter().unzip(), b?.into_iter().unzip());
    context.end();
    let mut dispersions = HaloDispersions {
        centers: places.centers.iter().map(|c| each_axis(|k| domain.min[k] + c[k])).collect(),
        radii: places.radii.to_vec(),
        particles: [particles_a, particles_b],
        dispersion: [a, b],
        count: places.centers.len() as u64,
        compared: 0,
        median: None,
        quartiles: None,
    };
    let mut ratios: Vec<f64> = (0..places.centers.len()).filter_map(|i| dispersions.ratio(i)).collect();
    ratios.sort_by(f64::total_cmp);
    dispersions.compared = ratios.len() as u64;
    dispersions.median = quantile(&ratios, 0.5);
    dispersions.quartiles = quantile(&ratios, 0.25).zip(quantile(&ratios, 0.75)).map(<[f64; 2]>::from);
    Ok(dispersions)
}

/// Particles and dispersion about each centre.
fn about_each(
    side: &ParticleFields,
    domain: &Domain,
    places: &HaloPlaces<'_>,
    context: &Context<'_>,
) -> Result<Vec<(u64, f64)>> {
    let points = PointGrid::new(&local_positions(&side.particles, domain), domain, places.largest())?;
    parallel::try_map_range(places.centers.len(), |center| {
        context.check()?;
        let (place, radius) = (places.centers[center], places.radii[center]);
        let mut inside = Vec::new();
        points.near(points.cell_of(place), radius, |run, shift| {
            let at: [f64; 3] = each_axis(|k| place[k] - shift[k]);
            let is_near = |i: &usize| {
                let x = points.position[*i];
                (0..3).map(|k| (x[k] - at[k]) * (x[k] - at[k])).sum::<f64>() <= radius * radius
            };
            inside.extend(run.filter(is_near).map(|i| points.index[i] as usize));
        });
        context.advance(1);
        let total: f64 = inside.iter().map(|i| side.weight(*i)).sum();
        let mean: [f64; 3] =
            each_axis(|k| inside.iter().map(|i| side.weight(*i) * side.of(*i)[k]).sum::<f64>() / total);
        let square = |i: &usize| {
            let v = side.of(*i);
            side.weight(*i) * (0..3).map(|k| (v[k] - mean[k]) * (v[k] - mean[k])).sum::<f64>()
        };
        let dispersion = if total > 0.0 { (inside.iter().map(square).sum::<f64>() / total).sqrt() } else { 0.0 };
        Ok::<_, Error>((inside.len() as u64, dispersion))
    })
}

/// Shows them.
pub(super) fn show(d: &HaloDispersions, to: &mut Presentation) {
    let row = |i: usize| {
        let ([x, y, z], [n, m], [a, b]) = (d.centers[i], &d.particles, &d.dispersion);
        row![i + 1, x, y, z, d.radii[i], n[i], m[i], a[i], b[i], maybe(d.ratio(i))]
    };
    let head = "centre,x,y,z,radius,particles_truth,particles_other,dispersion_truth,dispersion_other,ratio";
    to.table("halo_dispersion.csv", head, (0..d.radii.len()).map(row));
    to.median(&format!("haloes: dispersion, {} centres", d.compared), d.median, d.quartiles);
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;
    use particlegs_particles::testing::{from_points, random_points};

    /// Two clumps, one of them across the seam, that move as wholes; the other side is hotter by a half in the first.
    #[test]
    fn dispersions_are_about_the_mean_motion_within_the_sphere() {
        let domain = Domain::upright([5.0; 3], [10.0; 3], [true; 3]);
        let n = 4000;
        let places = random_points(2 * n, 1, |i, r| {
            let at = if i < n as u64 { [9.9, 0.05, 5.0] } else { [4.0; 3] };
            domain.local(each_axis(|k| domain.min[k] + at[k] + 0.1 * r.normal())).map(|v| v + 5.0)
        });
        let side = |sizes: [f64; 2], seed| {
            ParticleFields::of_parts(from_points(places.clone()), |i| {
                let mut r = Random::new(seed, 0, i as u64);
                [1000.0, 0.0, -300.0].map(|bulk: f64| bulk + sizes[usize::from(i >= n)] * r.normal())
            })
        };
        let (truth, other) = (side([100.0, 200.0], 3), side([150.0, 200.0], 4));
        let centers = [[9.9, 0.05, 5.0], [4.0; 3], [7.0; 3]];
        let places = HaloPlaces { centers: &centers, radii: &[1.0, 1.0, 0.5], bins: 5 };
        let dispersions = halo_dispersions([&truth, &other], &domain, &places, &Context::SILENT).unwrap();
        assert_eq!((dispersions.count, dispersions.compared, dispersions.particles[0][2]), (3, 2, 0));
        assert_eq!(&dispersions.particles[0][..2], [n as u64; 2]);
        let ratios = [dispersions.ratio(0).unwrap(), dispersions.ratio(1).unwrap()];
        assert!((ratios[0] - 1.5).abs() < 0.04 && (ratios[1] - 1.0).abs() < 0.03, "{ratios:?}");
        assert!((dispersions.dispersion[0][0] - 3f64.sqrt() * 100.0).abs() < 4.0 && dispersions.ratio(2).is_none());
        assert!((dispersions.median.unwrap() - 0.5 * (ratios[0] + ratios[1])).abs() < 1e-12);
        let still = side([0.0; 2], 1);
        let none = halo_dispersions([&still, &other], &domain, &places, &Context::SILENT).unwrap();
        assert_eq!((none.compared, none.median, none.quartiles), (0, None, None));
    }
}
