//! Particles that friends of friends links, and the length of links: in a zoom the finest, by their own mean spacing.

use super::points::{PointGrid, gathered};
use super::{Domain, Groups, find_groups, group_center, longest_link};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Dimension, Unit, UnitSystem, Units};
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{Particles, mass_classes};
use std::ops::Range;

/// Parts of an edge that are told apart when a region is looked for that may lie across the seam.
const PARTS: usize = 64;
/// A zoom's region spans at most this share of every edge.
const REGION: f64 = 0.5;
/// Particles heavier than those of a zoom by this factor are not linked with them; levels are a factor of 8 apart.
const LIGHTER: f64 = 4.0;
/// Species of one zoom, as its gas and its dark matter, differ in their extents by no more than this factor.
const WIDER: f64 = 1.25;
/// Kinds of less than this part of the most numerous one say nothing of the region.
const FEW: usize = 10;

/// Groups of one side.
pub(crate) struct LinkedGroups {
    pub groups: Groups,
    pub linked: u64,
    /// Groups with heavier particles inside, where those were not linked.
    pub contaminated: Option<u64>,
}

pub(crate) struct LinkedParticles {
    /// Their indices; `None` = all.
    index: Option<Vec<u32>>,
    /// Their mean spacing in the region where they lie.
    pub spacing: f64,
}

/// A kind of particles: a layer, or those of one weight in it.
struct ParticleKind {
    range: Range<usize>,
    weight: Option<f32>,
    mass: f64,
    count: usize,
    spread: AxisSpread,
}

impl ParticleKind {
    fn indices<'a>(&self, weights: Option<&'a [f32]>) -> impl Iterator<Item = usize> + use<'a> {
        let weight = self.weight;
        self.range.clone().filter(move |i| weight.is_none_or(|w| weights.is_some_and(|all| all[*i] == w)))
    }
}

/// The extent of particles along each edge: the lowest and highest place in each part of it.
struct AxisSpread([[[f64; 2]; PARTS]; 3]);

impl AxisSpread {
    fn new(places: impl Iterator<Item = [f64; 3]>, domain: &Domain) -> Self {
        let mut spread = [[[f64::INFINITY, f64::NEG_INFINITY]; PARTS]; 3];
        for x in places {
            for k in 0..3 {
                let along = domain.along(&x, k);
                let part = (along / domain.length[k] * PARTS as f64).clamp(0.0, (PARTS - 1) as f64) as usize;
                let ends = &mut spread[k][part];
                *ends = [ends[0].min(along), ends[1].max(along)];
            }
        }
        AxisSpread(spread)
    }

    /// Beginning and length of the stretch of an edge that holds all; around the seam where it repeats.
    fn region(&self, domain: &Domain, k: usize) -> [f64; 2] {
        let held = |part: usize| self.0[k][part % PARTS][0].is_finite();
        let parts: Vec<usize> = (0..PARTS).filter(|p| held(*p)).collect();
        let (Some(&first), Some(&last)) = (parts.first(), parts.last()) else { return [0.0; 2] };
        // The widest gap between two parts; the one across the seam comes first.
        let gaps = parts.windows(2).map(|w| (w[1] - w[0], w[1], w[0]));
        let (_, from, to) = gaps
            // An open edge has no seam: its stretch goes from the first part to the last.
            .filter(|_| domain.periodic[k])
            .fold((PARTS - last + first, first, last), |a, b| if b.0 > a.0 { b } else { a });
        let (low, high) = (self.0[k][from][0], self.0[k][to][1]);
        [low, if high < low { high - low + domain.length[k] } else { high - low }]
    }
}

