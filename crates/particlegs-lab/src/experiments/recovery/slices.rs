//! Slices of the density: truth, recovered particles, and the model itself.

use super::RATIO;
use super::measure::RecoverySource;
use crate::results::{Colours, Pictures};
use particlegs_core::Result;
use particlegs_core::picture::{Colormap, Rgb8, Size};
use particlegs_fit::recover::Method;
use particlegs_measure::stats::{Assignment, Field, Grid, Subject, deposit};
use particlegs_particles::Domain;

/// Mean number of particles in a column of the slab.
const PLANES: usize = 16;
/// Range of colours, log10 of density / mean.
const RANGE: [f64; 2] = [-1.25, 2.0];
const MAP: Colormap = Colormap::Inferno;
/// Smallest width of a picture in pixels.
const WIDTH: usize = 480;

/// log10 of density / mean in the central slab across z.
pub(super) fn pictures(drawn: &RecoverySource<'_>) -> Result<Pictures> {
    let (truth, seed) = (&drawn.snapshot.particles, drawn.lab.settings.seed);
    let domain = Domain::from_particles(truth);
    let grid = Grid::new(&domain, ((truth.len() as f64).cbrt().round() as usize).clamp(2 * PLANES, 512));
    let picture = |subject: Subject<'_>| {
        let field = deposit(subject, &grid, Assignment::Ngp, 0.0, drawn.lab.context)?;
        Ok(painted(&slab(&field), grid.cells))
    };
    let panel = |name: &str, subject: Subject<'_>| Ok((name.to_string(), picture(subject)?));
    let (recovered, model) = (drawn.particles(Method::Count, seed)?, drawn.model()?.0);
    let panels = vec![
        panel("all particles", Subject::Particles(truth))?,
        panel("recovered by count", Subject::Particles(&recovered))?,
        panel("the model itself", Subject::Model(&model))?,
    ];
    Ok(Pictures {
        name: "recovery-slices".into(),
        title: format!("Density in a central slab, ratio {RATIO:.0}"),
        caption: caption(&grid),
        columns: 3,
        colours: Some(Colours {
            title: "density / mean".into(),
            map: MAP,
            range: RANGE.map(|power| 10f64.powf(power)),
        }),
        panels,
    })
}

fn caption(grid: &Grid) -> String {
    format!(
        "Density over its mean on a logarithmic colour scale; lower values are black. {} x {} columns along x and y \
         through {} cells along z in the middle of the box, with about {PLANES} particles each on average; nearest \
         grid point.",
        grid.cells[0],
        grid.cells[1],
        planes(grid.cells).len()
    )
}

fn planes([_, _, nz]: [usize; 3]) -> std::ops::Range<usize> {
    let n = PLANES.min(nz);
    (nz - n) / 2..(nz - n) / 2 + n
}

/// Density / mean of every column of the slab, x slowest.
fn slab(field: &Field) -> Vec<f64> {
    let [nx, ny, nz] = field.grid.cells;
    let mean = field.mass.iter().map(|m| f64::from(*m)).sum::<f64>() / field.mass.len() as f64;
    let range = planes(field.grid.cells);
    let per = 1.0 / (mean * range.len() as f64);
    let column = |c: usize| field.mass[c * nz..][range.clone()].iter().map(|m| f64::from(*m)).sum::<f64>() * per;
    (0..nx * ny).map(column).collect()
}

/// The colour picture, y upwards, each cell a square of pixels.
fn painted(columns: &[f64], [nx, ny, _]: [usize; 3]) -> Rgb8 {
    let by = WIDTH.div_ceil(nx).max(1);
    let size = Size { width: by * nx, height: by * ny };
    let colour = |share: f64| MAP.color(share as f32);
    let mut data = Vec::with_capacity(size.pixels());
    for row in 0..by * ny {
        let y = ny - 1 - row / by;
        data.extend((0..size.width).map(|px| {
            let value = columns[px / by * ny + y].log10();
            colour((value - RANGE[0]) / (RANGE[1] - RANGE[0]))
        }));
    }
    Rgb8 { size, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slab_is_in_units_of_the_mean_and_y_is_up() {
        let grid = Grid::new(&Domain::upright([0.0; 3], [2.0, 2.0, 32.0], [true; 3]), 32);
        // All mass in the column x 0, y 1, within the slab.
        let mut mass = vec![0.0; 128];
        mass[32 + 8..32 + 24].fill(3.0);
        let columns = slab(&Field { grid, mass, outside: 0.0 });
        // 48 in 128 cells is 0.375 a cell; 3 / 0.375.
        assert_eq!(columns, [0.0, 8.0, 0.0, 0.0]);
        let picture = painted(&columns, grid.cells);
        assert_eq!((picture.size.width, picture.size.height), (480, 480));
        let dark = Colormap::Inferno.color(0.0);
        assert_ne!(picture.data[0], dark);
        assert_eq!((picture.data[479], picture.data[300 * 480]), (dark, dark));
    }
}
