//! The two subjects that are compared, in one box that holds both, and the options.

use super::points::local_positions;
use super::{Convention, Domain, Measure, StatsOptions, Subject};
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, Result};
use particlegs_particles::{Particles, check_box, check_particles};

/// Boxes whose lengths differ by no more than this share are of one size.
const SAME: f64 = 1e-5;

pub(super) struct ComparisonJob<'a> {
    pub pair: [Subject<'a>; 2],
    pub domain: Domain,
    pub o: &'a StatsOptions,
    pub context: &'a Context<'a>,
}

impl ComparisonJob<'_> {
    pub fn paper(&self) -> bool {
        self.o.convention == Convention::Paper
    }

    /// Mean spacing of one side.
    pub fn spacing(&self, side: usize) -> f64 {
        self.domain.spacing(self.pair[side].count() as usize)
    }

    /// Particles of the larger side; 0 of a model.
    pub fn most_particles(&self) -> u64 {
        self.pair.iter().filter_map(|s| s.particles()).map(|p| p.len() as u64).max().unwrap_or(0)
    }

    pub fn notes(&self) -> Vec<String> {
        let mut notes = vec![];
        if self.wants(&[Measure::Spectrum, Measure::Momentum]) && self.domain.periodic.contains(&false) && !self.paper()
        {
            notes.push("some axes are not periodic, but P(k) treats them as periodic".into());
        }
        let bounds = self.pair[0].bounds();
        for k in (0..3).filter(|k| bounds.extent()[*k] == 0.0 && bounds.extent() != [0.0; 3]) {
            let (axis, length) = (["x", "y", "z"][k], self.domain.length[k]);
            notes.push(format!(
                "all particles have the same {axis}: volumes, spacing and g(r) assume a box {length:.4e} thick there"
            ));
        }
        if self.wants(&[Measure::Density, Measure::Profile]) && self.domain.tilt.is_some() {
            notes.push("the box is tilted: cells, slices and profiles follow the edges of its reduced cell".into());
        }
        if self.pair.iter().any(|s| s.particles().is_some_and(|p| p.weights().is_some())) {
            notes.push("pairs, groups, neighbours and g(r) count particles and ignore their weights".into());
        }
        let gridded = self.wants(&[Measure::Density, Measure::Spectrum]);
        if gridded && self.pair.iter().any(|s| s.particles().is_none()) {
            notes.push(
                "the model's density is its mixture, integrated over the cells (NGP window, no shot noise)".into(),
            );
        }
        let alpha = |s: &Subject<'_>| matches!(s, Subject::Model(m) if m.metadata.law == LawKind::AlphaBlend);
        if self.pair.iter().any(alpha) {
            notes.push(
                "the density of an alpha-blend model follows its opacities, which were fitted to pictures".into(),
            );
        }
        if self.paper() {
            notes.push(
                "the published convention uses NGP on a grid stretched over the bounds, one box length for k, no \
                 correction for shot noise or window, and neighbours in a random subset"
                    .into(),
            );
        }
        notes
    }

    /// The particles, where both sides are some.
    pub fn both_particles(&self) -> Option<[&Particles; 2]> {
        let [truth, other] = self.pair.map(|s| s.particles());
        Some([truth?, other?])
    }

    pub fn wants(&self, measures: &[Measure]) -> bool {
        measures.iter().any(|m| self.o.measures.contains(m))
    }

    /// Positions of either side, where it has any and something is measured of them.
    pub fn positions(&self) -> Result<[Vec<[f64; 3]>; 2]> {
        let of_pairs = self.both_particles().is_some() && self.wants(&[Measure::Pairs, Measure::Groups, Measure::Rdf]);
        let needed = of_pairs || self.wants(&[Measure::Haloes, Measure::Dispersion]);
        let particles = self.pair.map(|s| s.particles().filter(|_| needed));
        let bytes = particles.iter().flatten().map(|p| 24 * p.len() as u64).sum();
        particlegs_files::memory::require("positions", bytes)?;
        Ok(particles.map(|p| p.map_or(Vec::new(), |p| local_positions(p, &self.domain))))
    }
}

/// Refuses subjects that their boxes do not hold and boxes of different sizes; notes for a reader of the results.
pub(super) fn check_boxes(pair: [Subject<'_>; 2]) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    for subject in pair {
        let at = BoxPlacement::new(subject);
        match subject {
            Subject::Particles(p) => notes.extend(check_particles(p, &at.bounds)?),
            Subject::Model(_) => check_box(&at.bounds, at.cell, at.name)?,
        }
    }
    let [truth, other] = pair.map(BoxPlacement::new);
    match (truth.repeating(), other.repeating()) {
        (Some(a), Some(b)) => same_box(&a, &b, other.name)?,
        (Some(_), None) => {
            check_box(&other.bounds, truth.cell, other.name)?;
            notes.push("the other input states no periodic box, so the truth's box is used".into());
        }
        (None, Some(_)) => notes.push("the truth states no periodic box, so the other input's box is ignored".into()),
        (None, None) => {}
    }
    Ok(notes)
}

