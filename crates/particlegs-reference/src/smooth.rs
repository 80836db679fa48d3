//! Surface density with adaptive kernels: every particle is a disc.
//!
//! Discs are sorted into bands of rows and added in particle order, so that sums do not depend on threads; those
//! of many pixels go to coarser planes, which are interpolated up: each costs a few hundred samples at most.

use super::bands::{BandSorter, BandedSplats};
use super::density::{PointProjector, ProjectedPoint};
use super::kernel::{Disc, KernelTable, LARGEST, RowSums};
use super::pyramid::Pyramid;
use particlegs_core::camera::DensityView;
use particlegs_core::context::Context;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::memory::require;
use particlegs_particles::{CHUNK, Chunk, Particles};
use std::ops::Range;

/// Chunks of particles whose discs are held at a time.
const CHUNKS_AT_ONCE: usize = 32;
/// Bytes that a disc takes while it is sorted into two bands, and they grow.
const DISC_BYTES: u64 = 96;
/// Halvings of the coarsest plane. A disc that is too large even for that is all about the eye, and thinner than
/// anything: it is left out.
const MOST_LEVELS: i32 = 30;

/// Each particle's mass spread by its kernel, whose support radius is `radii[i]`.
pub(super) fn smoothed(
    particles: &Particles,
    bounds: &Bounds,
    radii: &[f32],
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
) -> Result<Plane> {
    let radii = SupportRadii { radii, largest: f64::from(radii.iter().copied().fold(0.0, f32::max)) };
    let largest = radii.largest;
    let tails = |cell: &Cell| cell.vectors.map(|v| 2.0 * largest / v.iter().map(|x| x * x).sum::<f64>().sqrt());
    view.wrapped(size, tails, |view, size| drawn(particles, bounds, radii, view, size, context))
}

/// The support radius of each particle's kernel, world units.
#[derive(Clone, Copy)]
struct SupportRadii<'a> {
    radii: &'a [f32],
    largest: f64,
}

fn drawn(
    particles: &Particles,
    bounds: &Bounds,
    SupportRadii { radii, largest }: SupportRadii<'_>,
    view: &DensityView,
    size: Size,
    context: &Context<'_>,
) -> Result<Plane> {
    let sight = PointProjector::new(particles, view, size)?;
    let shifts = view.copies(size, bounds, largest)?;
    let chunks = particles.len().div_ceil(CHUNK);
    let held = particles.len().min(CHUNKS_AT_ONCE * CHUNK) as u64;
    // Planes of halved resolution, and the finest turned.
    require("a picture", 10 * size.pixels() as u64 + DISC_BYTES * held)?;
    let mut pyramid = Pyramid::new(size, level(largest * sight.largest_scale()).unwrap_or(MOST_LEVELS) as usize);
    let discs = Discs { particles, radii, sight, size };
    let kernel = KernelTable::new();
    let rounds = chunks.div_ceil(CHUNKS_AT_ONCE);
    context.begin("surface density", (shifts.len() * (chunks + rounds * pyramid.bands())) as u64);
    for shift in &shifts {
        for first in (0..chunks).step_by(CHUNKS_AT_ONCE) {
            let sorted = discs.sorted(first..chunks.min(first + CHUNKS_AT_ONCE), shift, &pyramid, context)?;
            add(&kernel, &sorted, &mut pyramid, context)?;
        }
    }
    context.end();
    Ok(pyramid.collapse())
}

/// Adds discs of chunks to all planes, summing in f64.
fn add(
    kernel: &KernelTable,
    sorted: &[BandedSplats<Disc>],
    pyramid: &mut Pyramid,
    context: &Context<'_>,
) -> Result<()> {
    let scratch = parallel::Scratch::<Vec<f64>>::default();
    parallel::try_for_each(pyramid.bands_mut(), |(band, _, rows)| {
        scratch.with(|data| {
            data.clear();
            data.extend(rows.data.iter().map(|v| f64::from(*v)));
            let mut sums = RowSums { data, width: rows.width, corner: rows.corner };
            for chunk in sorted {
                context.check()?;
                chunk.band(band).iter().for_each(|disc| kernel.add(disc, &mut sums));
            }
            rows.data.iter_mut().zip(sums.data).for_each(|(to, sum)| *to = *sum as f32);
            Ok::<_, Error>(())
        })?;
        context.advance(1);
        Ok(())
    })
}

