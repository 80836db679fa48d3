//! `particlegs convert IN... -o OUT`.

use crate::common::{Common, SnapshotArgs};
use clap::Args;
use particlegs::particles::{Bounds, Selection, Tiling};
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use std::path::PathBuf;

/// Write a snapshot anew: tiled, cropped, thinned, as float32.
#[derive(Args)]
#[command(after_help = "Steps run in the order tile, crop, every, sample.

Examples:
  particlegs convert nbody128 -o tiled --tile 2,8,8      # 128 copies side by side
  particlegs convert doubles.npy -o snapshot             # float64 to float32 columns
  particlegs convert snapshot -o cut --crop 0,10,0,10,5,6
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
    /// Keep x0 <= x < x1 and likewise y and z (world units); the box is dropped.
    #[arg(long, value_name = "x0,x1,y0,y1,z0,z1", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    crop: Option<Vec<f64>>,
    /// Keep the first of every K particles.
    #[arg(long, value_name = "K", default_value_t = 1)]
    every: u64,
    /// Keep exactly N particles, drawn at random (--seed), in their order.
    #[arg(long, value_name = "N")]
    sample: Option<u64>,
    #[command(flatten)]
    snapshot: SnapshotArgs,
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
    let particles = a.snapshot.open(&a.input)?;
    let tiling = match a.tile.as_deref() {
        None => Tiling::single(),
        Some(&[x, y, z]) => Tiling::new([x, y, z], &particles)?,
        Some(_) => return Err(Error::argument("--tile takes three numbers, such as 2,8,8")),
    };
    let selection = Selection {
        crop: crop(a.crop.as_deref())?,
        wrap: false,
        every: a.every,
        sample: a.sample,
        seed: context.common.seed,
    };
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

fn crop(ends: Option<&[f64]>) -> Result<Option<Bounds>> {
    match ends {
        None => Ok(None),
        Some(&[x0, x1, y0, y1, z0, z1]) if x0 < x1 && y0 < y1 && z0 < z1 => {
            Ok(Some(Bounds { min: [x0, y0, z0], max: [x1, y1, z1] }))
        }
        Some(_) => Err(Error::argument("--crop takes six numbers x0,x1,y0,y1,z0,z1 with x0 < x1, y0 < y1, z0 < z1")),
    }
}
