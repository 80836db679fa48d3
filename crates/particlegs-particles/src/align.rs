//! Frames of a molecule turned and moved onto the first, by least squares (Kabsch 1976).

use super::{Column, Particles, Positions};
use particlegs_core::camera::CenteredCell;
use particlegs_core::math::{Sym3, cross, dot, each_axis, norm};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result, parallel};

/// Atoms that frames are aligned by, at most: all others are looked at beside each of them.
const MOST: usize = 5000;
/// Atoms whose second longest spread is below this share of the longest lie on a line.
const LINE: f64 = 1e-6;

/// Places of chosen atoms in the first frame, which the same atoms of others are put onto.
#[derive(Clone, Debug)]
pub struct Alignment {
    places: Vec<[f64; 3]>,
    center: [f64; 3],
    /// Layers and how many atoms each has.
    layers: Vec<(String, usize)>,
}

/// Particles that were turned and moved.
pub struct AlignedFrame {
    /// All particles, in no periodic box.
    pub particles: Particles,
    /// Root mean square distance of the chosen atoms from their places in the first frame, world units.
    pub rms_distance: f64,
}

impl Alignment {
    /// Of the chosen atoms of the first frame.
    ///
    /// # Errors
    /// [`Error::Argument`]: fewer than three atoms, too many, or atoms on a line.
    pub fn new(chosen: &Particles) -> Result<Alignment> {
        if !(3..=MOST).contains(&chosen.len()) {
            let message = format!("frames are aligned by 3 to {MOST} atoms, and {} are chosen", chosen.len());
            return Err(Error::argument_with(message, "choose such as \"name CA\""));
        }
        let places = whole(chosen);
        let center = middle(&places);
        let spread = places.iter().fold(Sym3::default(), |s, p| s.add(&Sym3::outer(each_axis(|k| p[k] - center[k]))));
        let values = spread.eigen().values;
        if values[1] <= LINE * values[0] {
            return Err(Error::argument("frames cannot be aligned by atoms that lie on a line"));
        }
        Ok(Alignment { places, center, layers: layers(chosen) })
    }

    /// Turns and moves `all` particles as the same atoms of their frame, `chosen`, lie best on those of the first.
    ///
    /// # Errors
    /// [`Error::Input`]: the frame has other atoms than the first.
    pub fn apply(&self, chosen: &Particles, all: &Particles) -> Result<AlignedFrame> {
        if layers(chosen) != self.layers {
            let text = |l: &[(String, usize)]| l.iter().map(|(n, c)| format!("{c} {n}")).collect::<Vec<_>>().join(", ");
            let (frame_atoms, first) = (text(&layers(chosen)), text(&self.layers));
            let message = format!("the atoms to align by are {frame_atoms}, but {first} in the first frame");
            return Err(Error::input(&chosen.meta.name, message));
        }
        let places = whole(chosen);
        let center = middle(&places);
        let turn = self.turn(&places, center);
        let turned = |p: [f64; 3]| -> [f64; 3] {
            let d = each_axis(|k| p[k] - center[k]);
            each_axis(|k| dot(turn[k], d))
        };
        let square = |(p, to): (&[f64; 3], &[f64; 3])| {
            let at = turned(*p);
            (0..3).map(|k| (at[k] + self.center[k] - to[k]).powi(2)).sum::<f64>()
        };
        let sum: f64 = places.iter().zip(&self.places).map(square).sum();
        let images = MoleculeImages::new(all, &places);
        let moved = parallel::map_range(all.len(), |i| turned(images.nearest(all.position(i))).map(|v| v as f32));
        let column = |k: usize| Column::owned(moved.iter().map(|p| p[k]).collect());
        let mut particles = all.clone();
        particles.positions = Positions::Columns([column(0), column(1), column(2)]);
        (particles.origin, particles.meta.cell) = (self.center, None);
        Ok(AlignedFrame { particles, rms_distance: (sum / places.len() as f64).sqrt() })
    }