fn finest(p: &Particles, positions: &[[f64; 3]], domain: &Domain) -> Option<LinkedParticles> {
    if !domain.periodic.contains(&true) {
        return None;
    }
    let weights = p.weights().map(|w| &w[..]);
    let mut kinds = Vec::new();
    for layer in p.layers() {
        let layer_weights = weights.filter(|_| layer.mass.is_weighted());
        let classes = layer_weights.and_then(|w| mass_classes(&w[layer.content.clone()]));
        // Masses that are not known, or all different, tell no levels apart.
        let classes = if layer_weights.is_some() { classes?.into_iter().map(Some).collect() } else { vec![None] };
        let unit = layer.mass.unit().or(layer_weights.map(|_| 1.0))?;
        for weight in classes {
            let mass = unit * weight.map_or(1.0, f64::from);
            let spread = AxisSpread::new(std::iter::empty(), domain);
            kinds.push(ParticleKind { range: layer.content.clone(), weight, mass, count: 0, spread });
        }
    }
    if kinds.len() < 2 {
        return None;
    }
    let mut kinds = parallel::map(kinds, |kind| {
        let count = kind.indices(weights).count();
        let spread = AxisSpread::new(kind.indices(weights).map(|i| positions[i]), domain);
        ParticleKind { count, spread, ..kind }
    });
    kinds.retain(|k| k.count > 0);
    let region = |kind: &ParticleKind| each_axis(|k| kind.spread.region(domain, k));
    let zoomed = |kind: &ParticleKind| (0..3).all(|k| region(kind)[k][1] <= REGION * domain.length[k]);
    let alike = |kind: &ParticleKind, mass: f64| kind.mass < LIGHTER * mass;
    let local: Vec<&ParticleKind> = kinds.iter().filter(|k| zoomed(k)).collect();
    // Few light ones, as stars may be, are not what the region is made of.
    let many = local.iter().map(|k| k.count).max()? / FEW;
    let lightest = local.iter().filter(|k| k.count > many).map(|k| k.mass).fold(f64::INFINITY, f64::min);
    let finest = local.iter().filter(|k| alike(k, lightest)).max_by_key(|k| k.count)?;
    let place = region(finest);
    let inside = |kind: &ParticleKind| (0..3).all(|k| region(kind)[k][1] <= WIDER * place[k][1]);
    let (inner, outer): (Vec<&ParticleKind>, Vec<&ParticleKind>) =
        kinds.iter().partition(|k| zoomed(k) && (alike(k, finest.mass) || inside(k)));
    // Particles as light as these lie outside as well: it is no zoom.
    if outer.is_empty() || outer.iter().any(|k| alike(k, finest.mass)) {
        return None;
    }
    let mut index: Vec<u32> = inner.iter().flat_map(|k| k.indices(weights)).map(|i| i as u32).collect();
    index.sort_unstable();
    let region_domain = Domain { length: each_axis(|k| place[k][1]), ..*domain };
    let spacing = region_domain.spacing(index.len());
    (spacing > 0.0).then_some(LinkedParticles { index: Some(index), spacing })
}

impl LinkedParticles {
    /// The finest particles of a zoom in a box that repeats, else all.
    pub fn new(p: &Particles, positions: &[[f64; 3]], domain: &Domain) -> Self {
        finest(p, positions, domain)
            .unwrap_or_else(|| LinkedParticles { index: None, spacing: domain.spacing(p.len()) })
    }

    /// Those of some ranges of particles alone, of `all`.
    pub fn only(self, ranges: &[Range<usize>], all: usize) -> Self {
        let before = self.index.as_ref().map_or(all, Vec::len);
        let index: Vec<u32> = match self.index {
            Some(index) => index.into_iter().filter(|i| ranges.iter().any(|r| r.contains(&(*i as usize)))).collect(),
            None => ranges.iter().cloned().flatten().map(|i| i as u32).collect(),
        };
        // The region stays, so that fewer particles lie further apart.
        let spacing = self.spacing * libm::cbrt(before as f64 / index.len().max(1) as f64);
        LinkedParticles { index: Some(index), spacing }
    }

    /// Their numbers, ascending; `None` = all.
    pub fn index(&self) -> Option<&[u32]> {
        self.index.as_deref()
    }

    /// The groups by links of a length, with members by their number among all particles; `None` where links are longer
    /// than the box allows.
    pub fn groups(
        &self,
        positions: &[[f64; 3]],
        domain: &Domain,
        length: f64,
        smallest: usize,
        context: &Context<'_>,
    ) -> Result<Option<LinkedGroups>> {
        if length > longest_link(domain) {
            return Ok(None);
        }
        let groups = self.link(positions, domain, length, smallest, context)?;
        let (linked, contaminated) = match &self.index {
            None => (positions.len(), None),
            Some(index) => (index.len(), Some(contaminated(&groups, positions, index, domain, context)?)),
        };
        Ok(Some(LinkedGroups { groups, linked: linked as u64, contaminated }))
    }