struct Discs<'a> {
    particles: &'a Particles,
    radii: &'a [f32],
    sight: PointProjector,
    size: Size,
}

impl Discs<'_> {
    /// The discs of some chunks, moved by `shift`, by chunk and band.
    fn sorted(
        &self,
        chunks: Range<usize>,
        shift: &[f64; 3],
        pyramid: &Pyramid,
        context: &Context<'_>,
    ) -> Result<Vec<BandedSplats<Disc>>> {
        let n = self.particles.len();
        let buffers = parallel::Scratch::default();
        parallel::try_map(chunks, |c| {
            context.check()?;
            let range = c * CHUNK..n.min((c + 1) * CHUNK);
            let radii = &self.radii[range.clone()];
            let sorted = buffers.with(|buffer| self.sort(&self.particles.chunk(range, buffer), radii, shift, pyramid));
            context.advance(1);
            Ok::<_, Error>(sorted)
        })
    }

    fn sort(&self, chunk: &Chunk<'_>, radii: &[f32], shift: &[f64; 3], pyramid: &Pyramid) -> BandedSplats<Disc> {
        let mut sorter = BandSorter::default();
        let (width, height) = (self.size.width as f64, self.size.height as f64);
        self.sight.each(chunk, shift, |i, ProjectedPoint { x, y, scale }| {
            let radius = f64::from(radii[i]) * scale;
            // Rows of planes go upward. A coarse plane reaches beyond the picture, by less than half a radius.
            let (y, reach) = (height - y, 1.5 * radius);
            let inside = x + reach >= 0.0 && x - reach < width && y + reach >= 0.0 && y - reach < height;
            let Some(level) = level(radius).filter(|_| inside) else { return };
            let coarser = 0.5f64.powi(level);
            // Where the disc's plane has pixels of a picture's, to the power of two.
            let density = self.sight.mass(chunk, i) * (scale * coarser) * (scale * coarser);
            let [first, end] = pyramid.bands_of(level as usize, y as f32, radius as f32);
            let [x, y, radius] = [x, y, radius].map(|v| (v * coarser) as f32);
            sorter.push(Disc { x, y, radius, density: density as f32 }, first, end);
        });
        sorter.sort(pyramid.bands())
    }
}

/// The plane that a disc of a radius in pixels goes to: the finest where it is not too large.
fn level(radius: f64) -> Option<i32> {
    // A little less, so that no radius is above the kernel's limit once it is float32.
    let most = 0.999 * f64::from(LARGEST);
    (0..=MOST_LEVELS).find(|level| radius * 0.5f64.powi(*level) <= most)
}

#[cfg(test)]
mod tests {
    use super::super::kernel::projected;
    use crate::Reference;
    use particlegs_core::camera::{DensityView, Images, Window, base_distance, spherical_camera};
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;
    use particlegs_core::picture::{Plane, Size};
    use particlegs_core::space::{Bounds, Cell};
    use particlegs_core::{Error, Result};
    use particlegs_particles::Particles;
    use particlegs_particles::testing::{cancelled, on_threads};

    const BOX: Bounds = Bounds { min: [0.0; 3], max: [2.0; 3] };
    const SIZE: Size = Size { width: 64, height: 64 };

    /// Even particles in the box, `clumped` of them squeezed into a corner.
    fn cloud(n: usize, clumped: usize) -> Particles {
        let draw = |axis: u32| -> Vec<f32> {
            (0..n)
                .map(|i| Random::new(3, axis, i as u64).uniform() as f32 * if i < clumped { 0.05 } else { 2.0 })
                .collect()
        };
        let mut particles = Particles::from_columns(draw(0), draw(1), draw(2));
        particles.meta.cell = Some(Cell::orthogonal([2.0; 3]));
        particles
    }

    fn window(center: [f64; 3], width: f64, depth: Option<f64>, cell: Option<Cell>) -> DensityView {
        let window = Window { center, angles_deg: [0.0; 2], width, depth };
        DensityView::orthographic("v", &window, SIZE, &BOX, cell).unwrap()
    }

