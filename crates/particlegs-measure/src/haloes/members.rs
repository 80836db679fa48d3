//! Groups of linked particles, the particles attached to them, and their density peaks.

use super::HaloOptions;
use crate::stats::{LinkedParticles, PointGrid, gathered, group_offsets, longest_link, mean_place, shrunk_center};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::is_species;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{Domain, Particles};
use std::f64::consts::PI;
use std::ops::Range;

/// A cell in which the density peak is looked for, as a share of the radius of a sphere of 200 times the mean density.
const CELL: f64 = 0.25;
/// Radius from which spheres shrink, in cells.
const SHRINK_FROM: f64 = 1.5;
/// Layers of dark matter.
const DARK_MATTER: &str = "dm";

/// Groups, the largest first.
pub struct LinkedHaloes {
    pub linking_length: f64,
    /// Linked particles of each, by their number among all.
    pub members: Vec<Vec<u32>>,
    /// Mean number density of linked particles, in the region where they lie.
    pub number_density: f64,
    /// Mass of each: linked particles and those attached to them.
    pub masses: Vec<f64>,
    /// Particles of other species attached to each; `None` where all are linked.
    pub attached: Option<Vec<u64>>,
    /// Whether each particle is one of the finest of a zoom; `None` in other boxes.
    pub fine: Option<Vec<bool>>,
    /// The particle types that are linked, in words, where these are not all.
    pub note: Option<String>,
}

impl LinkedHaloes {
    /// Links particles of a source of `number`, of which all are there or the dense part.
    pub fn find(
        p: &Particles,
        positions: &[[f64; 3]],
        domain: &Domain,
        (o, number): (&HaloOptions, u64),
        mass: &(impl Fn(u32) -> f64 + Sync),
        context: &Context<'_>,
    ) -> Result<LinkedHaloes> {
        let layer_names = linked_layers(p, &o.linked)?;
        let finest = LinkedParticles::new(p, positions, domain);
        let fine = finest.index().map(|index| {
            let mut fine = vec![false; p.len()];
            index.iter().for_each(|i| fine[*i as usize] = true);
            fine
        });
        let linked = match &layer_names {
            Some(layers) => finest.only(&ranges(p, layers), p.len()),
            None => finest,
        };
        // Of a model's dense part the links follow the mean spacing of all particles.
        let spacing = linked.spacing * libm::cbrt(p.len() as f64 / number as f64);
        let length = o.linking * spacing;
        if length > longest_link(domain) {
            let message =
                format!("the linking length {length:.4} is more than a third of the box: there are too few particles");
            return Err(Error::argument(message));
        }
        let groups = linked.link(positions, domain, length, o.smallest, context)?.members;
        let number_density = spacing.powi(-3);
        let mut haloes = LinkedHaloes {
            linking_length: length,
            masses: parallel::map(&groups, |members| members.iter().map(|i| mass(*i)).sum()),
            members: groups,
            number_density,
            attached: None,
            fine,
            note: layer_names.as_ref().map(|layers| format!("linked: {}; others are attached", layers.join(", "))),
        };
        if let (Some(_), Some(index)) = (&layer_names, linked.index()) {
            haloes.attach(p, positions, (domain, index), mass, context)?;
        }
        Ok(haloes)
    }

    /// Adds each particle that is not linked, and not one of a zoom's coarse ones, to the group of the nearest linked
    /// one within the linking length.
    fn attach(
        &mut self,
        p: &Particles,
        positions: &[[f64; 3]],
        (domain, linked): (&Domain, &[u32]),
        mass: &(impl Fn(u32) -> f64 + Sync),
        context: &Context<'_>,
    ) -> Result<()> {
        let mut group = vec![u32::MAX; p.len()];
        let mut is_linked = vec![false; p.len()];
        linked.iter().for_each(|i| is_linked[*i as usize] = true);
        for (number, members) in self.members.iter().enumerate() {
            members.iter().for_each(|i| group[*i as usize] = number as u32);
        }
        let points = PointGrid::new(&gathered(positions, linked), domain, self.linking_length)?;
        let others: Vec<u32> = (0..p.len() as u32)
            .filter(|i| !is_linked[*i as usize] && self.fine.as_ref().is_none_or(|fine| fine[*i as usize]))
            .collect();
        let nearest = parallel::try_map(&others, |i| {
            context.check()?;
            // Of equal distances the first particle.
            let mut best = (f64::INFINITY, u32::MAX);
            points.within(positions[*i as usize], self.linking_length, |at, _, square| {
                let candidate = (square, linked[at]);
                best = if candidate < best { candidate } else { best };
            });
            Ok::<u32, Error>(group.get(best.1 as usize).copied().unwrap_or(u32::MAX))
        })?;
        let mut attached = vec![0; self.members.len()];
        for (i, number) in others.iter().zip(nearest).filter(|(_, number)| *number != u32::MAX) {
            attached[number as usize] += 1;
            self.masses[number as usize] += mass(*i);
        }
        self.attached = Some(attached);
        Ok(())
    }
}

