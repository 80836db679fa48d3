//! Surface density of all particles: mass along the line of sight for an area.

use particlegs_core::camera::{CenteredCell, DensityView, Projection};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::memory::filled;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::space::Bounds;
use particlegs_core::{Result, parallel};
use particlegs_files::memory::require;
use particlegs_particles::{Chunk, ChunkBuffer, Particles};

/// Particles in one task, and tasks in one round; fixed, so that sums do not depend on threads.
const CHUNK: usize = 1 << 16;
const ROUND: usize = 64;
/// Rows that one task adds up.
const BAND: usize = 32;

/// Deposits of one chunk: (pixel of the band, mass) by band.
type Deposits = Vec<Vec<(u32, f32)>>;

/// The projection of particles to pixels.
pub(super) struct PointProjector {
    /// Right, down, forward.
    axes: [[f64; 3]; 3],
    /// The eye, relative to the particles' origin.
    position: [f64; 3],
    perspective: bool,
    focal: f64,
    range: [f64; 2],
    size: Size,
    unit_mass: f64,
    /// The cell into which every particle is moved.
    cell: Option<CenteredCell>,
    origin: [f64; 3],
}

pub(super) struct ProjectedPoint {
    /// Pixels from the left and from the top.
    pub x: f64,
    pub y: f64,
    /// Pixels a world unit at its depth.
    pub scale: f64,
}

impl PointProjector {
    pub fn new(particles: &Particles, view: &DensityView, size: Size) -> Result<Self> {
        let frame = view.camera.frame()?;
        let [right, up, back] = frame.axes;
        Ok(PointProjector {
            axes: [right, up.map(|v| -v), back.map(|v| -v)],
            position: each_axis(|k| frame.position[k] - particles.origin[k]),
            perspective: matches!(view.camera.projection, Projection::Perspective { .. }),
            focal: view.camera.focal_pixels(size),
            range: view.range,
            size,
            unit_mass: particles.meta.particle_mass.unwrap_or(1.0),
            cell: view.centered_cell(),
            origin: particles.origin,
        })
    }

    /// Calls `visit` with every particle of a chunk whose centre, moved by `shift`, is in the range of depths.
    #[inline(always)]
    pub fn each(&self, chunk: &Chunk<'_>, shift: &[f64; 3], mut visit: impl FnMut(usize, ProjectedPoint)) {
        let eye: [f64; 3] = each_axis(|k| self.position[k] - shift[k]);
        let [xs, ys, zs] = chunk.position;
        for i in 0..chunk.len() {
            let at = [xs[i], ys[i], zs[i]].map(f64::from);
            let mut v: [f64; 3] = each_axis(|k| at[k] - eye[k]);
            if let Some(cell) = &self.cell {
                let shift = cell.shift(each_axis(|k| self.origin[k] + at[k]));
                v = each_axis(|k| v[k] + shift[k]);
            }
            let [x, y, depth] = self.axes.map(|a| a[0] * v[0] + a[1] * v[1] + a[2] * v[2]);
            // In this form the test leaves out NaN as well.
            if !(depth >= self.range[0] && depth < self.range[1]) {
                continue;
            }
            let scale = if self.perspective { self.focal / depth } else { self.focal };
            let [x, y] = [0.5 * self.size.width as f64 + scale * x, 0.5 * self.size.height as f64 + scale * y];
            visit(i, ProjectedPoint { x, y, scale });
        }
    }

    #[inline(always)]
    pub fn mass(&self, chunk: &Chunk<'_>, i: usize) -> f64 {
        self.unit_mass * chunk.weight.map_or(1.0, |w| f64::from(w[i]))
    }

    /// Pixels a world unit, at most.
    pub fn largest_scale(&self) -> f64 {
        if self.perspective { self.focal / self.range[0] } else { self.focal }
    }
}

/// Each particle's mass over the area of the pixel that it falls in.
pub(super) fn unsmoothed(
    particles: &Particles,
    bounds: &Bounds,
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
) -> Result<Plane> {
    let sight = PointProjector::new(particles, view, size)?;
    let shifts = view.copies(size, bounds, 0.0)?;
    let n = particles.len();
    require("a picture", 12 * size.pixels() as u64)?;
    let mut sums = filled("a picture", 0.0f64, size.pixels(), context)?;
    context.begin("surface density", n as u64);
    let buffers = parallel::Scratch::<ChunkBuffer>::default();
    for round in (0..n).step_by(CHUNK * ROUND) {
        context.check()?;
        let end = n.min(round + CHUNK * ROUND);
        let deposits: Vec<Deposits> = parallel::map((round..end).step_by(CHUNK), |start| {
            buffers.with(|buffer| sight.deposit(&particles.chunk(start..end.min(start + CHUNK), buffer), &shifts))
        });
        // Each task owns a band and adds the chunks in their order: threads change no bit.
        parallel::for_each_chunk(&mut sums, BAND * size.width, |band, sums| {
            for chunk in &deposits {
                for &(pixel, mass) in &chunk[band] {
                    sums[pixel as usize] += f64::from(mass);
                }
            }
        });
        context.advance((end - round) as u64);
    }
    context.end();
    Ok(Plane { size, data: sums.into_iter().map(|v| v as f32).collect() })
}

