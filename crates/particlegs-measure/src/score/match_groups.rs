//! Groups of particles drawn from a model, matched by position with those of the truth: equal numbers are not equal
//! haloes.

use crate::stats::{Groups, LinkedParticles, counterparts, group_center, local_positions};
use particlegs_core::context::Context;
use particlegs_core::model::{GROUP_CLASSES, GroupClass};
use particlegs_core::{Result, parallel};
use particlegs_particles::{Domain, Particles};

/// Groups found in one set of particles, the largest first.
pub(super) struct GroupCatalogue {
    pub(super) sizes: Vec<u64>,
    /// Centre of each, relative to the domain's corner.
    centers: Vec<[f64; 3]>,
    /// Mean spacing of the finest particles of a zoom, where these alone were linked.
    pub(super) finest: Option<f64>,
}

#[derive(Clone, Copy)]
pub(super) struct GroupFinder<'a> {
    pub domain: &'a Domain,
    /// Linking length, world units.
    pub length: f64,
    /// Mean spacing, world units.
    pub spacing: f64,
}

impl GroupFinder<'_> {
    /// The groups of the smallest class and above.
    pub fn groups(&self, particles: &Particles, context: &Context<'_>) -> Result<GroupCatalogue> {
        let positions = local_positions(particles, self.domain);
        let (groups, finest) = self.linked(particles, &positions, context)?;
        let center = |i: usize| group_center(&positions, &groups.members[i], self.domain);
        Ok(GroupCatalogue { sizes: groups.sizes(), centers: parallel::map_range(groups.members.len(), center), finest })
    }

    /// Particles of each group of the smallest class and above, descending.
    pub fn sizes(&self, particles: &Particles, context: &Context<'_>) -> Result<Vec<u64>> {
        Ok(self.linked(particles, &local_positions(particles, self.domain), context)?.0.sizes())
    }

    /// The groups, and the mean spacing of the finest particles of a zoom, which links follow.
    fn linked(
        &self,
        particles: &Particles,
        positions: &[[f64; 3]],
        context: &Context<'_>,
    ) -> Result<(Groups, Option<f64>)> {
        let linked = LinkedParticles::new(particles, positions, self.domain);
        let finest = linked.index().map(|_| linked.spacing);
        let length = finest.map_or(self.length, |spacing| self.length / self.spacing * spacing);
        let linked_groups = linked.groups(positions, self.domain, length, GROUP_CLASSES[0] as usize, context)?;
        Ok((linked_groups.map_or_else(|| Groups { linking_length: length, members: Vec::new() }, |f| f.groups), finest))
    }

    /// The radius within which a counterpart of a group of `size` particles may lie: that of a sphere which has 200
    /// times the mean density.
    fn radius(&self, size: u64, truth: &GroupCatalogue) -> f64 {
        truth.finest.unwrap_or(self.spacing) * libm::cbrt(3.0 * size as f64 / (4.0 * std::f64::consts::PI * 200.0))
    }

    /// The counterpart of each group of `truth` among `drawn`: from the largest on the nearest that is left within the
    /// group's radius.
    fn counterparts(&self, truth: &GroupCatalogue, drawn: &GroupCatalogue) -> Result<Vec<Option<usize>>> {
        if truth.sizes.is_empty() || drawn.sizes.is_empty() {
            return Ok(vec![None; truth.sizes.len()]);
        }
        let spheres = truth.centers.iter().zip(&truth.sizes).map(|(c, size)| (*c, self.radius(*size, truth)));
        counterparts(spheres, &drawn.centers, self.domain, |_, _| true)
    }
}

/// Sums over draws for each class.
#[derive(Default)]
pub(super) struct GroupTally {
    classes: [GroupClassSums; GROUP_CLASSES.len()],
}

#[derive(Default)]
struct GroupClassSums {
    groups: u64,
    /// Groups of each draw.
    numbers: Vec<f64>,
    matched: u64,
    sought: u64,
    pure: u64,
    drawn: u64,
    masses: Vec<f64>,
}

fn class_of(size: u64) -> usize {
    GROUP_CLASSES.iter().rposition(|&from| size >= from).unwrap_or(0)
}

