//! `particlegs bench NAME SNAPSHOT... -o DIR`.

use crate::bench_files;
use crate::common::{CommandContext, Common};
use crate::device::DeviceArgs;
use crate::snapshot_args::SnapshotArgs;
use crate::view_args::parse_size;
use clap::{Args, ValueHint};
use particlegs_core::context::{ProgressEvent, ProgressSink};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result, parallel};
use particlegs_lab::experiments::{self, EXPERIMENTS, Experiment};
use particlegs_lab::lab::Lab;
use particlegs_lab::report::{Provenance, Section};
use particlegs_lab::settings::Settings;
use particlegs_lab::snapshot::Snapshot;
use particlegs_train::Accelerator;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arguments.
#[derive(Args)]
#[command(after_help = "\
`list` lists the experiments and which part of the paper each reproduces. Results are cached in
DIR/kept, so an interrupted command continues where it stopped. DIR/report.html shows everything on
one page; JSON, CSV, SVG, PNG and Markdown files are beside it (docs/guide/laboratory.md).

Examples:
  particlegs bench list
  particlegs bench all samples/nbody64 -o measured --quick
  particlegs bench rate-distortion snapshot -o measured --python venv/bin/python
  particlegs bench all snapshot others/* -o measured
  particlegs bench gpu --training -o measured-gpu")]
pub struct Arguments {
    /// Experiment, `all`, or `list`.
    #[arg(value_name = "NAME")]
    name: String,
    /// Snapshots, each given by its first file or folder; the first is measured and compared with the others.
    #[arg(value_name = "SNAPSHOT", value_hint = ValueHint::AnyPath)]
    snapshots: Vec<PathBuf>,
    /// Folder for results.
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    /// Use small pictures, few sizes and one view per orbit, to check that everything runs.
    #[arg(long)]
    quick: bool,
    /// With `all`, also run the experiments that train models (hours); with `gpu`, also the published recipe.
    #[arg(long)]
    training: bool,
    /// Python interpreter with the packages of lab/requirements.txt: SZ3, ZFP, VTK.
    ///
    /// Otherwise their measurements are skipped and listed as skipped.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::ExecutablePath)]
    python: Option<PathBuf>,
    /// Views per orbit [default: 2; 1 with --quick].
    #[arg(long, value_name = "N", hide_short_help = true)]
    frames: Option<usize>,
    /// Picture size in pixels [default: 1920x1080; 640x360 with --quick].
    #[arg(long, value_name = "WxH", value_parser = parse_size, hide_short_help = true)]
    size: Option<Size>,
    /// Compression ratios to measure.
    #[arg(long, value_name = "R,R,...", value_delimiter = ',', num_args = 1, hide_short_help = true)]
    ratios: Option<Vec<f64>>,
    /// Number of seeds for results that are random [default: 3; 2 with --quick].
    #[arg(long, value_name = "N", hide_short_help = true)]
    seeds: Option<usize>,
    /// Train with this share of the published recipe's pixels, steps and Gaussians [default: each experiment's own].
    #[arg(long, value_name = "S", hide_short_help = true)]
    scale: Option<f64>,
    /// Minutes after which `published-run` or `gpu --training` pauses; the same command continues [default: 120; 2 with
    /// --quick].
    #[arg(long, value_name = "M", hide_short_help = true)]
    minutes: Option<f64>,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

/// Runs experiments and writes their results.
pub fn run(a: &Arguments) -> Result<()> {
    if a.name == "list" {
        let context = a.common.clone().start()?;
        context.reads(std::iter::empty(), false)?;
        let value = |e: &Experiment| serde_json::json!({ "name": e.name, "title": e.title, "paper": e.paper, "trains": e.trains });
        return context.finish(list().trim_end(), &EXPERIMENTS.iter().map(value).collect::<Vec<_>>());
    }
    if a.name == "gpu" {
        return gpu(a);
    }
    let chosen = experiments::named(&a.name, a.training)?;
    let settings = a.settings(a.device.open()?)?;
    let (Some(output), false) = (&a.output, a.snapshots.is_empty()) else {
        return Err(Error::argument("`bench` needs a snapshot and a folder for the results: SNAPSHOT -o DIR"));
    };
    let context = a.common.clone().start()?;
    context.reads(a.snapshots.iter().chain(&a.snapshot.topology).map(PathBuf::as_path), false)?;
    let kept = bench_files::folder(output, &context)?;
    let snapshots = a.open(&context)?;
    let work = BenchProgress(&context);
    let work = context.with_sink(&work);
    let lab = Lab::new(settings, &kept, &work)?;
    let sections = experiment_by_experiment(&chosen, &lab, &snapshots)?;
    let provenance = a.provenance(&lab, &snapshots);
    bench_files::write(output, &sections, &provenance)?;
    summary(&sections, output, &context)
}

/// Measures a GPU without a snapshot: the first real one, or that of --device. With --training it also trains by the
/// published recipe, with a checkpoint in a folder.
#[cfg(feature = "gpu")]
fn gpu(a: &Arguments) -> Result<()> {
    a.refuse_for_gpu()?;
    let context = a.common.clone().start()?;
    let device = a.device.open_timed()?;
    let settings = a.settings(Some(Arc::new(particlegs_gpu::GpuAccelerator::new(Arc::clone(&device)))))?;
    let kept = a.output.as_deref().map(|folder| bench_files::folder(folder, &context)).transpose()?;
    if kept.is_some() {
        context.finishes_its_steps();
    }
    let work = BenchProgress(&context);
    let work = context.with_sink(&work);
    let mut lab = Lab::new(settings, &kept.unwrap_or_default(), &work)?;
    lab.gpu = Some(device);
    let experiment = experiments::named("gpu", a.training)?[0];
    let found = (experiment.run)(&lab, &[])?;
    let (text, value) = (particlegs_lab::report::text(&found), serde_json::to_value(&found).unwrap_or_default());
    if let Some(output) = &a.output {
        bench_files::write(output, &[Section { experiment, found: Ok(found) }], &a.provenance(&lab, &[]))?;
    }
    context.finish(&text, &value)
}

#[cfg(not(feature = "gpu"))]
fn gpu(a: &Arguments) -> Result<()> {
    a.refuse_for_gpu()?;
    Err(crate::device::no_gpu_support())
}

/// Shows the progress of experiments, without the hundreds of notes on single snapshots and models.
struct BenchProgress<'a>(&'a CommandContext);

impl ProgressSink for BenchProgress<'_> {
    fn event(&self, event: ProgressEvent<'_>) {
        self.0.sink().event(event);
    }

    fn message(&self, text: &str) {
        if !text.starts_with("note:") {
            self.0.message(text);
        }
    }
}

fn list() -> String {
    let row = |e: &Experiment| {
        let paper = if e.paper.is_empty() { "not in the paper" } else { e.paper };
        let trains = if e.trains { "; trains models" } else { "" };
        let takes = if e.weight == 0 { "; takes no snapshot" } else { "" };
        format!("{:<20} {}\n{:<20} ({paper}{trains}{takes})\n", e.name, e.title, "")
    };
    EXPERIMENTS.iter().map(row).collect()
}

/// Runs them all, and reports those that fail.
fn experiment_by_experiment(
    chosen: &[&'static Experiment],
    lab: &Lab<'_>,
    snapshots: &[Snapshot],
) -> Result<Vec<Section>> {
    lab.context.begin("experiments", chosen.iter().map(|e| e.weight).sum());
    let mut sections = Vec::new();
    for experiment in chosen {
        lab.context.begin(experiment.name, 0);
        let found = match (experiment.run)(lab, snapshots) {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(e) => {
                lab.context.message(&format!("{}: {e}", experiment.name));
                Err(e.to_string())
            }
            Ok(found) => Ok(found),
        };
        sections.push(Section { experiment, found });
        lab.context.end();
        lab.context.advance(experiment.weight);
    }
    lab.context.end();
    Ok(sections)
}

impl Arguments {
    /// Refuses options that have no effect when a GPU is measured.
    fn refuse_for_gpu(&self) -> Result<()> {
        let of_experiments = [
            (!self.snapshots.is_empty(), "SNAPSHOT"),
            (self.python.is_some(), "--python"),
            (self.frames.is_some(), "--frames"),
            (self.size.is_some(), "--size"),
            (self.ratios.is_some(), "--ratios"),
            (self.seeds.is_some(), "--seeds"),
        ];
        if let Some((_, name)) = of_experiments.iter().find(|(given, _)| *given) {
            return Err(Error::argument(format!("`bench gpu` makes its own scenes: omit {name}")));
        }
        if let Some(words) = self.snapshot.describe() {
            return Err(Error::argument(format!("`bench gpu` makes its own scenes: omit {words}")));
        }
        let of_training =
            [(self.output.is_some(), "-o"), (self.scale.is_some(), "--scale"), (self.minutes.is_some(), "--minutes")];
        match of_training.iter().find(|(given, _)| *given) {
            Some((_, name)) if !self.training => {
                Err(Error::argument(format!("`bench gpu` uses {name} only with --training")))
            }
            _ if self.training && self.output.is_none() => {
                Err(Error::argument("`bench gpu --training` needs a folder for its checkpoint: -o DIR"))
            }
            _ => Ok(()),
        }
    }

    fn settings(&self, device: Option<Arc<dyn Accelerator>>) -> Result<Settings> {
        let program = std::env::current_exe().map_err(|e| Error::io(Path::new("this program"), e))?;
        let mut s = Settings::new(self.quick, program);
        (s.training, s.seed, s.python) = (self.training, self.common.seed, self.python.clone());
        s.device = device;
        s.size = self.size.unwrap_or(s.size);
        s.frames = self.frames.unwrap_or(s.frames);
        s.seeds = self.seeds.unwrap_or(s.seeds);
        s.ratios = self.ratios.clone().unwrap_or(s.ratios);
        s.ratios.sort_by(f64::total_cmp);
        (s.scale, s.minutes) = (self.scale, self.minutes);
        if let Some(scale) = s.scale.filter(|v| !(*v > 0.0 && *v <= 1.0)) {
            return Err(Error::argument(format!("--scale {scale} is outside (0, 1]")));
        }
        if let Some(minutes) = s.minutes.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(Error::argument(format!("--minutes {minutes} is not positive")));
        }
        for (option, value, most) in [("--frames", s.frames, 1000), ("--seeds", s.seeds, 100)] {
            if value == 0 || value > most {
                return Err(Error::argument(format!("{option} {value} is outside 1 to {most}")));
            }
        }
        match s.ratios.iter().find(|r| !(**r > 1.0 && r.is_finite())) {
            Some(r) => Err(Error::argument(format!("--ratios: {r} is not above 1"))),
            None => Ok(s),
        }
    }

    /// Opens every snapshot, named after its file or folder.
    fn open(&self, context: &CommandContext) -> Result<Vec<Snapshot>> {
        let open = |path: &PathBuf| {
            let particles = self.snapshot.choice()?.read(
                std::slice::from_ref(path),
                &particlegs_particles::Storage::Memory,
                context,
            )?;
            let name = path.file_stem().map_or("snapshot".into(), |n| n.to_string_lossy().into_owned());
            Ok(Snapshot::new(name, path.clone(), particles, self.snapshot.describe().as_deref()))
        };
        self.snapshots.iter().map(open).collect()
    }

    fn provenance(&self, lab: &Lab<'_>, snapshots: &[Snapshot]) -> Provenance {
        let s = &lab.settings;
        let names: Vec<&str> = snapshots.iter().map(|s| s.name.as_str()).collect();
        let quick = if s.quick { " --quick" } else { "" };
        let training = if s.training { " --training" } else { "" };
        let scale = s.scale.map_or(String::new(), |v| format!(" --scale {v}"));
        let device = s.device_name().map_or("", |_| " --device DEVICE");
        let python = if s.python.is_some() { " --python PYTHON" } else { "" };
        let ratios = s.ratios.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let Size { width, height } = s.size;
        let measured = match names.is_empty() {
            true => String::new(),
            false => format!(" --ratios {ratios} --size {width}x{height} --frames {} --seeds {}", s.frames, s.seeds),
        };
        let of: String = names.iter().map(|name| format!(" {name}")).collect();
        let read = self.snapshot.describe().map_or(String::new(), |w| format!(" {w}"));
        let command = format!(
            "particlegs bench {}{of}{read}{quick}{training}{scale}{device}{python}{measured} --seed {}",
            self.name, s.seed
        );
        let mut p = Provenance::new(command, parallel::threads());
        p.seeds = [s.seed, s.seeds as u64];
        p.others = lab.baselines.iter().map(|b| format!("{}: {}", b.name(), b.source())).collect();
        p.others.extend(s.device_name().map(|name| format!("Device that drew and trained: {name}")));
        p.others.extend(lab.store.of_others());
        p.snapshots = snapshots.iter().map(|s| (s.name.clone(), s.particles.len() as u64, s.hash.clone())).collect();
        p
    }
}

/// Summary of the files; an error if every experiment failed.
fn summary(sections: &[Section], output: &Path, context: &CommandContext) -> Result<()> {
    let mut text = String::new();
    for s in sections {
        let words = match &s.found {
            Ok(f) => {
                format!("{} tables, {} plots, {} sets of pictures", f.tables.len(), f.plots.len(), f.pictures.len())
            }
            Err(why) => format!("not measured: {why}"),
        };
        text += &format!("{}: {words}\n", s.experiment.name);
    }
    text += &format!("{}", output.join("report.html").display());
    let failed: Vec<&str> = sections.iter().filter(|s| s.found.is_err()).map(|s| s.experiment.name).collect();
    if failed.len() == sections.len() {
        let why = sections.iter().find_map(|s| s.found.as_ref().err().cloned()).unwrap_or_default();
        return Err(Error::argument(format!("nothing was measured: {why}")));
    }
    let value = serde_json::json!({ "report": output.join("report.html").to_string_lossy(), "failed": failed });
    context.finish(&text, &value)
}
