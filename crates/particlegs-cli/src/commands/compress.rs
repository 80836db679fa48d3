//! `particlegs compress IN... -o M.pgs`.

use crate::common::{Common, Context};
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use clap::{Args, ValueEnum};
use particlegs::compress::{Compressed, Options, Target, compress};
use particlegs::fit::Effort;
use particlegs::progress::Progress;
use particlegs::{Error, Result, output};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
Examples:
  particlegs compress snapshot/ -o snapshot.pgs                     ratio 300, default effort
  particlegs compress snapshot/ -o snapshot.pgs --ratio 65 --effort high
  particlegs compress x.f32 y.f32 z.f32 -o snapshot.pgs --size 11MB
  particlegs compress points.npy -o points.pgs --psnr 32 --box 100,100,100
  particlegs compress snapshot/ -o snapshot.pgs --pictures pictures/")]
pub struct Arguments {
    /// A snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// The model file to write.
    #[arg(long, short, value_name = "M.pgs")]
    output: PathBuf,
    #[command(flatten)]
    target: TargetArgs,
    /// Time for quality.
    #[arg(long, value_enum, default_value_t = EffortArg::Default)]
    effort: EffortArg,
    /// Divide the particles into K blocks of balanced counts, each fitted on its own.
    #[arg(long, value_name = "K", default_value_t = 1)]
    blocks: u32,
    /// Default particle radius to store (default: 0.0406 of the mean spacing).
    #[arg(long, value_name = "WORLD")]
    radius: Option<f64>,
    /// Default opacity to store (default: 0.05).
    #[arg(long)]
    opacity: Option<f64>,
    /// Do not measure the decoded model: no scores in the file.
    #[arg(long)]
    no_certificate: bool,
    /// Write side-by-side pictures (truth | model | error) and the surface density to a folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    window: WindowArgs,
    #[command(flatten)]
    common: Common,
}

/// One target at most.
#[derive(Args)]
#[group(multiple = false)]
struct TargetArgs {
    /// Compression ratio: 12 bytes a particle (16 with weights) over the file's bytes [default: 300].
    #[arg(long)]
    ratio: Option<f64>,
    /// File size, e.g. 11MB, 900kB, 1.5GiB.
    #[arg(long)]
    size: Option<String>,
    /// Number of Gaussians, at the nominal precision.
    #[arg(long, value_name = "K")]
    gaussians: Option<u64>,
    /// Masked PSNR in dB, `expected` look, mean over held-out views.
    #[arg(long, value_name = "DB")]
    psnr: Option<f64>,
}

/// Effort on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum EffortArg {
    /// The partition alone: for pictures; small groups are lost.
    Fast,
    /// Refined.
    Default,
    /// Refined longer.
    High,
}

impl TargetArgs {
    fn target(&self) -> Result<Target> {
        match (self.ratio, &self.size, self.gaussians, self.psnr) {
            (Some(r), ..) => Target::Ratio(r).check(),
            (_, Some(s), ..) => Target::parse_size(s),
            (_, _, Some(k), _) => Target::Gaussians(k).check(),
            (.., Some(d)) => Target::Psnr(d).check(),
            _ => Ok(Target::Default),
        }
    }

    /// As stored in the file: what decides its bytes.
    fn text(&self) -> String {
        match (self.ratio, &self.size, self.gaussians, self.psnr) {
            (Some(r), ..) => format!(" --ratio {r}"),
            (_, Some(s), ..) => format!(" --size {s}"),
            (_, _, Some(k), _) => format!(" --gaussians {k}"),
            (.., Some(d)) => format!(" --psnr {d}"),
            _ => String::new(),
        }
    }
}

impl Arguments {
    fn options(&self) -> Result<Options> {
        for (name, value) in [("--radius", self.radius), ("--opacity", self.opacity)] {
            if value.is_some_and(|v| !(v > 0.0 && v.is_finite())) {
                return Err(Error::argument(format!("{name} must be positive")));
            }
        }
        if self.opacity.is_some_and(|a| a > 1.0) {
            return Err(Error::argument("--opacity is outside (0, 1]"));
        }
        let (effort, name) = match self.effort {
            EffortArg::Fast => (Effort::Fast, "fast"),
            EffortArg::Default => (Effort::Default, "default"),
            EffortArg::High => (Effort::High, "high"),
        };
        let mut command = format!("compress{} --effort {name} --seed {}", self.target.text(), self.common.seed);
        command += &self.snapshot.text();
        command += &self.selection.text(&self.window);
        if self.blocks != 1 {
            command += &format!(" --blocks {}", self.blocks);
        }
        for (option, value) in [("radius", self.radius), ("opacity", self.opacity)] {
            if let Some(v) = value {
                command += &format!(" --{option} {v}");
            }
        }
        Ok(Options {
            target: self.target.target()?,
            effort,
            radius: self.radius,
            opacity: self.opacity,
            blocks: self.blocks,
            seed: self.common.seed,
            certificate: !self.no_certificate,
            command,
        })
    }
}

/// Compresses, writes the file and the pictures, reports.
pub fn run(a: Arguments) -> Result<()> {
    let options = a.options()?;
    let context = a.common.clone().start()?;
    let start = Instant::now();
    if let Some(folder) = &a.pictures {
        // The model may go there as well.
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    output::check_writable(&a.output)?;
    let particles = a.snapshot.open_selected(&a.input, (&a.selection, &a.window), a.common.seed, &context)?;
    if particles.meta.cell.is_none() {
        context.message("note: no periodic box is known (--box Lx,Ly,Lz): nothing wraps around");
    }
    let done = compress(&particles, &options, &context)?;
    context.check()?;
    output::write_bytes(&a.output, &done.bytes)?;
    let seconds = start.elapsed().as_secs_f64();
    report(&a, &context, &done, seconds)?;
    if let Some(folder) = &a.pictures {
        for path in crate::pictures::write(folder, &done.model, &particles, &context)? {
            context.message(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}

fn report(a: &Arguments, context: &Context, done: &Compressed, seconds: f64) -> Result<()> {
    let (bytes, gaussians) = (done.bytes.len(), done.model.gaussians());
    let ratio = done.raw_bytes as f64 / bytes as f64;
    let mut text = format!(
        "{}: {} particles -> {gaussians} Gaussians, {bytes} bytes, ratio {ratio:.1}, {:.2} bytes a Gaussian",
        a.output.display(),
        done.model.metadata.count,
        bytes as f64 / gaussians as f64,
    );
    let phases: Vec<String> = done.seconds.iter().map(|(p, s)| format!("{p} {s:.2} s")).collect();
    text += &format!("\n{:.2} s: {}", seconds, phases.join(", "));
    if matches!(a.effort, EffortArg::Fast) {
        text += "\nfor pictures: the partition alone loses most small groups; use --effort default for statistics";
    }
    if done.model.certificate.is_some() {
        text += &format!(
            "\n{}",
            crate::info_model::certificate(done.model.certificate.as_ref(), done.model.metadata.length_unit.as_deref())
                .trim_end()
        );
    }
    let value = json!({
        "output": a.output, "particles": done.model.metadata.count, "gaussians": gaussians,
        "model_bytes": bytes, "raw_bytes": done.raw_bytes, "compression_ratio": ratio,
        "bytes_a_gaussian": bytes as f64 / gaussians as f64, "step_factor": done.step_factor,
        "seconds": seconds, "seconds_by_phase": done.seconds.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
        "certificate": done.model.certificate,
    });
    context.finish(&text, &value)
}