impl GroupTally {
    /// Takes in one draw.
    pub fn add(&mut self, linking: &GroupFinder<'_>, truth: &GroupCatalogue, drawn: &GroupCatalogue) -> Result<()> {
        let counterparts = linking.counterparts(truth, drawn)?;
        for class in &mut self.classes {
            // Every draw meets the same groups of the truth: their number is not added up.
            class.groups = 0;
            class.numbers.push(0.0);
        }
        for (size, other) in truth.sizes.iter().zip(&counterparts) {
            let class = &mut self.classes[class_of(*size)];
            class.groups += 1;
            class.sought += 1;
            if let Some(other) = other {
                class.matched += 1;
                class.masses.push(drawn.sizes[*other] as f64 / *size as f64);
            }
        }
        let mut counterpart_flags = vec![false; drawn.sizes.len()];
        counterparts.into_iter().flatten().for_each(|i| counterpart_flags[i] = true);
        for (size, is_counterpart) in drawn.sizes.iter().zip(counterpart_flags) {
            let class = &mut self.classes[class_of(*size)];
            if let Some(n) = class.numbers.last_mut() {
                *n += 1.0;
            }
            class.drawn += 1;
            class.pure += u64::from(is_counterpart);
        }
        Ok(())
    }

    pub fn finish(self) -> [GroupClass; GROUP_CLASSES.len()] {
        self.classes.map(GroupClassSums::finish)
    }
}

impl GroupClassSums {
    fn finish(mut self) -> GroupClass {
        let share = |part: u64, whole: u64| (whole > 0).then(|| part as f64 / whole as f64);
        let draws = self.numbers.len().max(1) as f64;
        let mean = self.numbers.iter().sum::<f64>() / draws;
        let variance = self.numbers.iter().map(|n| (n - mean) * (n - mean)).sum::<f64>() / (draws - 1.0).max(1.0);
        let groups = self.groups as f64;
        self.masses.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| self.masses.get((share * (self.masses.len() as f64 - 1.0)).round() as usize).copied();
        GroupClass {
            groups: self.groups,
            number: (self.groups > 0).then(|| mean / groups),
            number_scatter: if self.groups > 0 { variance.sqrt() / groups } else { 0.0 },
            completeness: share(self.matched, self.sought),
            purity: share(self.pure, self.drawn),
            mass: at(0.5),
            mass_scatter: at(0.84).zip(at(0.16)).map_or(0.0, |(high, low)| 0.5 * (high - low)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catalogue(groups: &[([f64; 3], u64)]) -> GroupCatalogue {
        let (sizes, centers) = (groups.iter().map(|g| g.1).collect(), groups.iter().map(|g| g.0).collect());
        GroupCatalogue { sizes, centers, finest: None }
    }

    #[test]
    fn counterparts_are_near_and_taken_once() {
        let domain = Domain::upright([0.0; 3], [10.0; 3], [true; 3]);
        let linking = GroupFinder { domain: &domain, length: 0.2, spacing: 1.0 };
        let truth = catalogue(&[([9.95, 5.0, 5.0], 400), ([5.0; 3], 120), ([5.2, 5.0, 5.0], 30), ([1.0; 3], 25)]);
        // The first lies across the edge of the box; the second's is nearer to the third than its own.
        let drawn = catalogue(&[([0.1, 5.0, 5.0], 380), ([5.1, 5.0, 5.0], 150), ([3.0; 3], 60)]);
        let mut tally = GroupTally::default();
        tally.add(&linking, &truth, &drawn).unwrap();
        tally.add(&linking, &truth, &drawn).unwrap();
        let [small, middle, large] = tally.finish();
        assert_eq!((small.groups, small.completeness, small.number, small.purity), (2, Some(0.0), Some(0.0), None));
        assert_eq!((middle.groups, middle.number, middle.purity), (0, None, Some(0.0)));
        assert_eq!((large.groups, large.completeness, large.purity), (2, Some(1.0), Some(1.0)));
        assert_eq!((large.number, large.number_scatter, large.mass), (Some(1.0), 0.0, Some(1.25)));
    }
}
