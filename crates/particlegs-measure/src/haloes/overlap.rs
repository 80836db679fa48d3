//! Each particle in one halo: where spheres overlap, the halo of more linked particles has what lies in both.

use super::find::{AboutCenter, Halo};
use super::members::LinkedHaloes;
use super::overdensity::Overdensity;
use crate::stats::PointGrid;
use particlegs_core::context::Context;
use particlegs_core::math::{Ball, each_axis};
use particlegs_core::{Result, parallel};
use std::cmp::Reverse;

/// The number of another halo, and its centre as counted from one's own.
type Neighbor = (usize, [f64; 3]);

impl AboutCenter<'_> {
    /// Ranks haloes by their linked particles. One whose centre lies within R200m of a higher one that is itself no
    /// satellite is its satellite, and stays as it is. Any other is measured again without what lies in the spheres of
    /// such higher ones.
    pub fn without_overlap(
        &self,
        mut haloes: Vec<Halo>,
        groups: &LinkedHaloes,
        context: &Context<'_>,
    ) -> Result<Vec<Halo>> {
        haloes.sort_by_key(|h| Reverse(h.members));
        haloes.iter_mut().enumerate().for_each(|(rank, h)| h.rank = rank);
        let higher = self.higher_neighbors(&haloes)?;
        // A halo waits for the round of the last higher one that it overlaps; those of one round are measured at once.
        let mut rounds = vec![0; haloes.len()];
        for (i, neighbors) in higher.iter().enumerate() {
            rounds[i] = neighbors.iter().map(|(other, _)| rounds[*other] + 1).max().unwrap_or(0);
        }
        for round in 1..=rounds.iter().copied().max().unwrap_or(0) {
            let ranks: Vec<usize> = (0..haloes.len()).filter(|i| rounds[*i] == round).collect();
            let changed = parallel::try_map(&ranks, |i| {
                context.check()?;
                self.apart(&haloes[*i], (&haloes, &higher[*i]), groups, context)
            })?;
            ranks.into_iter().zip(changed).for_each(|(i, halo)| haloes[i] = halo);
        }
        haloes.retain(Halo::is_listed);
        Ok(haloes)
    }

    /// Of each halo those of a higher rank whose spheres overlap its own.
    fn higher_neighbors(&self, haloes: &[Halo]) -> Result<Vec<Vec<Neighbor>>> {
        let centers: Vec<[f64; 3]> = haloes.iter().map(|h| h.center).collect();
        let points = PointGrid::new(&centers, self.search.domain, 0.0)?;
        let largest = haloes.iter().map(|h| h.measures.radius()).fold(0.0, f64::max);
        Ok(parallel::map_range(haloes.len(), |i| {
            let (mut neighbors, reach) = (Vec::new(), haloes[i].measures.reach());
            points.within(centers[i], reach + largest, |other, offset, square| {
                let both = reach + haloes[other].measures.radius();
                if other < i && square < both * both {
                    neighbors.push((other, offset));
                }
            });
            neighbors
        }))
    }

    /// A halo as a satellite, or without what its higher neighbours have.
    fn apart(
        &self,
        halo: &Halo,
        (haloes, neighbors): (&[Halo], &[Neighbor]),
        groups: &LinkedHaloes,
        context: &Context<'_>,
    ) -> Result<Halo> {
        let mut halo = halo.clone();
        let is_independent =
            |other: &Halo| other.parent.is_none() && other.is_listed() && other.measures.radius() > 0.0;
        let neighbors = neighbors.iter().filter(|(other, _)| is_independent(&haloes[*other]));
        let balls: Vec<(usize, Ball)> = neighbors
            .map(|(other, center)| (*other, Ball { center: *center, radius: haloes[*other].measures.radius() }))
            .collect();
        let mass =
            |other: usize| haloes[other].measures.spheres[Overdensity::Mean200 as usize].map_or(0.0, |s| s.sphere.mass);
        let around = balls.iter().filter(|(_, ball)| ball.contains([0.0; 3])).map(|(other, _)| *other);
        halo.parent = around.max_by(|a, b| mass(*a).total_cmp(&mass(*b)).then(b.cmp(a)));
        if halo.parent.is_none() && !balls.is_empty() {
            let excluded: Vec<Ball> = balls.into_iter().map(|(_, ball)| ball).collect();
            halo.measures = self.measure((halo.center, &excluded), groups.masses[halo.group], context)?;
            if !halo.is_main {
                let sphere = Ball { center: [0.0; 3], radius: halo.measures.radius() };
                let (positions, domain) = (self.search.positions, self.search.domain);
                let offset = |i: &u32| domain.shortest_way(each_axis(|k| positions[*i as usize][k] - halo.center[k]));
                let is_within = |x: &[f64; 3]| sphere.contains(*x) && !excluded.iter().any(|ball| ball.contains(*x));
                halo.members = groups.members[halo.group].iter().map(offset).filter(is_within).count();
            }
        }
        Ok(halo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haloes::{HaloCatalogue, HaloOptions, find_haloes};
    use crate::stats::{Subject, local_positions};
    use particlegs_core::math::Sym3;
    use particlegs_core::model::Model;
    use particlegs_core::space::Cell;
    use particlegs_fit::recover::Options as RecoverOptions;
    use particlegs_particles::Particles;
    use particlegs_particles::testing::model_of;

    /// A large halo with a bar along y, one beside it whose sphere overlaps, and a small one at the end of the bar.
    fn crowded() -> Model {
        let round = |x: f64, y: f64, width: f64, n: f64| ([x, y, 5.0], Sym3::scaled_identity(width * width), n);
        let bar = Sym3([0.02, 0.0, 0.0, 0.4, 0.0, 0.02]);
        model_of(
            &[
                round(5.0, 5.0, 0.1, 2000.0),
                ([5.0; 3], bar, 4500.0),
                round(6.2, 5.0, 0.1, 600.0),
                round(6.2, 5.0, 0.3, 1400.0),
                round(5.0, 5.95, 0.03, 150.0),
                round(5.0, 5.0, 3.0, 2000.0),
            ],
            [10.0; 3],
        )
    }

    fn drawn(model: &Model) -> Particles {
        let mut particles = RecoverOptions::default().draw(model.clone(), &Context::SILENT).unwrap();
        particles.meta.cell = Some(Cell::orthogonal([10.0; 3]));
        particles
    }

    fn haloes_of(source: Subject<'_>) -> HaloCatalogue {
        find_haloes(source, &HaloOptions { smallest: 60, ..HaloOptions::default() }, &Context::SILENT).unwrap()
    }

    #[test]
    fn every_particle_of_overlapping_spheres_is_in_one_halo() {
        let particles = drawn(&crowded());
        let catalogue = haloes_of(Subject::Particles(&particles));
        let column = |name: &str| catalogue.column(name).unwrap();
        assert_eq!((column("satellite"), column("parent_id")), (&[0.0; 4][..], &[-1.0, -1.0, 1.0, 1.0][..]));
        let domain = Subject::Particles(&particles).domain();
        let points = PointGrid::new(&local_positions(&particles, &domain), &domain, 0.0).unwrap();
        let mut spheres = vec![0; particles.len()];
        for (center, radius) in catalogue.centers.iter().zip(column("r200m")) {
            points.within(domain.local(*center), *radius, |i, _, _| spheres[i] += 1);
        }
        assert!(spheres.iter().filter(|n| **n > 1).count() > 100);
        let inside = spheres.iter().filter(|n| **n > 0).count();
        assert_eq!(column("n200m").iter().sum::<f64>(), inside as f64);
        // At the end of the bar, a sphere of all particles would hold a thousand of the large halo's.
        assert!(column("n200m")[2] < 1.2 * column("num_p")[2], "{:?}", column("n200m"));
        let with = |threads| parallel::with_threads(threads, || haloes_of(Subject::Particles(&particles))).unwrap();
        assert_eq!(format!("{:?}", with(1)), format!("{:?}", with(2)));
    }

    #[test]
    fn masses_of_a_model_leave_out_what_other_haloes_have() {
        let model = crowded();
        let particles = drawn(&model);
        let [truth, other] = [Subject::Particles(&particles), Subject::Model(&model)].map(haloes_of);
        for i in 0..4 {
            let [count, of_model, error] = [(&truth, "n200m"), (&other, "n200m"), (&other, "n200m_err")]
                .map(|(c, name)| c.column(name).unwrap()[i]);
            assert!((of_model - count).abs() < error, "{count} {of_model} {error}");
            assert!((of_model / count - 1.0).abs() < 0.05, "{count} {of_model}");
        }
    }
}
