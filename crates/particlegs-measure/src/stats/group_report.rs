//! Groups of both sides by size, and the mass in their cores.

use super::aperture::{aperture_mass, counts_within, group_center};
use super::comparison_job::ComparisonJob;
use super::linking::{LinkedGroups, LinkedParticles, length_in};
use super::pairs::longest_separation;
use super::presentation::*;
use super::{ApertureMass, Groups, Measure, longest_link};
use particlegs_core::model::decimals;
use particlegs_core::{Result, parallel};

/// Sizes of groups whose cores are compared.
const CORES: [[u64; 2]; 3] = [[100, 299], [300, 999], [1000, u64::MAX]];
/// Truth groups that sizes are joined to hold before their ratio says anything: the scatter of a
/// number is its root.
pub const FEWEST_GROUPS: u64 = 100;

/// Friends-of-friends groups.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct GroupReport {
    /// Linking length of each, world units: the same share of its own mean spacing, where it is not stated.
    pub linking_length: [f64; 2],
    /// Particles that were linked: all, or the finest of a zoom.
    pub linked: [u64; 2],
    /// Groups that hold heavier particles, which were not linked.
    pub contaminated: [Option<u64>; 2],
    /// 20 to 49, 50 to 99, 100 and more.
    pub classes: Vec<SizeClass>,
    /// Sizes by a factor of the square root of 2.
    pub histogram: Vec<SizeClass>,
    /// Particles of the largest group, truth and other.
    pub largest: [u64; 2],
    /// Share of those particles in groups.
    pub grouped: [f64; 2],
    /// Mass within apertures about the truth's centres, by size of group.
    pub apertures: Vec<ApertureMass>,
}

impl ComparisonJob<'_> {
    /// The truth's groups, where they are asked for or stand for haloes' centres. `None`, and a note, in a box too
    /// thin for links of that length.
    pub fn truth_groups(&self, positions: &[[f64; 3]], notes: &mut Vec<String>) -> Result<Option<LinkedGroups>> {
        let centers =
            self.wants(&[Measure::Haloes, Measure::Dispersion]) && self.o.centers.is_none() && !positions.is_empty();
        let measured = self.wants(&[Measure::Groups]) && self.both_particles().is_some();
        if centers || measured { self.find_groups(positions, 0, notes) } else { Ok(None) }
    }

    pub fn find_groups(
        &self,
        positions: &[[f64; 3]],
        side: usize,
        notes: &mut Vec<String>,
    ) -> Result<Option<LinkedGroups>> {
        let Some(particles) = self.pair[side].particles() else { return Ok(None) };
        let linked = LinkedParticles::new(particles, positions, &self.domain);
        let length = match &self.o.linking_length {
            Some(text) => length_in(text, &self.pair[0].unit_system())?,
            None => self.o.linking * linked.spacing,
        };
        let linked_groups = linked.groups(positions, &self.domain, length, self.o.smallest_group, self.context)?;
        match &linked_groups {
            None => {
                let longest = longest_link(&self.domain);
                notes.push(format!(
                    "no groups were measured: the linking length {length:.4e} exceeds a third of the box, {longest:.4e}"
                ));
            }
            Some(LinkedGroups { groups, linked: number, contaminated: Some(contaminated) }) => notes.push(format!(
                "groups of the {} link the lightest {number} of {} particles, which are {:.4e} apart on average: \
                 {contaminated} of {} groups contain heavier particles",
                ["truth", "other"][side],
                positions.len(),
                linked.spacing,
                groups.members.len(),
            )),
            Some(_) => {}
        }
        Ok(linked_groups)
    }

    /// `None`, and a note, in a box too thin for links of the other's length.
    pub fn groups(
        &self,
        positions: [&[[f64; 3]]; 2],
        truth: &LinkedGroups,
        notes: &mut Vec<String>,
    ) -> Result<Option<GroupReport>> {
        let Some(other) = self.find_groups(positions[1], 1, notes)? else { return Ok(None) };
        let pair = [truth, &other];
        let apertures = self.apertures(positions, &truth.groups, notes)?;
        let sizes = pair.map(|f| f.groups.sizes());
        let smallest = self.o.smallest_group as u64;
        let class = |from: u64, to: Option<u64>| SizeClass::new(sizes.each_ref().map(|s| &s[..]), from, to);
        let classes = [(20, Some(49)), (50, Some(99)), (100, None)]
            .into_iter()
            .filter(|(_, to)| to.is_none_or(|t| t >= smallest))
            .map(|(from, to)| class(from.max(smallest), to))
            .collect();
        let largest = sizes.each_ref().map(|s| s.first().copied().unwrap_or(0));
        let histogram = size_histogram(sizes.each_ref().map(|s| &s[..]), smallest);
        Ok(Some(GroupReport {
            linking_length: pair.map(|f| f.groups.linking_length),
            linked: pair.map(|f| f.linked),
            contaminated: pair.map(|f| f.contaminated),
            classes,
            histogram,
            largest,
            grouped: [0, 1].map(|s| sizes[s].iter().sum::<u64>() as f64 / pair[s].linked as f64),
            apertures,
        }))
    }

    /// Shares of all particles within the aperture, other over truth, by size of the truth's group.
    /// None, and a note, where the aperture is wider than the box.
    fn apertures(
        &self,
        positions: [&[[f64; 3]]; 2],
        truth: &Groups,
        notes: &mut Vec<String>,
    ) -> Result<Vec<ApertureMass>> {
        let radius = self.o.aperture * self.spacing(0);
        let longest = longest_separation(&self.domain);
        if radius > longest {
            notes.push(format!("no core masses were measured: the aperture {radius:.4e} exceeds {longest:.4e}"));
            return Ok(Vec::new());
        }
        let large = truth.members.iter().take_while(|m| m.len() as u64 >= CORES[0][0]).count();
        let large_groups = Groups { linking_length: truth.linking_length, members: truth.members[..large].to_vec() };
        let centers = parallel::map(&large_groups.members, |m| group_center(positions[0], m, &self.domain));
        let count = |side: usize| counts_within(positions[side], &self.domain, &centers, radius, self.context);
        let (a, b) = (count(0)?, count(1)?);
        let per = positions[0].len() as f64 / positions[1].len() as f64;
        Ok(CORES.map(|sizes| aperture_mass(&large_groups, &a, &b, per, radius, sizes)).to_vec())
    }
}

