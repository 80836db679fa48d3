//! Mass inside fixed apertures about the centres of the truth's groups.

use super::points::PointGrid;
use super::{Domain, Groups};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::{Result, parallel};

/// A sphere shrinks by this share a step towards its densest part (Power et al. 2003).
const SHRINK: f64 = 0.9;
/// A sphere is shrunk no further than to this many particles.
const LEAST: usize = 10;

/// The centre of a group, relative to the domain's corner: the mean of its members, then of those
/// within spheres about the last centre that shrink by a tenth a step until fewer than ten are left.
pub fn group_center(positions: &[[f64; 3]], members: &[u32], domain: &Domain) -> [f64; 3] {
    let Some((first, all)) = group_offsets(positions, members, domain) else { return [0.0; 3] };
    let center = mean_place(&all);
    let radius = all.iter().map(|p| square_between(p, &center)).fold(0.0, f64::max).sqrt();
    let center = shrunk_center(all, center, radius);
    domain.local(each_axis(|k| domain.min[k] + first[k] + center[k]))
}

/// The place of a group's first member, and the offsets of all from it by the shortest way: a group is smaller than
/// half the box.
pub fn group_offsets(positions: &[[f64; 3]], members: &[u32], domain: &Domain) -> Option<([f64; 3], Vec<[f64; 3]>)> {
    let first = positions[*members.first()? as usize];
    let offset = |i: &u32| domain.shortest_way(each_axis(|k| positions[*i as usize][k] - first[k]));
    Some((first, members.iter().map(offset).collect()))
}

pub fn mean_place(x: &[[f64; 3]]) -> [f64; 3] {
    each_axis(|k| x.iter().map(|p| p[k]).sum::<f64>() / x.len().max(1) as f64)
}

fn square_between(p: &[f64; 3], c: &[f64; 3]) -> f64 {
    (0..3).map(|k| (p[k] - c[k]) * (p[k] - c[k])).sum()
}

/// The centre of the last of spheres that begin about `center` and shrink by a tenth a step, each about the mean of the
/// places in the one before.
pub fn shrunk_center(mut all: Vec<[f64; 3]>, mut center: [f64; 3], mut radius: f64) -> [f64; 3] {
    while all.len() > LEAST && radius > 0.0 {
        radius *= SHRINK;
        all.retain(|p| square_between(p, &center) <= radius * radius);
        if all.len() < LEAST {
            break;
        }
        center = mean_place(&all);
    }
    center
}

/// Particles within `radius` of each centre.
pub fn counts_within(
    positions: &[[f64; 3]],
    domain: &Domain,
    centers: &[[f64; 3]],
    radius: f64,
    context: &Context<'_>,
) -> Result<Vec<u64>> {
    let points = PointGrid::new(positions, domain, radius)?;
    parallel::try_map_range(centers.len(), |i| {
        let c = &centers[i];
        context.check()?;
        let mut count = 0;
        points.near(points.cell_of(*c), radius, |run, shift| {
            // The centre is moved once, and not every point of the run.
            let at: [f64; 3] = each_axis(|k| c[k] - shift[k]);
            let inside =
                |p: &&[f64; 3]| (0..3).map(|k| (p[k] - at[k]) * (p[k] - at[k])).sum::<f64>() <= radius * radius;
            count += points.position[run].iter().filter(inside).count() as u64;
        });
        Ok(count)
    })
}

/// The other's share of the truth's particles within a radius of group centres, for groups of a
/// range of sizes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ApertureMass {
    /// Radius, world units.
    pub radius: f64,
    /// Smallest and largest size of the groups, particles.
    pub sizes: [u64; 2],
    /// Number of groups of those sizes.
    pub groups: u64,
    /// Median of other / truth.
    pub median: Option<f64>,
    /// A quarter of the ratios are below and above these.
    pub quartiles: Option<[f64; 2]>,
    /// Sum of all over sum of all.
    pub total: Option<f64>,
}

/// Compares counts within apertures for groups of `sizes` (both ends included); one of the other's
/// particles counts `per` of the truth's. Groups without a truth particle inside are left out.
pub fn aperture_mass(
    groups: &Groups,
    truth: &[u64],
    other: &[u64],
    per: f64,
    radius: f64,
    sizes: [u64; 2],
) -> ApertureMass {
    let indices: Vec<usize> = (0..groups.members.len())
        .filter(|g| (sizes[0]..=sizes[1]).contains(&(groups.members[*g].len() as u64)) && truth[*g] > 0)
        .collect();
    let mut ratios: Vec<f64> = indices.iter().map(|g| per * other[*g] as f64 / truth[*g] as f64).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |share| quantile(&ratios, share);
    let sum = |v: &[u64]| indices.iter().map(|g| v[*g]).sum::<u64>() as f64;
    ApertureMass {
        radius,
        sizes,
        groups: indices.len() as u64,
        median: at(0.5),
        quartiles: at(0.25).zip(at(0.75)).map(<[f64; 2]>::from),
        total: (!indices.is_empty()).then(|| per * sum(other) / sum(truth)),
    }
}

/// The value that this share of rising values lies below, straight between two of them; `None` of no values.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let x = share * sorted.len().checked_sub(1)? as f64;
    let (i, f) = (x.floor() as usize, x.fract());
    Some(sorted[i] + f * (sorted[(i + 1).min(sorted.len() - 1)] - sorted[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_particles::testing::random_points;

    #[test]
    fn a_lopsided_group_across_the_seam_is_centred_on_its_core() {
        let domain = Domain::upright([5.0; 3], [10.0; 3], [true; 3]);
        let core = [9.95, 0.02, 5.0];
        let x = random_points(300, 1, |i, r| {
            let (wide, s) = if i % 3 == 0 { ([0.5, 0.0, 0.3], 0.2) } else { ([0.0; 3], 0.01) };
            domain.local(each_axis(|k| domain.min[k] + core[k] + wide[k] + s * r.normal()))
        });
        let members: Vec<u32> = (0..300).collect();
        let c = group_center(&x, &members, &domain);
        let d = domain.shortest_way(each_axis(|k| c[k] - core[k]));
        assert!(d.iter().all(|v| v.abs() < 0.01), "{c:?}");
        let n = counts_within(&x, &domain, &[c, [5.0; 3]], 0.06, &Context::SILENT).unwrap();
        assert!(n[0] >= 195 && n[0] <= 215 && n[1] == 0, "{n:?}");
    }

    #[test]
    fn medians_are_over_the_sizes_asked_for() {
        let groups = Groups { linking_length: 1.0, members: vec![vec![0; 5], vec![0; 4], vec![0; 3], vec![0; 2]] };
        let m = aperture_mass(&groups, &[10, 4, 0, 7], &[5, 4, 9, 7], 1.0, 0.1, [3, 5]);
        assert_eq!((m.groups, m.median, m.total), (2, Some(0.75), Some(9.0 / 14.0)));
        assert_eq!(aperture_mass(&groups, &[1; 4], &[1; 4], 1.0, 0.1, [9, 10]).median, None);
    }
}
