//! The headers of Abacus's snapshots, and its packed positions and velocities, as abacusutils unpacks them: the same
//! steps in the same precision.

use super::blocks::AsdfBlock;
use super::tree::TreeValue;
use particlegs_core::model::{Cosmology, Epoch, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Result, parallel};
use particlegs_files::memory;
use particlegs_particles::SnapshotMeta;
use std::ops::Range;
use std::sync::Arc;

/// The header of a file, and what makes files those of one snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AbacusHeader {
    simulation: Option<String>,
    is_light_cone: bool,
    pub box_size: Option<f64>,
    /// From velocities as displacements in redshift space, of a box of length 1, to km/s.
    pub velocity: Option<f64>,
    units: Units,
    pub particle_mass: Option<f64>,
    cosmology: Cosmology,
    scale_factor: Option<f64>,
    /// Particles of the whole simulation.
    pub particles: Option<u64>,
}

impl AbacusHeader {
    pub fn read(header: &TreeValue) -> AbacusHeader {
        let number = |key: &str| header.get(key).and_then(TreeValue::number);
        let positive = |key: &str| number(key).filter(|n| *n > 0.0);
        let text = |key: &str| header.get(key).and_then(TreeValue::text);
        let box_size = positive("BoxSize");
        // The header names no unit: BoxSize is in the one whose own length is the same number.
        let is = |key: &str| box_size.zip(positive(key)).is_some_and(|(l, other)| (l / other - 1.0).abs() < 1e-6);
        let length = ["BoxSizeHMpc", "BoxSizeMpc"].into_iter().zip(["Mpc/h", "Mpc"]).find(|unit| is(unit.0));
        let masses = [(positive("ParticleMassHMsun"), "Msun/h"), (positive("ParticleMassMsun"), "Msun")];
        let mass = masses.into_iter().find(|m| m.0.is_some());
        AbacusHeader {
            simulation: text("SimName").map(String::from),
            is_light_cone: text("OutputType") == Some("LightCone"),
            box_size,
            velocity: positive("VelZSpace_to_kms"),
            units: Units::new(length.map(|unit| unit.1), mass.map(|m| m.1), length.map(|_| true)),
            particle_mass: mass.and_then(|m| m.0),
            cosmology: Cosmology {
                hubble: positive("H0").map(|h| h / 100.0),
                omega_matter: number("Omega_M"),
                omega_lambda: number("Omega_DE"),
                omega_baryon: None,
            },
            scale_factor: positive("ScaleFactor")
                .or_else(|| number("Redshift").filter(|z| *z > -1.0).map(|z| 1.0 / (1.0 + z))),
            particles: header.get("NP").and_then(TreeValue::whole),
        }
    }

    /// Adds what it says of positions in the unit of the box.
    pub fn complete(&self, meta: &mut SnapshotMeta, notes: &mut Vec<String>) {
        (meta.units, meta.cosmology) = (self.units.clone(), self.cosmology);
        if self.is_light_cone {
            notes.push("a light cone: it has no periodic box and no one redshift".into());
            return;
        }
        meta.epoch = Epoch { scale_factor: self.scale_factor, ..Epoch::default() };
        // Abacus has 0 in the middle of the box.
        meta.cell = self.box_size.map(|l| Cell { origin: [-0.5 * l; 3], ..Cell::orthogonal([l; 3]) });
    }
}

/// Position (20 bits) and velocity (12 bits) along an axis, in one whole number; `box_size` gives the position.
pub fn unpack_rvint(value: f64, box_size: Option<f64>) -> f64 {
    let bits = value as i32;
    // Positions are stored in millionths of the box; the shift keeps their sign. Velocities span 6000 km/s either way.
    let unpacked = match box_size {
        Some(length) => f64::from(bits >> 12) * (length / 1e6),
        None => f64::from((bits & 0xfff) - 2048) * (6000.0 / 2048.0),
    };
    f64::from(unpacked as f32)
}

/// Bytes of a row of pack9: a particle, or a cell that those behind it are in.
pub const PACK9: u64 = 9;
/// The difference between the numbers of a cell and what is stored.
const OFFSET: f64 = 2000.0;
/// Rows of a stretch.
const STRETCH: u64 = 1 << 16;

type Pack9Row = [u8; PACK9 as usize];

fn is_cell(row: &Pack9Row) -> bool {
    row[0] == 0xff
}

/// Six numbers of 12 bits.
fn shorts(c: &Pack9Row) -> [i16; 6] {
    let pair = |c: [u8; 3]| {
        let [a, b, c] = c.map(i16::from);
        [(b & 0x0f | a << 4) - 2048, ((b & 0xf0) << 4 | c) - 2048]
    };
    let [[a, b], [c, d], [e, f]] = [pair([c[0], c[1], c[2]]), pair([c[3], c[4], c[5]]), pair([c[6], c[7], c[8]])];
    [a, b, c, d, e, f]
}

/// A cell of pack9: what its particles' numbers are multiplied by, and its middle.
#[derive(Clone, Copy)]
struct Pack9Cell {
    position: f32,
    velocity: f32,
    middle: [f32; 3],
}

