//! Checks that the box that a snapshot states holds its particles.

use super::{Chunk, Particles};
use particlegs_core::math::each_axis;
use particlegs_core::space::{Bounds, Cell, PeriodicCell};
use particlegs_core::{Error, Result};

/// Lengths and coordinates that the arithmetic of this program stands, whatever the unit: their sixth
/// powers (determinants of covariances) stay within f64. Float32 reaches from 1e-45 to 3e38.
const LENGTHS: [f64; 2] = [1e-50, 1e50];
/// A share of the box by which particles may stick out and still count as inside: rounding to f32.
const SLACK: f64 = 1e-5;

/// Refuses coordinates and boxes that no arithmetic stands, and an axis-aligned box that lies more
/// than its own length away from some particles: a box of another unit, most likely.
pub fn check_box(bounds: &Bounds, cell: Option<&Cell>, name: &str) -> Result<()> {
    let refused = |message: String| Err(Error::input_with(name, message, "check the unit of length and the box"));
    let [least, most] = LENGTHS;
    if !bounds.min.iter().chain(&bounds.max).all(|x| x.abs() <= most) {
        return refused(format!("coordinates exceed {most:e}"));
    }
    let extent = bounds.extent();
    if let Some(k) = (0..3).find(|&k| extent[k] > 0.0 && extent[k] < least) {
        return refused(format!("the extent of {:e} along {} is less than {least:e}", extent[k], AXES[k]));
    }
    let Some(cell) = cell else { return Ok(()) };
    let sizes = cell.vectors.map(|v| v.iter().fold(0.0, |m: f64, x| m.max(x.abs())));
    // A slab may have no length along an axis that does not repeat.
    let within = |k: usize| (least..=most).contains(&sizes[k]) || sizes[k] == 0.0 && !cell.periodic[k];
    if !((0..3).all(within) && cell.origin.iter().all(|x| x.abs() <= most) && cell.inverse().is_some()) {
        return refused(format!("a box of {:e}, {:e}, {:e} cannot be used", sizes[0], sizes[1], sizes[2]));
    }
    let cell = cell.reduced();
    let Some(lengths) = cell.lengths() else { return Ok(()) };
    for k in (0..3).filter(|&k| cell.periodic[k]) {
        let (low, length) = (cell.origin[k], lengths[k]);
        if bounds.min[k] < low - (1.0 + SLACK) * length || bounds.max[k] > low + (2.0 + SLACK) * length {
            return refused(format!(
                "particles reach from {} to {} along {}, more than a box length outside the box from {} to {}",
                bounds.min[k],
                bounds.max[k],
                AXES[k],
                low,
                low + length
            ));
        }
    }
    Ok(())
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Whether the box holds the bounds, for sure.
fn holds(cell: &Cell, bounds: &Bounds) -> bool {
    cell.lengths().is_some_and(|lengths| {
        (0..3).filter(|&k| cell.periodic[k]).all(|k| {
            let (low, slack) = (cell.origin[k], SLACK * lengths[k]);
            bounds.min[k] >= low - slack && bounds.max[k] <= low + lengths[k] + slack
        })
    })
}

/// Particles outside a periodic box, tilted or not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ParticlesOutsideBox {
    all: u64,
    /// Particles more than a box length outside.
    far: u64,
}

impl ParticlesOutsideBox {
    /// Counts them in a chunk about `origin`, which has these bounds in world units.
    pub(crate) fn count(chunk: &Chunk<'_>, origin: [f64; 3], bounds: &Bounds, cell: Option<&Cell>) -> Self {
        let cell = cell.filter(|c| !holds(c, bounds));
        // A particle inside a cell or inside what that is reduced to is where it belongs.
        let cells = cell.map(|c| [*c, c.reduced()].map(PeriodicCell::new));
        let Some([Some(stated), Some(reduced)]) = cells else { return Self::default() };
        let mut counts = Self::default();
        for i in 0..chunk.len() {
            let beyond = |cell: &PeriodicCell| {
                let corner = cell.offset(origin);
                cell.beyond(each_axis(|k| f64::from(chunk.position[k][i]) + corner[k]))
            };
            let beyond = beyond(&stated).min(beyond(&reduced));
            counts.all += u64::from(beyond > SLACK);
            counts.far += u64::from(beyond > 1.0 + SLACK);
        }
        counts
    }

    /// With those of another chunk.
    pub(crate) fn and(self, other: Self) -> Self {
        ParticlesOutsideBox { all: self.all + other.all, far: self.far + other.far }
    }

    /// Refuses particles that lie far outside; what a user must know of the others, which are at their images in the
    /// box wherever it matters. `count` is the number of all particles.
    pub fn judge(self, count: u64, name: &str) -> Result<Option<String>> {
        let ParticlesOutsideBox { all, far } = self;
        if far > 0 {
            let message = format!("{far} of {count} particles are more than a box length outside the periodic box");
            return Err(Error::input_with(name, message, "check the unit of length and the box"));
        }
        Ok((all > 0).then(|| {
            format!(
                "{name}: {all} of {count} particles are outside the periodic box by less than its length; their \
                 periodic images inside it are used"
            )
        }))
    }
}

