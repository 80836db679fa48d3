//! Density as an MRC2014 map, which CCP4's are: float32, x fastest, the cell in Angstrom:
//! <https://www.ccpem.ac.uk/mrc-format/mrc2014/>.

use super::grid::AngstromGrid;
use super::{Density, Notes, written};
use particlegs_core::Result;
use particlegs_core::context::Context;
use std::path::Path;

const HEADER: usize = 1024;
/// The place of the first label, and the bytes of one; there may be ten.
const LABELS: usize = 224;
const LABEL: usize = 80;

pub fn write(density: &Density, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let grid = AngstromGrid::new(density, notes);
    let head = head(density, &grid);
    written(out, (HEADER + 4 * density.values.len()) as u64, context, |sink| {
        sink.put(&head)?;
        density.for_each_run(&[&density.values], |run| {
            sink.check()?;
            let values = run.iter().flat_map(|v| ((f64::from(*v) * grid.by) as f32).to_le_bytes());
            sink.put(&values.collect::<Vec<u8>>())
        })
    })
}

fn head(density: &Density, grid: &AngstromGrid) -> Vec<u8> {
    let cells = density.grid.cells;
    let values = || density.values.iter().map(|v| f64::from(*v) * grid.by);
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    let mean = values().sum::<f64>() / density.values.len() as f64;
    let deviation = (values().map(|v| (v - mean).powi(2)).sum::<f64>() / density.values.len() as f64).sqrt();
    let text = grid.lines.join("; ");
    let text = &text.as_bytes()[..text.len().min(10 * LABEL)];
    let mut head = vec![0; HEADER];
    // Words are counted from 1.
    let mut put = |word: usize, bytes: [u8; 4]| head[4 * (word - 1)..4 * word].copy_from_slice(&bytes);
    // Sizes of the array and of the cell, its edges and angles, the order of axes, the origin.
    for k in 0..3 {
        put(1 + k, (cells[k] as u32).to_le_bytes());
        put(8 + k, (cells[k] as u32).to_le_bytes());
        put(11 + k, ((cells[k] as f64 * grid.side[k]) as f32).to_le_bytes());
        put(14 + k, 90f32.to_le_bytes());
        put(17 + k, (1 + k as u32).to_le_bytes());
        put(50 + k, (grid.origin[k] as f32).to_le_bytes());
    }
    // Float32; a volume; the version of the format.
    for (word, number) in [(4, 2u32), (23, 1), (28, 20_141), (56, text.len().div_ceil(LABEL) as u32)] {
        put(word, number.to_le_bytes());
    }
    for (word, number) in [(20, low), (21, high), (22, mean), (55, deviation)] {
        put(word, (number as f32).to_le_bytes());
    }
    put(53, *b"MAP ");
    // Little-endian.
    put(54, [0x44, 0x44, 0, 0]);
    head[LABELS..LABELS + text.len()].copy_from_slice(text);
    head[LABELS + text.len()..].fill(b' ');
    head
}
