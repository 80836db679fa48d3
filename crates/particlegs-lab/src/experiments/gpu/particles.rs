//! Speed of pictures of all particles.

use super::scenes::{TiledScene, views};
use super::work::WorkBound;
use super::{GpuBench, GpuTables, LIMIT, pixels};
use crate::results::TableCell;
use particlegs_core::Result;
use particlegs_core::picture::Size;
use particlegs_core::render::Renderer;
use particlegs_core::splat::ToneStyle;
use particlegs_gpu::reference::{MOST, ParticlePictures};
use particlegs_train::ParticleInput;
use std::ops::Range;
use std::time::Instant;

/// Number of pictures.
const PICTURES: usize = 20;
/// Chunks of [`MOST`] particles: 268 million.
const PIECES: usize = 24;
const LOOK: ToneStyle = ToneStyle::Expected;

/// The noise-free picture of particles drawn from the scene: one chunk, repeated and shifted.
pub(super) fn row(bench: GpuBench<'_>, tables: &mut GpuTables, scene: &TiledScene, size: Size) -> Result<()> {
    let (pieces, each) = if bench.quick { (2, 100_000) } else { (PIECES, MOST) };
    let (count, columns) = (pieces * each, scene.particles(each));
    let started = Instant::now();
    let moved = Box::new(|range: Range<usize>| moved(&columns, scene, range));
    let input = ParticleInput { origin: scene.bounds.center(), bounds: scene.bounds, count, columns: moved };
    let mut renderer = ParticlePictures::new(bench.device, input)?;
    renderer.keep_all(&mut |_| bench.context.check())?;
    let to_load = started.elapsed().as_secs_f64();
    let views = views(scene, size, true);
    let draw = |k: usize| renderer.draw(&views[k], size, LOOK, bench.context).map(drop);
    draw(0)?;
    let (started, mut pictures) = (Instant::now(), 0);
    while pictures < bench.either(1, PICTURES) && started.elapsed() < LIMIT {
        pictures += 1;
        draw(pictures)?;
    }
    let each = started.elapsed().as_secs_f64() / pictures as f64;
    let label = format!("picture of {count} particles, {}, {}", pixels(size), LOOK.name());
    tables.time_kernels(bench, &label, 1, || draw(0))?;
    let cells = [
        TableCell::count(count as u64),
        TableCell::text(pixels(size)),
        TableCell::text(LOOK.name()),
        TableCell::count(pictures as u64),
        TableCell::number(each, 4),
        TableCell::number(to_load, 1),
    ];
    let least = WorkBound::of_particles(count, views[0].radius_pixels(size), size);
    tables.particles.row(cells.into_iter().chain(bench.work(1.0 / each, &least)));
    Ok(())
}

/// Particles of a range: the drawn ones, repeated with a periodic shift, so that they stay as clumped.
fn moved(columns: &[Vec<f32>; 3], scene: &TiledScene, range: Range<usize>) -> [Vec<f32>; 3] {
    let (each, extent) = (columns[0].len(), scene.bounds.extent().map(|e| e as f32));
    [0, 1, 2].map(|k| {
        let (column, half) = (&columns[k], 0.5 * extent[k]);
        let at = |i: usize| {
            // These steps do not repeat within the copies, so that no copy lies on another.
            let away = ((i / each) as f64 * [0.618, 0.755, 0.57][k]).fract() as f32;
            (column[i % each] + half + away * extent[k]).rem_euclid(extent[k]) - half
        };
        range.clone().map(at).collect()
    })
}