/// The box and the bounds of a subject, and its name in errors.
struct BoxPlacement<'a> {
    name: &'a str,
    bounds: Bounds,
    cell: Option<&'a Cell>,
}

impl<'a> BoxPlacement<'a> {
    fn new(subject: Subject<'a>) -> Self {
        match subject {
            Subject::Particles(p) => {
                let m = &p.meta;
                BoxPlacement { name: &m.name, bounds: p.bounds(), cell: m.cell.as_ref() }
            }
            Subject::Model(model) => {
                let m = &model.metadata;
                BoxPlacement { name: &m.source, bounds: m.bounds, cell: m.cell.as_ref() }
            }
        }
    }

    /// A box that repeats along some edge, reduced.
    fn repeating(&self) -> Option<Cell> {
        self.cell.map(Cell::reduced).filter(|c| c.periodic.contains(&true))
    }
}

fn same_box(truth: &Cell, other: &Cell, name: &str) -> Result<()> {
    let same = match (truth.lengths(), other.lengths()) {
        (Some(a), Some(b)) => {
            // Along an open edge the length of a box says nothing.
            let both = |k: usize| truth.periodic[k] && other.periodic[k];
            (0..3).all(|k| !both(k) || (a[k] - b[k]).abs() <= SAME * a[k].max(b[k]))
        }
        _ => truth.same_lattice(other, SAME),
    };
    if same {
        return Ok(());
    }
    let message = format!("its box is {other}, but the truth's box is {truth}, so they cannot be compared");
    Err(Error::input_with(name, message, "compare snapshots with the same box and the same unit of length"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::model::Units;
    use particlegs_particles::{Particles, SnapshotMeta};

    fn points(to: f32, cell: Option<[f64; 3]>, unit: &str) -> Particles {
        let column = || vec![0.0, 0.5 * to, to];
        let mut p = Particles::from_columns(column(), column(), column());
        let cell = cell.map(Cell::orthogonal);
        p.meta = SnapshotMeta {
            name: "p".into(),
            cell,
            units: Units::new(Some(unit), None, None),
            ..SnapshotMeta::default()
        };
        p
    }

    fn checked(a: &Particles, b: &Particles) -> Result<Vec<String>> {
        check_boxes([Subject::Particles(a), Subject::Particles(b)])
    }

    #[test]
    fn boxes_of_different_sizes_are_refused() {
        let (a, b) = (points(9.0, Some([10.0; 3]), "kpc"), points(9.0, Some([10.0, 10.0, 11.0]), "kpc"));
        assert!(checked(&a, &a).unwrap().is_empty());
        let refused = checked(&a, &b).unwrap_err();
        assert!(
            matches!(refused, particlegs_core::Error::Input { .. }) && refused.to_string().contains("10 x 10 x 11"),
            "{refused}"
        );
    }

    #[test]
    fn tilted_boxes_are_one_where_their_lattices_are() {
        let tilted = |vectors| {
            let mut p = points(6.0, None, "nm");
            p.meta.cell = Some(Cell { vectors, ..Cell::orthogonal([0.0; 3]) });
            p
        };
        let [a, b, c] = [[6.0, 0.0, 0.0], [3.0, 5.0, 0.0], [1.0, 2.0, 6.0]];
        let one = tilted([a, b, c]);
        let check_lattice = |vectors| checked(&one, &tilted(vectors));
        assert!(check_lattice([a, [15.0, 5.0, 0.0], [-1.0, -2.0, -6.0]]).is_ok());
        assert!(
            check_lattice([a, [15.0, 5.0, 0.0], [2.0, 2.0, 6.0]])
                .unwrap_err()
                .to_string()
                .contains("cannot be compared")
        );
        assert!(check_lattice([[6.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 6.0]]).is_err());
        // Neither is said to have no periodic box.
        assert!(checked(&one, &one).unwrap().is_empty());
    }

    #[test]
    fn what_is_not_stated_is_said() {
        let truth = points(9.0, Some([10.0; 3]), "kpc");
        assert_eq!(checked(&truth, &points(9.0, None, "kpc")).unwrap().len(), 1);
        assert!(matches!(
            checked(&truth, &points(30.0, None, "kpc")).unwrap_err(),
            particlegs_core::Error::Input { .. }
        ));
        assert_eq!(checked(&points(9.0, None, "kpc"), &truth).unwrap().len(), 1);
    }
}
