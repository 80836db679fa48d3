//! `particlegs convert IN... -o OUT`.

use crate::common::{CommandContext, Common};
use crate::inputs::{self, ModelOrSnapshot};
use crate::outputs::ForceArgs;
use crate::snapshot_args::ParticleArgs;
use clap::{Args, ValueHint};
use particlegs::{Model, Snapshot};
use particlegs_core::{Error, Result};
use particlegs_files::input::name_of;
use particlegs_formats::Writer;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    mut_args = |a| if SELECTION.contains(&a.get_id().as_str()) { a.hide_short_help(false) } else { a },
    after_help = "\
Examples:
  particlegs convert snap_099.0.hdf5 --particle-type dm -o dm.vtp
  particlegs convert snapshot -o few.npy --sample 100000 --seed 7",
    after_long_help = "\
Steps are applied in the order tile, region, every, sample.

Examples:
  particlegs convert nbody128 -o tiled --tile 2,8,8      # 128 copies side by side
  particlegs convert doubles.npy -o snapshot             # float64 to float32 columns
  particlegs convert snap_099.0.hdf5 --particle-type dm -o dm.vtp
  particlegs convert snapshot -o cut --region 0,10,0,10,5,6
  particlegs convert snapshot -o few.npy --sample 100000 --seed 7
  particlegs convert M.pgs -o splats.ply                 # an alpha-blend model: y is down"
)]
pub struct Arguments {
    /// Snapshot: its first file, its folder, or raw columns x y z (w); or an alpha-blend model.
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// File to write, or a folder for raw columns and meta.json.
    ///
    /// The extension selects the format: .npy, .hdf5, .h5, .vtp, .dump, .lammpstrj; for an alpha-blend model .ply, as
    /// splats for viewers.
    #[arg(long, short, alias = "out", value_name = "OUT", value_hint = ValueHint::AnyPath)]
    output: PathBuf,
    /// Output format, if the name does not tell.
    #[arg(long, value_name = "FORMAT", value_parser = clap::builder::PossibleValuesParser::new(writers()))]
    to: Option<String>,
    /// Number of copies of the periodic box along x, y and z.
    ///
    /// Copies are written one after the other, z fastest.
    #[arg(long, value_name = "NX,NY,NZ", value_delimiter = ',', num_args = 1)]
    tile: Option<Vec<u32>>,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

/// Options that only `convert` shows in `-h`; elsewhere they are in `--help`.
const SELECTION: [&str; 5] = ["region", "every", "sample", "center", "width"];

fn writers() -> Vec<&'static str> {
    Writer::all().iter().map(|w| w.name).collect()
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads(a.input.iter().chain(&a.particles.opening.topology).map(PathBuf::as_path), a.force.force)?;
    let mut choice = match &a.input[..] {
        [one] => match inputs::model_or_snapshot(one, &a.particles.opening, &context)? {
            ModelOrSnapshot::Model(bytes) => return splats(&a, one, bytes, &context),
            ModelOrSnapshot::Snapshot(choice) => *choice,
        },
        _ => a.particles.opening.choice()?,
    };
    let copies = match a.tile.as_deref() {
        None => None,
        Some(&[x, y, z]) => Some([x, y, z]),
        Some(_) => return Err(Error::argument("--tile takes three numbers, such as 2,8,8")),
    };
    choice.selection = Some(a.particles.selection.selection(&a.particles.window, context.common.seed)?);
    let start = Instant::now();
    let snapshot = Snapshot::of_files(&a.input, choice);
    let file = snapshot.convert(&a.output, (a.to.as_deref(), copies), &context.outputs, &context)?;
    let (seconds, count, megabytes) = (start.elapsed().as_secs_f64(), file.particles, file.bytes as f64 / 1e6);
    let text = format!("{}: {count} particles, {megabytes:.1} MB, in {seconds:.1} s", a.output.display());
    let report = json!({
        "output": a.output.to_string_lossy(), "particles_in": file.particles_in, "particles": count,
        "bytes": file.bytes, "seconds": seconds,
    });
    context.finish(&text, &report)
}

fn splats(a: &Arguments, path: &Path, bytes: Vec<u8>, context: &CommandContext) -> Result<()> {
    let start = Instant::now();
    let is_ply = a.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
    if !is_ply || a.to.is_some() || a.tile.is_some() {
        let message = "a model can only be converted to splats, with an output name that ends in .ply";
        let hint = "draw particles with `recover`, then convert them";
        return Err(Error::argument_with(message, hint));
    }
    let model = Model::decode(bytes, &name_of(path), context)?;
    let bytes = model.save_splats(&a.output, &context.outputs, context)?;
    let (gaussians, seconds) = (model.decoded().gaussians(), start.elapsed().as_secs_f64());
    let text = format!("{}: {gaussians} splats, {:.1} MB, in {seconds:.1} s", a.output.display(), bytes as f64 / 1e6);
    let report = json!({
        "output": a.output.to_string_lossy(), "gaussians": gaussians, "bytes": bytes, "seconds": seconds,
    });
    context.finish(&text, &report)
}
