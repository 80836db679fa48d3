//! Into the periodic box.

use particlegs_core::space::{Bounds, Cell};

/// A share of the cell by which bounds may stick out and still count as inside.
const SLACK: f64 = 1e-6;

/// Takes positions to their image inside the cell, along the axes that repeat.
pub(super) struct PeriodicWrap {
    corner: [f64; 3],
    vectors: [[f64; 3]; 3],
    inverse: [[f64; 3]; 3],
    periodic: [bool; 3],
    /// Edge lengths of an orthogonal cell.
    lengths: Option<[f64; 3]>,
}

impl PeriodicWrap {
    /// `None` where nothing repeats. Particles of a snapshot that does not lie in its orthogonal
    /// cell (one about 0, say, with a cell from 0) are kept in the box about their middle.
    pub(super) fn new(cell: Option<&Cell>, bounds: &Bounds) -> Option<PeriodicWrap> {
        let cell = cell.filter(|c| c.periodic.contains(&true))?;
        let reduced = cell.reduced();
        let cell = if reduced.lengths().is_some() { &reduced } else { cell };
        let inverse = cell.inverse()?;
        let lengths = cell.lengths();
        let mut corner = cell.origin;
        for k in (0..3).filter(|k| cell.periodic[*k]) {
            let Some(length) = lengths.map(|l| l[k]) else { continue };
            let slack = SLACK * length;
            if bounds.min[k] < corner[k] - slack || bounds.max[k] > corner[k] + length + slack {
                corner[k] = bounds.center()[k] - 0.5 * length;
            }
        }
        Some(PeriodicWrap { corner, vectors: cell.vectors, inverse, periodic: cell.periodic, lengths })
    }

    /// Wraps columns of positions.
    pub(super) fn apply(&self, columns: &mut [Vec<f64>; 3]) {
        match self.lengths {
            Some(lengths) => {
                for k in (0..3).filter(|&k| self.periodic[k]) {
                    let (corner, length) = (self.corner[k], lengths[k]);
                    columns[k].iter_mut().for_each(|x| *x -= length * ((*x - corner) / length).floor());
                }
            }
            None => self.apply_skewed(columns),
        }
    }

    fn apply_skewed(&self, columns: &mut [Vec<f64>; 3]) {
        let [x, y, z] = columns;
        for i in 0..x.len() {
            let d = [x[i] - self.corner[0], y[i] - self.corner[1], z[i] - self.corner[2]];
            for a in (0..3).filter(|&a| self.periodic[a]) {
                let fraction: f64 = (0..3).map(|k| d[k] * self.inverse[k][a]).sum();
                let turns = fraction.floor();
                x[i] -= turns * self.vectors[a][0];
                y[i] -= turns * self.vectors[a][1];
                z[i] -= turns * self.vectors[a][2];
            }
        }
    }

    /// The f32 of a wrapped coordinate: rounding may not take it to the upper face, which is the
    /// lower one again.
    pub(super) fn round(&self, axis: usize, x: f64) -> f32 {
        let rounded = x as f32;
        let Some(length) = self.lengths.map(|l| l[axis]).filter(|_| self.periodic[axis]) else { return rounded };
        let (low, high) = (self.corner[axis], self.corner[axis] + length);
        if f64::from(rounded) >= high {
            rounded.next_down()
        } else if f64::from(rounded) < low {
            rounded.next_up()
        } else {
            rounded
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_come_into_the_box() {
        let cell = Cell { periodic: [true, true, false], ..Cell::orthogonal([10.0, 20.0, 30.0]) };
        let bounds = Bounds { min: [0.0; 3], max: [10.0, 20.0, 30.0] };
        let wrap = PeriodicWrap::new(Some(&cell), &bounds).unwrap();
        let mut columns = [vec![-1.0, 25.0, 3.0], vec![-1.0, 25.0, 3.0], vec![-1.0, 35.0, 3.0]];
        wrap.apply(&mut columns);
        assert_eq!(columns, [vec![9.0, 5.0, 3.0], vec![19.0, 5.0, 3.0], vec![-1.0, 35.0, 3.0]]);
        assert!(f64::from(wrap.round(0, 10.0 - 1e-12)) < 10.0);
        assert!(PeriodicWrap::new(None, &bounds).is_none());
        assert!(PeriodicWrap::new(Some(&Cell { periodic: [false; 3], ..cell }), &bounds).is_none());
    }

    #[test]
    fn a_snapshot_about_zero_stays_there() {
        let bounds = Bounds { min: [-5.0; 3], max: [5.0; 3] };
        let wrap = PeriodicWrap::new(Some(&Cell::orthogonal([10.0; 3])), &bounds).unwrap();
        let mut columns = [vec![-5.5], vec![4.0], vec![5.5]];
        wrap.apply(&mut columns);
        assert_eq!(columns, [vec![4.5], vec![4.0], vec![-4.5]]);
    }

    #[test]
    fn negative_vectors_and_slabs_wrap_as_upright_boxes() {
        let vectors = [[0.0, 20.0, 0.0], [-10.0, 0.0, 0.0], [0.0; 3]];
        let cell = Cell::stated([0.0; 3], vectors, [true; 3]).unwrap();
        let wrap = PeriodicWrap::new(Some(&cell), &Bounds { min: [-10.0, 0.0, 0.0], max: [0.0, 20.0, 5.0] }).unwrap();
        let mut columns = [vec![3.0], vec![-1.0], vec![50.0]];
        wrap.apply(&mut columns);
        assert_eq!(columns, [vec![-7.0], vec![19.0], vec![50.0]]);
    }

    #[test]
    fn skewed_cells_wrap_along_their_vectors() {
        let cell = Cell {
            origin: [1.0, 0.0, 0.0],
            vectors: [[10.0, 0.0, 0.0], [5.0, 10.0, 0.0], [0.0, 0.0, 10.0]],
            periodic: [true; 3],
        };
        let wrap = PeriodicWrap::new(Some(&cell), &Bounds { min: [0.0; 3], max: [10.0; 3] }).unwrap();
        let mut columns = [vec![3.0], vec![-1.0], vec![5.0]];
        wrap.apply(&mut columns);
        let p = [columns[0][0] - 1.0, columns[1][0], columns[2][0]];
        let inverse = cell.inverse().unwrap();
        for a in 0..3 {
            let fraction: f64 = (0..3).map(|k| p[k] * inverse[k][a]).sum();
            assert!((0.0..1.0).contains(&fraction));
        }
        assert_eq!(columns[1][0], 9.0);
    }
}