    /// Rows of the rotation that brings `places` about `center` onto those of the first frame.
    fn turn(&self, places: &[[f64; 3]], center: [f64; 3]) -> [[f64; 3]; 3] {
        // Covariance of both: from row a to column b.
        let mut covariance = [[0.0; 3]; 3];
        for (p, to) in places.iter().zip(&self.places) {
            for a in 0..3 {
                (0..3).for_each(|b| covariance[a][b] += (p[a] - center[a]) * (to[b] - self.center[b]));
            }
        }
        // Its eigenvectors are the first frame's side of the singular value decomposition of the covariance.
        let squares = covariance.iter().fold(Sym3::default(), |s, row| s.add(&Sym3::outer(*row)));
        let [first, second, _] = squares.eigen().vectors;
        let onto = |v: [f64; 3]| -> [f64; 3] { each_axis(|a| dot(covariance[a], v)) };
        let unit = |v: [f64; 3]| v.map(|x| x / norm(v).max(f64::MIN_POSITIVE));
        let u = unit(onto(first));
        let second_onto = onto(second);
        // What rounding left of the first is taken out of the second.
        let w = unit(each_axis(|k| second_onto[k] - dot(u, second_onto) * u[k]));
        // The third of each by the other two: a rotation, and no reflection.
        let (from, to) = ([u, w, cross(u, w)], [first, second, cross(first, second)]);
        each_axis(|k| each_axis(|a| (0..3).map(|s| to[s][k] * from[s][a]).sum()))
    }
}

/// Cells about each of the chosen atoms, in a box that repeats.
struct MoleculeImages<'a> {
    about: Vec<(&'a [f64; 3], CenteredCell)>,
}

impl<'a> MoleculeImages<'a> {
    fn new(all: &Particles, places: &'a [[f64; 3]]) -> Self {
        let cell = all.meta.cell.map(|cell| cell.reduced());
        let about = |p: &'a [f64; 3]| Some((p, CenteredCell::new(*p, cell?)?));
        MoleculeImages { about: places.iter().filter_map(about).collect() }
    }

    /// The image of a place that has the nearest chosen atom: about the middle of a long molecule in a tilted box, others
    /// would tear it apart.
    fn nearest(&self, p: [f64; 3]) -> [f64; 3] {
        let mut best = (f64::INFINITY, p);
        for (place, about) in &self.about {
            let shift = about.shift(p);
            let image: [f64; 3] = each_axis(|k| p[k] + shift[k]);
            let square = (0..3).map(|k| (image[k] - place[k]).powi(2)).sum();
            if square < best.0 {
                best = (square, image);
            }
        }
        best.1
    }
}

fn layers(p: &Particles) -> Vec<(String, usize)> {
    p.layers().iter().map(|l| (l.name.clone(), l.content.len())).collect()
}

fn middle(places: &[[f64; 3]]) -> [f64; 3] {
    each_axis(|k| places.iter().map(|p| p[k]).sum::<f64>() / places.len().max(1) as f64)
}

