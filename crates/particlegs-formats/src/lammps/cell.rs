//! The box of a dump, in its three spellings: <https://docs.lammps.org/Howto_triclinic.html>.

use crate::text::snapshot::header_number;
use crate::text::split::{Separator, tokens};
use particlegs_core::space::Cell;

#[derive(Clone, Debug, Default)]
pub struct LammpsBox {
    pub origin: [f64; 3],
    pub vectors: [[f64; 3]; 3],
    /// Whether each of them repeats.
    pub periodic: [bool; 3],
    pub notes: Vec<String>,
}

#[derive(Clone, Copy)]
pub enum BoxShape {
    /// lo and hi.
    Orthogonal,
    /// lo and hi of the box around the cell, and tilt factors xy, xz, yz.
    Triclinic,
    /// Cell vectors, and the origin's components behind them.
    General,
}

/// The shape, and the boundary flags where there are some.
pub fn shape(words: &[&str]) -> (BoxShape, [bool; 3], bool) {
    let (shape, flags) = match words {
        ["xy", "xz", "yz", flags @ ..] => (BoxShape::Triclinic, flags),
        ["abc", "origin", flags @ ..] => (BoxShape::General, flags),
        flags => (BoxShape::Orthogonal, flags),
    };
    let periodic = |k: usize| flags.get(k).is_some_and(|flag| *flag == "pp");
    (shape, [periodic(0), periodic(1), periodic(2)], flags.len() >= 3)
}

impl LammpsBox {
    /// From the words behind `BOX BOUNDS` and the three lines below.
    pub fn new(words: &[&str], lines: &[Vec<u8>; 3]) -> Result<Self, String> {
        let (shape, periodic, stated) = shape(words);
        let mut rows = [[0.0; 4]; 3];
        for (row, line) in rows.iter_mut().zip(lines) {
            let all = tokens(line, Separator::Blanks);
            let need = match shape {
                BoxShape::Orthogonal => 2,
                BoxShape::Triclinic => 3,
                BoxShape::General => 4,
            };
            if all.len() < need {
                return Err(format!("{} numbers instead of {need}", all.len()));
            }
            for (value, token) in row.iter_mut().zip(&all[..need]) {
                *value = header_number(token)?;
            }
        }
        let mut bounds = match shape {
            BoxShape::Orthogonal => Self::tilted(rows.map(|r| [r[0], r[1]]), [0.0; 3])?,
            BoxShape::Triclinic => Self::tilted(rows.map(|r| [r[0], r[1]]), rows.map(|r| r[2]))?,
            BoxShape::General => LammpsBox {
                origin: rows.map(|r| r[3]),
                vectors: rows.map(|r| [r[0], r[1], r[2]]),
                ..LammpsBox::default()
            },
        };
        bounds.periodic = periodic;
        if !stated {
            bounds.notes.push("the file does not say which sides are periodic: assuming none".into());
        }
        if bounds.cell().is_none() {
            bounds.notes.push("the box has no volume and is ignored".into());
        }
        Ok(bounds)
    }

    /// From the bounds of the cell's corners and its tilt factors xy, xz, yz.
    fn tilted(around: [[f64; 2]; 3], [xy, xz, yz]: [f64; 3]) -> Result<Self, String> {
        let least = |shifts: &[f64]| shifts.iter().fold(0.0, |a: f64, &b| a.min(b));
        let most = |shifts: &[f64]| shifts.iter().fold(0.0, |a: f64, &b| a.max(b));
        let shifts: [&[f64]; 3] = [&[xy, xz, xy + xz], &[yz], &[]];
        let low: [f64; 3] = std::array::from_fn(|k| around[k][0] - least(shifts[k]));
        let length: [f64; 3] = std::array::from_fn(|k| (around[k][1] - most(shifts[k])) - low[k]);
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            if around[k][0] > around[k][1] {
                let [low, high] = around[k];
                return Err(format!("the box is inverted: {axis} runs from {low} to {high}"));
            }
            if !(length[k] >= 0.0 && length[k].is_finite()) {
                return Err(format!("the box is inverted: its length along {axis} is {}", length[k]));
            }
        }
        let vectors = [[length[0], 0.0, 0.0], [xy, length[1], 0.0], [xz, yz, length[2]]];
        Ok(LammpsBox { origin: low, vectors, ..LammpsBox::default() })
    }

    pub fn cell(&self) -> Option<Cell> {
        Cell::stated(self.origin, self.vectors, self.periodic)
    }
}