    /// The groups by links of a length that the box allows, with members by their number among all particles.
    pub fn link(
        &self,
        positions: &[[f64; 3]],
        domain: &Domain,
        length: f64,
        smallest: usize,
        context: &Context<'_>,
    ) -> Result<Groups> {
        let Some(index) = &self.index else { return find_groups(positions, domain, length, smallest, context) };
        let mut groups = find_groups(&gathered(positions, index), domain, length, smallest, context)?;
        parallel::for_each(&mut groups.members, |m| m.iter_mut().for_each(|i| *i = index[*i as usize]));
        Ok(groups)
    }
}

/// Groups that hold particles which were not linked, no further from their centre than their own.
fn contaminated(
    groups: &Groups,
    positions: &[[f64; 3]],
    linked: &[u32],
    domain: &Domain,
    context: &Context<'_>,
) -> Result<u64> {
    let mut is_linked = vec![false; positions.len()];
    linked.iter().for_each(|i| is_linked[*i as usize] = true);
    let others: Vec<[f64; 3]> =
        positions.iter().zip(&is_linked).filter(|(_, is_linked)| !**is_linked).map(|(x, _)| *x).collect();
    let points = PointGrid::new(&others, domain, 0.0)?;
    let square = |d: [f64; 3]| d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let counts = parallel::try_map(&groups.members, |members| {
        context.check()?;
        let center = group_center(positions, members, domain);
        let away = |x: &[f64; 3]| square(domain.shortest_way(each_axis(|k| x[k] - center[k])));
        let reach = members.iter().map(|i| away(&positions[*i as usize])).fold(0.0, f64::max);
        let mut holds = false;
        points.near(points.cell_of(center), reach.sqrt(), |run, shift| {
            let from: [f64; 3] = each_axis(|k| center[k] - shift[k]);
            holds |= points.position[run].iter().any(|x| square(each_axis(|k| x[k] - from[k])) <= reach);
        });
        Ok::<u64, Error>(u64::from(holds))
    })?;
    Ok(counts.into_iter().sum())
}

