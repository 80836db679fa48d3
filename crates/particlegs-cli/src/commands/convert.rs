//! `particlegs convert IN... -o OUT`.

use crate::common::{Common, Context};
use crate::info_model;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use clap::Args;
use particlegs::particles::{Kept, Tiling};
use particlegs::progress::Progress;
use particlegs::{Error, Result, codec, output};
use particlegs_formats::{WRITERS, write_splats, writer_for};
use std::path::{Path, PathBuf};

/// Write a snapshot anew: in another format, tiled, cropped, thinned, as float32. Or an alpha-blend
/// model as the PLY of splat viewers.
#[derive(Args)]
#[command(after_help = "Steps run in the order tile, region, every, sample.

Examples:
  particlegs convert nbody128 -o tiled --tile 2,8,8      # 128 copies side by side
  particlegs convert doubles.npy -o snapshot             # float64 to float32 columns
  particlegs convert snap_099.0.hdf5 --particle-type dm -o dm.vtp
  particlegs convert snapshot -o cut --region 0,10,0,10,5,6
  particlegs convert snapshot -o few.npy --sample 100000 --seed 7
  particlegs convert M.pgs -o splats.ply                 # an alpha-blend model, normalised as in training")]
pub struct Arguments {
    /// A snapshot: its first file, its folder, or raw columns x y z (w); or a model file.
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// What to write: a folder for raw columns and meta.json, or a name that ends in .npy, .hdf5, .vtp or .dump.
    #[arg(long, short, alias = "out", value_name = "OUT")]
    output: PathBuf,
    /// Format to write, where the name does not tell.
    #[arg(long, value_name = "FORMAT", value_parser = clap::builder::PossibleValuesParser::new(writers()))]
    to: Option<String>,
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

/// Names of the formats that can be written.
fn writers() -> Vec<&'static str> {
    WRITERS.iter().map(|w| w.name).collect()
}

/// Converts.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    if let [one] = &a.input[..]
        && super::info::is_model(one)?
    {
        return splats(&a, one, &context);
    }
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
    let writer = writer_for(&a.output, a.to.as_deref())?;
    let start = std::time::Instant::now();
    let kept = Kept::new(&particles, tiling, selection, &context)?;
    if !writer.holds_box && kept.meta().cell.is_some() {
        context.message(&format!("note: {} holds no box; give it again with --box", writer.title));
    }
    let bytes = (writer.write)(&kept, &a.output, &context)?;
    let seconds = start.elapsed().as_secs_f64();
    let count = kept.total();
    let text = format!("{}: {count} particles, {:.1} MB, in {seconds:.1} s", a.output.display(), bytes as f64 / 1e6);
    let particles_in = particles.len() as u64;
    context.finish(&text, &Report { output: a.output.clone(), particles_in, particles: count, bytes, seconds })
}

#[derive(serde::Serialize)]
struct SplatReport {
    output: PathBuf,
    gaussians: usize,
    bytes: u64,
    seconds: f64,
}

/// A model's Gaussians as the PLY of splat viewers.
fn splats(a: &Arguments, model: &Path, context: &Context) -> Result<()> {
    let start = std::time::Instant::now();
    let is_ply = a.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
    if !is_ply || a.to.is_some() || a.tile.is_some() {
        let what = "a model is written as splats alone, to a name that ends in .ply".to_string();
        let hint = "draw particles with `recover`, then convert those".to_string();
        return Err(Error::Argument { what, hint });
    }
    output::check_writable(&a.output)?;
    let decoded = codec::decode(&info_model::read(model)?, &model.display().to_string())?;
    let bytes = write_splats(&decoded, &a.output, context)?;
    if decoded.vizmapper.is_some() {
        context.message("note: the VizMapper is not in it: a PLY file holds splats alone");
    }
    let (gaussians, seconds) = (decoded.gaussians(), start.elapsed().as_secs_f64());
    let text = format!("{}: {gaussians} splats, {:.1} MB, in {seconds:.1} s", a.output.display(), bytes as f64 / 1e6);
    context.finish(&text, &SplatReport { output: a.output.clone(), gaussians, bytes, seconds })
}