/// Shows them.
pub(super) fn show(g: &GroupReport, to: &mut Presentation) {
    let row = |c: &SizeClass| row![c.from, maybe(c.to), c.groups[0], c.groups[1], maybe(c.ratio)];
    to.table("groups.csv", "from,to,groups_truth,groups_other,ratio", g.histogram.iter().map(row));
    let point_of = |c: &SizeClass| {
        // The last class has no end: it is drawn as wide as the others.
        let end = c.to.map_or(c.from as f64 * std::f64::consts::SQRT_2, |t| (t + 1) as f64);
        ((c.from as f64 * end).sqrt(), c.groups.map(|n| n as f64))
    };
    let rows: Vec<_> = g.histogram.iter().map(point_of).collect();
    let axes = [log("particles in a group"), log("groups per bin")];
    to.plot(compared("groups", "Friends-of-friends groups by size", axes, &rows, 0.0));
    for c in &g.classes {
        let ratio = c.ratio.map_or(String::new(), |r| format!(" ({:+.1} %)", 100.0 * (r - 1.0)));
        to.line(
            &format!("groups of {} particles", sizes(c.from, c.to)),
            format!("{}, truth {}{ratio}", c.groups[1], c.groups[0]),
        );
    }
    for a in g.apertures.iter().filter(|a| a.groups > 0) {
        let sizes = sizes(a.sizes[0], Some(a.sizes[1]).filter(|to| *to < u64::MAX));
        let median = a.median.map_or("-".into(), |m| format!("{m:.3}"));
        let value = format!("{median} of the truth (median, radius {}{})", decimals(a.radius), to.length);
        to.line(&format!("core mass, groups of {sizes}"), value);
    }
}

fn sizes(from: u64, to: Option<u64>) -> String {
    to.map_or(format!("{from} and more"), |to| format!("{from} to {to}"))
}

/// Groups of a range of sizes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SizeClass {
    /// Smallest size, particles.
    pub from: u64,
    /// Largest size; `None` = no end.
    pub to: Option<u64>,
    /// Number of groups of those sizes, truth and other.
    pub groups: [u64; 2],
    /// Groups of the other over those of the truth.
    pub ratio: Option<f64>,
}

impl SizeClass {
    /// Counts the groups of `from` to `to` particles. `sizes` are the truth's and the other's.
    pub fn new(sizes: [&[u64]; 2], from: u64, to: Option<u64>) -> Self {
        let within = |n: &&u64| **n >= from && to.is_none_or(|t| **n <= t);
        let groups = sizes.map(|s| s.iter().filter(within).count() as u64);
        SizeClass { from, to, groups, ratio: (groups[0] > 0).then(|| groups[1] as f64 / groups[0] as f64) }
    }
}

