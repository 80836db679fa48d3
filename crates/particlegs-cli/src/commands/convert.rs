//! `particlegs convert IN... -o OUT`.

use crate::common::Common;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use clap::Args;
use particlegs::particles::Tiling;
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use std::path::PathBuf;

/// Write a snapshot anew: tiled, cropped, thinned, as float32.
#[derive(Args)]
#[command(after_help = "Steps run in the order tile, region, every, sample.

Examples:
  particlegs convert nbody128 -o tiled --tile 2,8,8      # 128 copies side by side
  particlegs convert doubles.npy -o snapshot             # float64 to float32 columns
  particlegs convert snapshot -o cut --region 0,10,0,10,5,6
  particlegs convert snapshot -o few.npy --sample 100000 --seed 7")]
pub struct Arguments {
    /// A folder with xx.f32 yy.f32 zz.f32 (ww.f32), the three or four files, or one .npy.
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// Folder to write columns and meta.json to, or a name that ends in .npy.
    #[arg(long, short, value_name = "OUT")]
    output: PathBuf,
    /// Repeat the periodic box so often along x, y and z; tile by tile, z fastest.
    #[arg(long, value_name = "NX,NY,NZ", value_delimiter = ',', num_args = 1)]
    tile: Option<Vec<u32>>,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    window: WindowArgs,
    #[command(flatten)]
    common: Common,
}

#[derive(serde::Serialize)]
struct Report {
    output: PathBuf,
    particles_in: u64,
    particles: u64,
    bytes: u64,
    seconds: f64,
}

/// Converts.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.start()?;
    let particles = a.snapshot.open(&a.input, &context)?;
    let tiling = match a.tile.as_deref() {
        None => Tiling::single(),
        Some(&[x, y, z]) => Tiling::new([x, y, z], &particles)?,
        Some(_) => return Err(Error::argument("--tile takes three numbers, such as 2,8,8")),
    };
    let selection = a.selection.selection(&a.window, context.common.seed)?;
    if particles.origin != [0.0; 3] {
        context.message("note: positions lie far from 0; about 0, float32 keeps fewer of their digits");
    }
    if a.output.extension().is_some_and(|e| e == "npy") && particles.meta.cell.is_some() {
        context.message("note: an .npy holds no box; give it again with --box");
    }
    let start = std::time::Instant::now();
    let made = particlegs::particles::convert(&particles, tiling, selection, &a.output, &context)?;
    let seconds = start.elapsed().as_secs_f64();
    let text = format!(
        "{}: {} particles, {:.1} MB, in {seconds:.1} s",
        a.output.display(),
        made.particles,
        made.bytes as f64 / 1e6
    );
    let particles_in = particles.len() as u64;
    context.finish(
        &text,
        &Report { output: a.output, particles_in, particles: made.particles, bytes: made.bytes, seconds },
    )
}