/// Particles in rows of 9 bytes.
pub struct Pack9 {
    block: Arc<AsdfBlock>,
    /// First byte, and rows.
    start: u64,
    rows: u64,
    box_size: f32,
    velocity: f32,
    /// Particles before each stretch and in all, and the cell that each stretch begins in.
    before: Vec<u64>,
    cells: Vec<Pack9Row>,
}

impl Pack9 {
    /// `rows` rows from byte `start` of a block, which has them; reads them once for their cells.
    pub fn open(block: Arc<AsdfBlock>, start: u64, rows: u64, box_size: f64, velocity: f64) -> Result<Pack9> {
        let stretches = rows.div_ceil(STRETCH);
        memory::require("the cells of the particles", 32 * stretches)?;
        let (box_size, velocity) = (box_size as f32, velocity as f32);
        let mut pack = Pack9 { block, start, rows, box_size, velocity, before: vec![0], cells: Vec::new() };
        // Particles of a stretch, and its last cell.
        let scan = |stretch: usize| {
            let (mut particles, mut cell) = (0, None);
            pack.each_row(stretch as u64, |row| {
                match is_cell(row) {
                    true => cell = Some(*row),
                    false => particles += 1,
                }
                Ok(true)
            })?;
            Ok((particles, cell))
        };
        let scanned: Vec<(u64, Option<Pack9Row>)> = parallel::try_map_range(stretches as usize, scan)?;
        // No cell begins with 0: a particle before the first one is refused when it is read.
        let mut cell = [0; PACK9 as usize];
        for (particles, last) in scanned {
            pack.before.push(pack.before[pack.before.len() - 1] + particles);
            pack.cells.push(cell);
            cell = last.unwrap_or(cell);
        }
        Ok(pack)
    }

    pub fn particles(&self) -> u64 {
        self.before[self.before.len() - 1]
    }

    /// Calls `each` with the rows of a stretch, as long as it says true.
    fn each_row(&self, stretch: u64, mut each: impl FnMut(&Pack9Row) -> Result<bool>) -> Result<()> {
        let [first, end] = [stretch * STRETCH, self.rows.min((stretch + 1) * STRETCH)];
        let bytes = self.block.read(self.start + PACK9 * first..self.start + PACK9 * end)?;
        for row in bytes.as_chunks().0 {
            if !each(row)? {
                break;
            }
        }
        Ok(())
    }

    /// The cell of a row that begins one: six numbers of 12 bits, of which all but the mark are stored less 2000. Numbers of
    /// particles are in 2000ths of a cell. Single and double precision as abacusutils has them.
    fn cell(&self, row: &Pack9Row) -> Result<Pack9Cell> {
        let [_mark, per_edge, velocity_scale, x, y, z] = shorts(row).map(|n| f64::from(n) + OFFSET);
        if !is_cell(row) || per_edge < 1.0 {
            let message =
                if is_cell(row) { "a cell of pack9 is damaged" } else { "a particle comes before the first cell" };
            return Err(self.block.fault(message.into()));
        }
        let inverse = (1.0 / per_edge) as f32;
        let size = self.box_size * inverse;
        let half = f64::from(self.box_size) / 2.0;
        Ok(Pack9Cell {
            position: (0.0005 * f64::from(size)) as f32,
            velocity: (velocity_scale * 0.0005) as f32 * inverse * self.velocity,
            middle: [x, y, z].map(|n| ((n + 0.5) * f64::from(size) - half) as f32),
        })
    }

    /// Appends components of particles: 0 to 2 of positions, 3 to 5 of velocities.
    pub fn append(&self, particles: Range<u64>, component: usize, out: &mut Vec<f64>) -> Result<()> {
        let mut stretch = self.before.partition_point(|&n| n <= particles.start).saturating_sub(1);
        while stretch < self.cells.len() && self.before[stretch] < particles.end {
            let mut particle = self.before[stretch];
            // The cell of the first particles may begin in a stretch before this one.
            let mut stored = self.cells[stretch];
            let mut cell = None;
            self.each_row(stretch as u64, |row| {
                if is_cell(row) {
                    (stored, cell) = (*row, None);
                    return Ok(true);
                }
                if particle >= particles.start {
                    let cell = match cell {
                        Some(known) => known,
                        None => *cell.insert(self.cell(&stored)?),
                    };
                    let value = f32::from(shorts(row)[component]);
                    out.push(f64::from(match component {
                        0..3 => value * cell.position + cell.middle[component],
                        _ => value * cell.velocity,
                    }));
                }
                particle += 1;
                Ok(particle < particles.end)
            })?;
            stretch += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_where_abacus_has_them() {
        assert_eq!(shorts(&[0x80, 0x00, 0, 0x80, 0x80, 0, 0xff, 0xff, 0xff]), [0, -2048, 0, 0, 2047, 2047]);
        let packed = f64::from((-250_000 << 12) | (2048 + 1024));
        assert_eq!(unpack_rvint(packed, Some(32.0)), -8.0);
        assert_eq!(unpack_rvint(packed, None), 3000.0);
    }
}
