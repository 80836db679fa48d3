//! Density as an OpenDX scalar field, as APBS writes it and VMD, PyMOL and ChimeraX read it: text, values at the
//! middles of the cells, z fastest: <https://apbs.readthedocs.io/en/latest/formats/opendx.html>.

use super::grid::AngstromGrid;
use super::{Density, Notes, RUN, written};
use particlegs_core::Result;
use particlegs_core::context::Context;
use std::path::Path;

/// Values on a line.
const ROW: usize = 3;

pub fn write(density: &Density, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let grid = AngstromGrid::new(density, notes);
    let ([nx, ny, nz], [x, y, z], [dx, dy, dz]) = (density.grid.cells, grid.origin, grid.side);
    let count = density.values.len();
    let comments: String = grid.lines.iter().map(|line| format!("# {line}\n")).collect();
    let head = format!(
        "{comments}object 1 class gridpositions counts {nx} {ny} {nz}\norigin {x} {y} {z}\n\
         delta {dx} 0 0\ndelta 0 {dy} 0\ndelta 0 0 {dz}\nobject 2 class gridconnections counts {nx} {ny} {nz}\n\
         object 3 class array type double rank 0 items {count} data follows\n"
    );
    // A number takes about ten letters.
    written(out, head.len() as u64 + 11 * count as u64, context, |sink| {
        sink.put(head.as_bytes())?;
        let (mut run, mut buffer) = (String::new(), zmij::Buffer::new());
        for values in density.values.chunks(ROW * RUN) {
            sink.check()?;
            for row in values.chunks(ROW) {
                for value in row {
                    run += buffer.format((f64::from(*value) * grid.by) as f32);
                    run.push(' ');
                }
                run.pop();
                run.push('\n');
            }
            sink.put(run.as_bytes())?;
            run.clear();
        }
        sink.put(
            b"attribute \"dep\" string \"positions\"\nobject \"density\" class field\ncomponent \"positions\" value 1\n\
              component \"connections\" value 2\ncomponent \"data\" value 3\n",
        )
    })
}