/// Names of the layers that are linked, where these are not all.
fn linked_layers(p: &Particles, species: &[String]) -> Result<Option<Vec<String>>> {
    let names = || p.layers().iter().map(|l| &l.name);
    if let Some(missing) = species.iter().find(|one| !names().any(|name| is_species(name, one))) {
        let all: Vec<&str> = names().map(String::as_str).collect();
        return Err(Error::argument(format!(
            "there is no particle type `{missing}` to link; there are {}",
            all.join(", ")
        )));
    }
    let is_meant = |name: &&String| match species {
        [] => is_species(name, DARK_MATTER),
        _ => species.iter().any(|one| is_species(name, one)),
    };
    let layer_names: Vec<String> = names().filter(is_meant).cloned().collect();
    Ok((!layer_names.is_empty() && layer_names.len() < p.layers().len()).then_some(layer_names))
}

fn ranges(p: &Particles, layers: &[String]) -> Vec<Range<usize>> {
    p.layers().iter().filter(|l| layers.contains(&l.name)).map(|l| l.content.clone()).collect()
}

/// The place where members of a group are densest, relative to the domain's corner: the centre of spheres that shrink,
/// from the cells with the most members.
pub fn density_peak(positions: &[[f64; 3]], members: &[u32], domain: &Domain, number_density: f64) -> [f64; 3] {
    let Some((first, all)) = group_offsets(positions, members, domain) else { return [0.0; 3] };
    // At 200 times the mean density, the members fill a sphere whose radius is four of these edges.
    let side = CELL * libm::cbrt(members.len() as f64 / (800.0 / 3.0 * PI * number_density));
    let cell = |x: &[f64; 3]| -> [i32; 3] { each_axis(|k| (x[k] / side).floor() as i32) };
    let mut cells: Vec<[i32; 3]> = all.iter().map(cell).collect();
    cells.sort_unstable();
    let counts: Vec<([i32; 3], usize)> = cells.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect();
    // Rows of cells about one, each from the first that the last one's neighbours began with: all are sorted alike.
    let mut rows: Vec<(i32, i32, usize)> = (0..9).map(|i| (i / 3 - 1, i % 3 - 1, 0)).collect();
    let mut around = |[x, y, z]: [i32; 3]| -> usize {
        let in_row = |(i, j, first): &mut (i32, i32, usize)| {
            *first += counts[*first..].iter().take_while(|c| c.0 < [x + *i, y + *j, z - 1]).count();
            let row = counts[*first..].iter().take_while(|c| c.0 <= [x + *i, y + *j, z + 1]);
            row.map(|c| c.1).sum::<usize>()
        };
        rows.iter_mut().map(in_row).sum()
    };
    // Of cells that are alike the first, so that the peak is always the same.
    let densest = counts.iter().map(|c| (around(c.0), c.0)).reduce(|a, b| if b.0 > a.0 { b } else { a });
    let near = |x: &&[f64; 3]| densest.is_some_and(|(_, center)| (0..3).all(|k| (cell(x)[k] - center[k]).abs() <= 1));
    // The mean place of all members may lie in none of the clumps that a bridge links.
    let start = mean_place(&all.iter().filter(near).copied().collect::<Vec<_>>());
    let center = shrunk_center(all, start, SHRINK_FROM * side);
    domain.local(each_axis(|k| domain.min[k] + first[k] + center[k]))
}