/// A length such as `0.02Mpc`, `20 kpc/h` or, in the unit that numbers are in, `0.02`.
pub(super) fn length_in(text: &str, system: &UnitSystem<'_>) -> Result<f64> {
    let text = text.trim();
    // The longest beginning that is a number: `1e-3kpc` has an exponent, `2eV` would have none.
    let ends = (1..=text.len()).rev().filter(|n| text.is_char_boundary(*n));
    let number = ends.filter_map(|n| Some((n, text[..n].trim_end().parse::<f64>().ok()?))).next();
    let Some((end, value)) = number.filter(|(_, v)| v.is_finite() && *v > 0.0) else {
        return Err(Error::argument(format!("`{text}` is not a positive length, such as 0.02Mpc")));
    };
    let unit = text[end..].trim();
    if unit.is_empty() {
        return Ok(value);
    }
    let refused = |why: String| Error::argument(format!("`{text}`: {why}"));
    if !Unit::is_known(unit, Dimension::Length) {
        return Err(refused(format!("`{unit}` is not a unit of length")));
    }
    if system.units.length.is_none() {
        return Err(refused("the particles state no unit of length, so it cannot be converted".into()));
    }
    let units = Units::new(Some(unit), None, None);
    let stated_system = UnitSystem { units: &units, ..*system };
    Ok(value * stated_system.conversion(system).map_err(refused)?.length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::local_positions;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;
    use particlegs_core::model::{Cosmology, Epoch};
    use particlegs_particles::Column;
    use particlegs_particles::testing::from_points;

    const BOX: Domain = Domain::upright([0.0; 3], [100.0; 3], [true; 3]);

    /// Heavy particles in a box; a region of 10 about `corner` of light ones, with two clumps of 300 and 150, the
    /// second with `intruders` heavy ones inside.
    fn zoom(corner: f64, intruders: usize) -> Particles {
        let mut r = Random::new(2, 0, 0);
        let clumps = [
            (8000, corner, 10.0, 1.0),
            (300, corner + 2.0, 0.15, 1.0),
            (150, corner + 6.0, 0.15, 1.0),
            (intruders, corner + 6.0, 0.1, 8000.0),
            (7000, 0.0, 100.0, 8000.0),
        ];
        let weights = clumps.iter().flat_map(|(n, _, _, weight)| vec![*weight; *n]).collect();
        let places = clumps.iter().flat_map(|&(n, at, size, _)| (0..n).map(move |_| (at, size)));
        from_points(places.map(|(at, size)| [0; 3].map(|_| (at + size * r.uniform()).rem_euclid(100.0))))
            .with_weights(Column::owned(weights))
    }

    fn groups_of(p: &Particles, share: f64) -> LinkedGroups {
        let x = local_positions(p, &BOX);
        let linked = LinkedParticles::new(p, &x, &BOX);
        linked.groups(&x, &BOX, share * linked.spacing, 20, &Context::SILENT).unwrap().unwrap()
    }

    /// In the middle of the box and across its corner.
    #[test]
    fn zooms_link_their_finest_particles() {
        for corner in [45.0, 95.0] {
            let p = zoom(corner, 0);
            let f = groups_of(&p, 0.2);
            assert_eq!((f.linked, f.contaminated), (8450, Some(0)), "{corner}");
            assert!((f.groups.linking_length / 0.098 - 1.0).abs() < 0.02, "{}", f.groups.linking_length);
            let sizes = f.groups.sizes();
            assert!(sizes.len() == 2 && (300..310).contains(&sizes[0]) && (150..160).contains(&sizes[1]), "{sizes:?}");
            assert!(f.groups.members.iter().flatten().all(|i| p.weights().unwrap()[*i as usize] == 1.0));
            assert_eq!(groups_of(&zoom(corner, 2), 0.2).contaminated, Some(1));
        }
    }

    /// Gas and dark matter of the region are linked, and a level between them and the box is not.
    #[test]
    fn species_of_one_region_are_linked_together() {
        let mut r = Random::new(4, 0, 0);
        let levels = [(3000, 10.0, 1.0), (3000, 10.0, 5.4), (300, 4.0, 0.5), (2500, 30.0, 43.0), (4000, 100.0, 344.0)];
        let weights = levels.iter().flat_map(|(n, _, weight)| vec![*weight; *n]).collect();
        let sizes = levels.iter().flat_map(|(n, size, _)| vec![*size; *n]);
        let particles = from_points(sizes.map(|size| [0; 3].map(|_| 50.0 + size * (r.uniform() - 0.5))));
        let f = groups_of(&particles.with_weights(Column::owned(weights)), 0.2);
        assert_eq!(f.linked, 6300);
    }

    /// All are linked where masses are spread alike, or the heavy ones are the few.
    #[test]
    fn boxes_that_are_no_zooms_link_all() {
        let p = zoom(45.0, 0);
        let same = p.clone().without_weights();
        assert_eq!(groups_of(&same, 0.02).linked, 15_450);
        let weights = p.weights().unwrap().iter().map(|w| 8000.0 / w).collect();
        assert_eq!(groups_of(&same.clone().with_weights(Column::owned(weights)), 0.02).linked, 15_450);
        let mixed = (0..15_450).map(|i| if i % 2 == 0 { 1.0 } else { 8.0 }).collect();
        let f = groups_of(&same.with_weights(Column::owned(mixed)), 0.02);
        assert_eq!((f.linked, f.contaminated), (15_450, None));
        assert_eq!(f.groups.linking_length, 0.02 * BOX.spacing(15_450));
    }

    #[test]
    fn lengths_have_units() {
        let cosmology = Cosmology { hubble: Some(0.5), ..Cosmology::default() };
        let length_of = |text: &str, unit: Option<&str>| {
            let units = Units::new(unit, None, None);
            length_in(text, &UnitSystem::new(&units, &Epoch::default(), &cosmology))
        };
        for (text, unit, expected) in [
            ("0.02Mpc", "kpc", 20.0),
            ("0.02 Mpc", "Mpc", 0.02),
            ("2e1kpc/h", "kpc", 40.0),
            ("20kpc", "kpc/h", 10.0),
            (" 3.5 ", "nm", 3.5),
        ] {
            let length = length_of(text, Some(unit)).unwrap();
            assert!((length / expected - 1.0).abs() < 1e-9, "{text} in {unit}: {length}");
        }
        assert_eq!(length_of("0.3", None).unwrap(), 0.3);
        for (text, unit) in [
            ("0", "kpc"),
            ("-1kpc", "kpc"),
            ("Mpc", "kpc"),
            ("inf", "kpc"),
            ("", "kpc"),
            ("2 Msun", "kpc"),
            ("1 parsnip", "kpc"),
        ] {
            assert!(matches!(length_of(text, Some(unit)), Err(Error::Argument { .. })), "{text}");
        }
        assert!(length_of("1kpc", None).is_err());
    }
}