/// Places in a box that repeats, each at its image nearest to a neighbour that has its place already, the nearest first.
fn whole(p: &Particles) -> Vec<[f64; 3]> {
    let mut places: Vec<[f64; 3]> = (0..p.len()).map(|i| p.position(i)).collect();
    let Some(cell) = p.meta.cell.map(|c: Cell| c.reduced()) else { return places };
    if CenteredCell::new([0.0; 3], cell).is_none() || places.is_empty() {
        return places;
    }
    // Square of the distance to what has its place, and that image.
    let mut near: Vec<(f64, [f64; 3])> = vec![(f64::INFINITY, [0.0; 3]); places.len()];
    let mut left: Vec<usize> = (1..places.len()).collect();
    let mut last = places[0];
    while !left.is_empty() {
        let Some(about) = CenteredCell::new(last, cell) else { break };
        let mut nearest = (f64::INFINITY, 0);
        for (at, &i) in left.iter().enumerate() {
            let shift = about.shift(places[i]);
            let image: [f64; 3] = each_axis(|k| places[i][k] + shift[k]);
            let square: f64 = (0..3).map(|k| (image[k] - last[k]).powi(2)).sum();
            if square < near[i].0 {
                near[i] = (square, image);
            }
            if near[i].0 < nearest.0 {
                nearest = (near[i].0, at);
            }
        }
        let i = left.swap_remove(nearest.1);
        places[i] = near[i].1;
        last = near[i].1;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// A chain of atoms, turned by an angle about z and moved, in a box of 10.
    fn chain(angle: f64, moved: [f64; 3], seed: u64) -> Particles {
        let (sine, cosine) = libm::sincos(angle);
        let mut columns = [Vec::new(), Vec::new(), Vec::new()];
        for i in 0..40 {
            let t = f64::from(i) * 0.15;
            let mut r = Random::new(seed, 0, i as u64);
            let noise = |r: &mut Random| if seed == 0 { 0.0 } else { 0.01 * r.normal() };
            let p = [t - 3.0 + noise(&mut r), libm::sin(t) + noise(&mut r), 0.4 * libm::cos(2.0 * t) + noise(&mut r)];
            let p = [cosine * p[0] - sine * p[1] + moved[0], sine * p[0] + cosine * p[1] + moved[1], p[2] + moved[2]];
            (0..3).for_each(|k| columns[k].push(p[k].rem_euclid(10.0) as f32));
        }
        let [x, y, z] = columns;
        let mut p = Particles::from_columns(x, y, z);
        p.meta.cell = Some(Cell::orthogonal([10.0; 3]));
        p
    }

    #[test]
    fn a_turned_molecule_across_faces_lies_on_the_first() {
        let first = chain(0.0, [5.0; 3], 0);
        let alignment = Alignment::new(&first).unwrap();
        let first_frame = alignment.apply(&first, &first).unwrap();
        assert!(first_frame.rms_distance < 1e-6);
        for (angle, moved) in [(1.0, [5.0; 3]), (-2.5, [0.3, 9.9, 0.0]), (std::f64::consts::PI, [9.0, 1.0, 2.0])] {
            let other = chain(angle, moved, 0);
            let aligned_frame = alignment.apply(&other, &other).unwrap();
            assert!(aligned_frame.rms_distance < 1e-5, "{angle}: {}", aligned_frame.rms_distance);
            assert_eq!(aligned_frame.particles.meta.cell, None);
            let off = |i: usize| norm(each_axis(|k| aligned_frame.particles.position(i)[k] - first.position(i)[k]));
            assert!((0..40).all(|i| off(i) < 1e-5), "{angle}");
        }
        let shaken = chain(2.0, [8.0; 3], 3);
        let aligned_frame = alignment.apply(&shaken, &shaken).unwrap();
        assert!((0.012..0.022).contains(&aligned_frame.rms_distance), "{}", aligned_frame.rms_distance);
    }

    /// A chain longer than half the box: what hangs on its ends stays there.
    #[test]
    fn ends_of_a_long_molecule_stay_on_it() {
        let long = |angle: f64| {
            let (sine, cosine) = libm::sincos(angle);
            let mut columns = [Vec::new(), Vec::new(), Vec::new()];
            for i in 0..60 {
                let along = 0.15 * f64::from(i % 30) - 2.0 + if i < 30 { 0.0 } else { 4.5 };
                let p = [cosine * along + 1.0, sine * along + 2.0, 0.3 * libm::sin(3.0 * along)];
                (0..3).for_each(|k| columns[k].push(p[k].rem_euclid(10.0) as f32));
            }
            let [x, y, z] = columns;
            let mut p = Particles::from_columns(x, y, z);
            p.meta.cell = Some(Cell::orthogonal([10.0; 3]));
            p
        };
        let (first, other) = (long(0.0), long(0.6));
        let aligned_frame = Alignment::new(&first).unwrap().apply(&other, &other).unwrap();
        assert!(aligned_frame.rms_distance < 1e-5);
        let extent = aligned_frame.particles.bounds().extent();
        assert!((extent[0] - 8.85).abs() < 1e-3 && extent[1] < 1e-3, "{extent:?}");
    }

    #[test]
    fn a_mirrored_molecule_is_turned_and_not_mirrored_back() {
        let first = chain(0.0, [5.0; 3], 0);
        let mut mirrored = first.clone();
        let [x, y, z] = first.columns(0..40);
        let z = z.into_iter().map(|v| 10.0 - v).collect();
        mirrored.positions = Positions::Columns([x, y, z].map(Column::owned));
        assert!(Alignment::new(&first).unwrap().apply(&mirrored, &mirrored).unwrap().rms_distance > 0.1);
    }

    #[test]
    fn atoms_on_a_line_and_other_atoms_are_refused() {
        let line = |n: usize| Particles::from_columns((0..n).map(|i| i as f32).collect(), vec![0.0; n], vec![1.0; n]);
        assert!(Alignment::new(&line(5)).unwrap_err().to_string().contains("on a line"));
        assert!(Alignment::new(&line(2)).unwrap_err().to_string().contains("2 are chosen"));
        let first = chain(0.0, [5.0; 3], 0);
        let error = Alignment::new(&first).unwrap().apply(&line(5), &first).err().unwrap();
        assert!(error.to_string().contains("in the first frame"), "{error}");
    }
}