impl PointProjector {
    fn deposit(&self, chunk: &Chunk<'_>, shifts: &[[f64; 3]]) -> Deposits {
        let Size { width, height } = self.size;
        let mut out: Deposits = vec![Vec::new(); height.div_ceil(BAND)];
        for shift in shifts {
            self.each(chunk, shift, |i, ProjectedPoint { x, y, scale }| {
                if x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64 {
                    let (column, row) = (x as usize, y as usize);
                    // At this depth a pixel is 1 / scale world units wide.
                    let density = self.mass(chunk, i) * scale * scale;
                    out[row / BAND].push((((row % BAND) * width + column) as u32, density as f32));
                }
            });
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::Window;

    use crate::Reference;
    use particlegs_core::context::Context;
    use particlegs_core::space::Cell;
    use particlegs_particles::testing::{from_points, poisson};

    /// A window of one box holds all mass, wherever its centre is; half of a box's depth half.
    #[test]
    fn mass_is_conserved_in_a_periodic_window() {
        let particles = poisson(5000, [2.0; 3], 3);
        let bounds = Bounds { min: [0.0; 3], max: [2.0; 3] };
        let size = Size { width: 64, height: 64 };
        for center in [[1.0, 1.0, 1.0], [0.2, 1.9, -3.7]] {
            let view = |depth| {
                let cell = Some(Cell::orthogonal([2.0; 3]));
                let window = Window { center, angles_deg: [0.0; 2], width: 2.0, depth };
                DensityView::orthographic("v", &window, size, &bounds, cell).unwrap()
            };
            let mass = |depth| {
                let plane = Reference::new(&particles).surface_density(&view(depth), size, &Context::SILENT).unwrap();
                plane.data.iter().map(|v| f64::from(*v)).sum::<f64>() * (2.0f64 / 64.0).powi(2)
            };
            assert!((mass(None) - 5000.0).abs() < 5.0, "{}", mass(None));
            assert!((mass(Some(4.0)) - 10_000.0).abs() < 10.0);
            assert!((mass(Some(1.0)) - 2500.0).abs() < 200.0);
        }
    }

    /// Boxes of any shape, upright or tilted, from every side and obliquely: the map that shows all of a box has every
    /// particle once, those on its faces with it.
    #[test]
    fn maps_of_whole_boxes_have_every_particle_once() {
        use particlegs_core::camera::{Extent, spherical_camera};
        let tilted =
            Cell { vectors: [[10.0, 0.0, 0.0], [4.0, 9.0, 0.0], [2.0, 3.0, 8.0]], ..Cell::orthogonal([1.0; 3]) };
        let upright = [[1.0, 1.0, 1.0], [2.0, 1.0, 0.5], [4.0, 2.0, 1.0], [0.3, 0.7, 90.1]].map(Cell::orthogonal);
        let slab = Cell { periodic: [true, true, false], ..upright[1] };
        for cell in upright.into_iter().chain([tilted, slab]) {
            // A lattice that has particles on the lower faces, and in the middle.
            let particles = from_points((0..1000).map(|i| {
                let f = [i % 10, i / 10 % 10, i / 100].map(|n| f64::from(n) / 10.0);
                each_axis(|k| (0..3).map(|a| f[a] * cell.vectors[a][k]).sum::<f64>())
            }));
            let reference = Reference::new(&particles);
            let (bounds, extent) = (*reference.bounds(), Extent::new(reference.bounds(), Some(&cell)));
            for angles_deg in
                [[0.0, 0.0], [90.0, 0.0], [180.0, 0.0], [270.0, 0.0], [0.0, 90.0], [0.0, -90.0], [30.0, 20.0]]
            {
                for (size, center) in [([160, 90], extent.center), ([64, 64], [0.1, -7.0, 0.2])] {
                    let size = Size { width: size[0], height: size[1] };
                    let frame = spherical_camera([0.0; 3], angles_deg[0], angles_deg[1], 1.0).frame().unwrap();
                    let width = extent.width(&frame, size);
                    let center = if cell.periodic[2] { center } else { extent.center };
                    let window = Window { center, angles_deg, width, depth: None };
                    let view = DensityView::orthographic("v", &window, size, &bounds, Some(cell)).unwrap();
                    let plane = reference.surface_density(&view, size, &Context::SILENT).unwrap();
                    let mass = plane.data.iter().map(|v| f64::from(*v)).sum::<f64>();
                    let count = mass * (width / size.width as f64).powi(2);
                    assert!((count / 1000.0 - 1.0).abs() < 1e-6, "{cell:?} {angles_deg:?}: {count}");
                }
            }
        }
    }
}