/// [`check_box`] and [`ParticlesOutsideBox::judge`] of particles.
pub fn check_particles(particles: &Particles, bounds: &Bounds) -> Result<Option<String>> {
    let (name, cell) = (&particles.meta.name, particles.meta.cell.as_ref());
    check_box(bounds, cell, name)?;
    let counts = particles.par_chunks(|_, chunk| ParticlesOutsideBox::count(&chunk, particles.origin, bounds, cell));
    counts
        .into_iter()
        .fold(ParticlesOutsideBox::default(), ParticlesOutsideBox::and)
        .judge(particles.len() as u64, name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SnapshotMeta;

    fn points(x: &[f32], cell: Option<Cell>) -> Particles {
        let mut p = Particles::from_columns(x.to_vec(), vec![1.0; x.len()], vec![2.0; x.len()]);
        p.meta = SnapshotMeta { name: "snap".into(), cell, ..SnapshotMeta::default() };
        p
    }

    fn said(p: &Particles) -> Result<Option<String>> {
        check_particles(p, &p.bounds())
    }

    #[test]
    fn particles_out_of_the_box_are_counted_or_refused() {
        let cell = Some(Cell::orthogonal([10.0; 3]));
        assert!(said(&points(&[0.0, 5.0, 10.0, 10.000_01], cell)).unwrap().is_none());
        let note = said(&points(&[-9.0, 5.0, 10.5, 19.0], cell)).unwrap().unwrap();
        assert!(note.contains("snap: 3 of 4 particles"), "{note}");
        let refused = said(&points(&[-9.0, 5.0, 21.0], cell)).unwrap_err();
        assert!(
            matches!(refused, particlegs_core::Error::Input { .. })
                && refused.to_string().contains("from -9 to 21 along x"),
            "{refused}"
        );
        // Without a box along x nothing repeats there.
        let slab = Cell { periodic: [false, true, true], ..Cell::orthogonal([10.0; 3]) };
        assert!(said(&points(&[-9.0, 5.0, 1e20], Some(slab))).unwrap().is_none());
        assert!(said(&points(&[-9.0, 5.0, 1e20], None)).unwrap().is_none());
    }

    #[test]
    fn tilted_boxes_count_by_their_own_axes() {
        let tilted =
            Cell { vectors: [[10.0, 0.0, 0.0], [5.0, 10.0, 0.0], [0.0, 0.0, 10.0]], ..Cell::orthogonal([1.0; 3]) };
        // At y = 1 the box reaches from 0.5 to 10.5.
        assert!(said(&points(&[0.6, 10.4], Some(tilted))).unwrap().is_none());
        assert!(said(&points(&[0.4, 10.4], Some(tilted))).unwrap().unwrap().contains("1 of 2"));
        assert!(matches!(said(&points(&[0.4, 21.4], Some(tilted))).unwrap_err(), particlegs_core::Error::Input { .. }));
    }

    /// Vectors many cells long, and particles in the shortest ones' cell; an upright box by negative vectors; a slab.
    #[test]
    fn particles_lie_in_a_cell_by_any_of_its_vectors() {
        let cell_of = |vectors| Cell { vectors, ..Cell::orthogonal([0.0; 3]) };
        let long = cell_of([[10.0, 0.0, 0.0], [95.0, 10.0, 0.0], [0.0, -90.0, 10.0]]);
        assert!(said(&points(&[0.1, 5.0, 9.9], Some(long))).is_ok());
        let negative = cell_of([[-10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]]);
        assert!(said(&points(&[-9.0, -1.0], Some(negative))).unwrap().is_none());
        assert!(said(&points(&[-31.0, -1.0], Some(negative))).is_err());
        let slab = Cell { periodic: [true, true, false], ..Cell::orthogonal([10.0, 10.0, 0.0]) };
        assert!(said(&points(&[0.1, 9.9], Some(slab))).unwrap().is_none());
        assert!(said(&points(&[0.1, 9.9], Some(Cell { periodic: [true; 3], ..slab }))).is_err());
    }

    #[test]
    fn lengths_that_no_arithmetic_stands_are_refused() {
        for cell in [5e-324, 1e-60, 1e60, f64::INFINITY, f64::NAN] {
            let p = points(&[0.0], Some(Cell::orthogonal([cell; 3])));
            assert!(
                matches!(
                    check_box(&p.bounds(), p.meta.cell.as_ref(), "p").unwrap_err(),
                    particlegs_core::Error::Input { .. }
                ),
                "{cell}"
            );
        }
        let mut p = points(&[1e-45, 0.0], None);
        said(&p).unwrap();
        p.origin = [1e300; 3];
        assert!(matches!(said(&p).unwrap_err(), particlegs_core::Error::Input { .. }));
    }
}