    fn smoothed(particles: &Particles, neighbours: usize, view: &DensityView) -> Plane {
        let reference = Reference::new(particles).smoothed(neighbours, &Context::SILENT).unwrap();
        reference.surface_density(view, SIZE, &Context::SILENT).unwrap()
    }

    fn mass(plane: &Plane, pixel: f64) -> f64 {
        plane.data.iter().map(|v| f64::from(*v)).sum::<f64>() * pixel * pixel
    }

    /// Wherever the window's centre is, in one that is larger than the box too, and from discs of a part of a pixel to
    /// discs of the picture.
    #[test]
    fn mass_is_kept_in_a_periodic_window() {
        let mut particles = cloud(5000, 1000);
        particles.meta.particle_mass = Some(7.0);
        for neighbours in [2, 16, 300, 4999] {
            // Ends of discs that are seen are clipped where their interpolation undershoots.
            for (center, width, allowed) in
                [([1.0; 3], 2.0, 1e-5), ([0.2, 1.9, -3.7], 2.0, 1e-5), ([1.0; 3], 2.7, 1e-4)]
            {
                let plane = smoothed(&particles, neighbours, &window(center, width, None, particles.meta.cell));
                let off = mass(&plane, width / 64.0) / 35_000.0 - 1.0;
                assert!(off.abs() < allowed, "{neighbours} neighbours about {center:?}, {width} across: {off}");
            }
        }
        // Weights count, and centres alone say what is in a slab.
        let slab = |reference: Reference| {
            let view = window([1.0; 3], 2.0, Some(1.0), particles.meta.cell);
            mass(&reference.surface_density(&view, SIZE, &Context::SILENT).unwrap(), 2.0 / 64.0)
        };
        let reference = || Reference::new(&particles);
        let off = slab(reference().smoothed(16, &Context::SILENT).unwrap()) / slab(reference()) - 1.0;
        assert!(off.abs() < 1e-5, "{off}");
    }

    #[test]
    fn an_even_cloud_is_flat() {
        let particles = cloud(20_000, 0);
        let view = window([1.0; 3], 2.0, None, particles.meta.cell);
        let scatter = |plane: &Plane| {
            let mean = 20_000.0 / 4.0;
            let square = |v: &f32| (f64::from(*v) / mean - 1.0).powi(2);
            (plane.data.iter().map(square).sum::<f64>() / plane.data.len() as f64).sqrt()
        };
        // Points: 4.9 a pixel. Kernels of n neighbours: some tens of n^(2/3) particles in each column.
        let points = scatter(&Reference::new(&particles).surface_density(&view, SIZE, &Context::SILENT).unwrap());
        let [some, many] = [16, 128].map(|n| scatter(&smoothed(&particles, n, &view)));
        assert!((points - 0.45).abs() < 0.02 && some < 0.13 && many < 0.07, "{points} {some} {many}");
    }

    /// Coarse planes, parts of pixels and all: against means of the kernel itself over the pixels.
    #[test]
    fn pixels_hold_the_projected_kernel() {
        const PARTS: usize = 4;
        let particles = cloud(100, 0);
        for (neighbours, width, allowed) in [(4, 16.0, 0.02), (8, 5.0, 0.02), (8, 2.0, 0.02), (80, 2.0, 0.001)] {
            let reference = Reference::new(&particles).smoothed(neighbours, &Context::SILENT).unwrap();
            let radii = reference.radii.as_ref().unwrap();
            let plane =
                reference.surface_density(&window([1.0; 3], width, None, None), SIZE, &Context::SILENT).unwrap();
            let place = |k: usize| (k as f64 + 0.5) / PARTS as f64;
            let (mut worst, mut largest) = (0.0f64, 0.0f64);
            for (at, value) in plane.data.iter().enumerate() {
                let density = |k: usize| -> f64 {
                    let pixel = [(at % 64) as f64 + place(k % PARTS), 64.0 - (at / 64) as f64 - place(k / PARTS)];
                    let here = pixel.map(|v| 1.0 + (v / 64.0 - 0.5) * width);
                    let one = |i: usize| {
                        let ([x, y, _], radius) = (particles.position(i), f64::from(radii[i]));
                        let square = ((x - here[0]).powi(2) + (y - here[1]).powi(2)) / (radius * radius);
                        if square < 1.0 { projected(square) / (radius * radius) } else { 0.0 }
                    };
                    (0..100).map(one).sum()
                };
                let mean = (0..PARTS * PARTS).map(density).sum::<f64>() / (PARTS * PARTS) as f64;
                (worst, largest) = (worst.max((f64::from(*value) - mean).abs()), largest.max(mean));
            }
            println!("{neighbours} neighbours, {width} across: off by {:.1e} of {largest}", worst / largest);
            assert!(worst < allowed * largest, "{neighbours} neighbours: off by {worst} of {largest}");
        }
    }