/// Classes that grow by a factor of the square root of 2 from `smallest` to the largest group of
/// both. `sizes` descend.
pub fn size_histogram(sizes: [&[u64]; 2], smallest: u64) -> Vec<SizeClass> {
    let largest = sizes.iter().filter_map(|s| s.first()).copied().max().unwrap_or(0);
    let mut bounds: Vec<u64> = (0..)
        .map(|i| (smallest as f64 * libm::pow(2f64, 0.5 * f64::from(i))).round() as u64)
        .take_while(|b| *b <= largest)
        .collect();
    bounds.dedup();
    (0..bounds.len()).map(|i| SizeClass::new(sizes, bounds[i], bounds.get(i + 1).map(|b| b - 1))).collect()
}

/// Classes joined, from the largest sizes down, until they hold 100 of the truth's groups: the smallest size of each
/// and its groups, and what is left at the small end.
fn joined(histogram: &[SizeClass]) -> (Vec<(u64, [u64; 2])>, [u64; 2]) {
    let (mut classes, mut sum) = (Vec::new(), [0; 2]);
    for class in histogram.iter().rev() {
        (0..2).for_each(|side| sum[side] += class.groups[side]);
        if sum[0] >= FEWEST_GROUPS {
            classes.push((class.from, std::mem::take(&mut sum)));
        }
    }
    (classes, sum)
}

/// The smallest size from which on the number of groups is within `limit` of the truth's in every
/// class. Classes are joined, from the largest sizes down, until they hold 100 of the truth's groups;
/// what is left at the small end is not judged. `Some(None)` = not even in the largest, `None` = there
/// are not enough groups.
pub fn sizes_within(histogram: &[SizeClass], limit: f64) -> Option<Option<u64>> {
    let (classes, _) = joined(histogram);
    let good = |c: &&(u64, [u64; 2])| (c.1[1] as f64 / c.1[0] as f64 - 1.0).abs() <= limit;
    let last = classes.iter().take_while(good).last().map(|c| c.0);
    (!classes.is_empty()).then_some(last)
}

/// The largest deviation of the number of groups from the truth's in any class: classes joined as for [`sizes_within`],
/// and what is left at the small end with the last of them, so that none is left out. The other's groups are of so many
/// `draws`. `None` = there are not enough groups.
pub fn largest_deviation_of_numbers(histogram: &[SizeClass], draws: u64) -> Option<f64> {
    let (mut classes, left) = joined(histogram);
    let last = classes.last_mut()?;
    (0..2).for_each(|side| last.1[side] += left[side]);
    let deviation = |g: &[u64; 2]| (g[1] as f64 / (draws * g[0]) as f64 - 1.0).abs();
    classes.iter().map(|c| deviation(&c.1)).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_is_in_one_class() {
        let (a, b) = ([100u64, 41, 40, 28, 27, 20], [57u64, 56, 20]);
        let classes = size_histogram([&a, &b], 20);
        assert_eq!(classes.iter().map(|c| c.from).collect::<Vec<_>>(), [20, 28, 40, 57, 80]);
        assert_eq!(classes.iter().map(|c| c.groups).collect::<Vec<_>>(), [[2, 1], [1, 0], [2, 1], [0, 1], [1, 0]]);
        assert_eq!((classes[4].to, classes[3].ratio, classes[0].ratio), (None, None, Some(0.5)));
        assert!(size_histogram([&[], &[]], 20).is_empty());
    }

    #[test]
    fn small_classes_are_joined_before_they_are_judged() {
        let class =
            |from: u64, truth: u64, other: u64| SizeClass { from, to: None, groups: [truth, other], ratio: None };
        let few = class(400, 50, 30);
        let (good, bad) = (class(200, 100, 109), class(100, 100, 89));
        // 139 of 150, then 89 of 100.
        assert_eq!(sizes_within(&[bad, good, few], 0.1), Some(Some(200)));
        assert_eq!(sizes_within(&[class(20, 900, 900), bad, good], 0.1), Some(Some(200)));
        assert_eq!(sizes_within(&[class(20, 900, 900), bad], 0.1), Some(None));
        assert_eq!(sizes_within(&[class(20, 60, 0), class(50, 500, 500), good], 0.1), Some(Some(50)));
        assert_eq!((sizes_within(&[few], 0.1), sizes_within(&[], 0.1)), (None, None));
        // 139 of 150 and 89 of 100; of two draws 139 of 300; what is left joins the last class.
        let largest = |classes: &[SizeClass], draws| largest_deviation_of_numbers(classes, draws);
        assert!((largest(&[bad, good, few], 1).unwrap() - 0.11).abs() < 1e-12);
        assert!((largest(&[good, few], 2).unwrap() - (1.0 - 139.0 / 300.0)).abs() < 1e-12);
        assert!((largest(&[class(20, 50, 0), good, few], 1).unwrap() - (1.0 - 139.0 / 200.0)).abs() < 1e-12);
        assert_eq!(largest(&[few], 1), None);
    }
}