    /// A sheet across the line of sight, partly outside the picture.
    #[test]
    fn perspective_keeps_mass_at_its_depth() {
        let flat = cloud(2000, 0);
        let column = |k: usize| (0..2000).map(|i| flat.position(i)[k] as f32).collect();
        let sheet = Particles::from_columns(column(0), column(1), vec![1.0; 2000]);
        let mut camera = spherical_camera([1.0; 3], 0.0, 0.0, base_distance(&BOX, SIZE));
        for (distance, whole) in [(1.5 * base_distance(&BOX, SIZE), true), (0.7, false)] {
            camera.position = [1.0, 1.0, 1.0 + distance];
            let view = DensityView { name: "v".into(), camera, range: [0.1, 100.0], images: Images::Own };
            let pixel = distance / camera.focal_pixels(SIZE);
            let plane = smoothed(&sheet, 32, &view);
            let share = mass(&plane, pixel) / 2000.0;
            let expected = if whole { 1.0 } else { (64.0 * pixel / 2.0).powi(2) };
            assert!((share / expected - 1.0).abs() < if whole { 1e-5 } else { 0.2 }, "{distance}: {share} {expected}");
        }
    }

    #[test]
    fn threads_change_no_bit() {
        let particles = cloud(200_000, 50_000);
        let view = window([0.1, 0.3, 1.0], 1.3, Some(1.1), particles.meta.cell);
        let bits = || smoothed(&particles, 20, &view).data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let many = on_threads(5, bits);
        let one = on_threads(1, bits);
        assert!(many == one);
    }

    /// Many at one place are points; a view from inside a disc, and one far away.
    #[test]
    fn odd_clouds_and_views_draw() {
        let one_place = Particles::from_columns(vec![1.0; 9], vec![1.0; 9], vec![1.0; 9]);
        let plane = smoothed(&one_place, 8, &window([1.0; 3], 2.0, None, None));
        assert_eq!(plane.data.iter().filter(|v| **v > 0.0).count(), 1);
        let particles = cloud(100, 0);
        for (near, distance) in [(1e-30, 0.0), (1e-3, 0.01), (1.0, 1e12)] {
            let camera = spherical_camera([1.0; 3], 20.0, 10.0, distance + 1e-6);
            let view = DensityView { name: "v".into(), camera, range: [near, f64::INFINITY], images: Images::Own };
            assert!(smoothed(&particles, 99, &view).data.iter().all(|v| v.is_finite()), "{distance}");
        }
    }

    #[test]
    fn too_many_neighbours_are_refused_and_stops_are_heard() {
        let particles = cloud(100, 0);
        let refused = |result: Result<Reference<'_>>| result.err().map(|e| e.to_string()).unwrap_or_default();
        for neighbours in [100, usize::MAX] {
            let line = refused(Reference::new(&particles).smoothed(neighbours, &Context::SILENT));
            assert!(line.contains("not 100") && !line.contains('\n'), "{line}");
        }
        assert!(matches!(Reference::new(&particles).smoothed(9, &cancelled()), Err(Error::Cancelled)));
        let smoothed = Reference::new(&particles).smoothed(9, &Context::SILENT).unwrap();
        let view = window([1.0; 3], 2.0, None, None);
        assert!(matches!(smoothed.surface_density(&view, SIZE, &cancelled()), Err(Error::Cancelled)));
    }
}
