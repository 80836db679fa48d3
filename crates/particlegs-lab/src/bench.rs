//! The command `bench`: its own options, what it does with them, and the files that it writes to a folder.

use crate::experiments::{self, EXPERIMENTS, Experiment};
use crate::lab::Lab;
use crate::report::{Provenance, ReportSection, csv, html, markdown};
use crate::results::{Colours, Pictures};
use crate::settings::Settings;
use crate::snapshot::Snapshot;
use clap::{Args, ValueHint};
use particlegs_core::context::{Context, ProgressEvent, ProgressSink};
use particlegs_core::picture::{Gray8, Rgb8, Size};
use particlegs_core::{Error, Result, parallel};
use particlegs_figure::png_file::{PngMetadata, coded};
use particlegs_figure::{ColourBar, Figure, FigureImage, FigureSpace, FileKind, Panel, layout, raster, write_plots};
use particlegs_files::output::write_bytes;
use particlegs_formats::Choice;
use particlegs_particles::Storage;
use particlegs_train::Accelerator;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The options that `bench` alone has.
#[derive(Args)]
pub struct BenchOptions {
    /// Experiment, `all`, or `list`.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Snapshots, each given by its first file or folder; the first is measured and compared with the others.
    #[arg(value_name = "SNAPSHOT", value_hint = ValueHint::AnyPath)]
    pub snapshots: Vec<PathBuf>,
    /// Folder for results.
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub output: Option<PathBuf>,
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
    #[arg(long, value_name = "WxH", hide_short_help = true)]
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
}

/// The output of the command, as text and as data.
pub struct BenchResult {
    pub text: String,
    pub value: serde_json::Value,
}

/// The experiments that there are.
pub fn list() -> BenchResult {
    let row = |e: &Experiment| {
        let paper = if e.paper.is_empty() { "not in the paper" } else { e.paper };
        let trains = if e.trains { "; trains models" } else { "" };
        let takes = if e.weight == 0 { "; takes no snapshot" } else { "" };
        format!("{:<20} {}\n{:<20} ({paper}{trains}{takes})\n", e.name, e.title, "")
    };
    let value =
        |e: &Experiment| serde_json::json!({ "name": e.name, "title": e.title, "paper": e.paper, "trains": e.trains });
    let text: String = EXPERIMENTS.iter().map(row).collect();
    BenchResult { text: text.trim_end().into(), value: EXPERIMENTS.iter().map(value).collect() }
}

/// Shows the progress of experiments, without the hundreds of notes on single snapshots and models.
struct BenchProgress<'a>(&'a Context<'a>);

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

impl BenchOptions {
    /// The experiments to run.
    pub fn chosen(&self) -> Result<Vec<&'static Experiment>> {
        experiments::named(&self.name, self.training)
    }

    /// The folder for the results.
    pub fn results(&self) -> Result<&Path> {
        let output = self.output.as_deref().filter(|_| !self.snapshots.is_empty());
        output.ok_or_else(|| Error::argument("`bench` needs a snapshot and a folder for the results: SNAPSHOT -o DIR"))
    }

    /// Runs experiments on the snapshots, read by `choice`, which `read` gives in words, and writes their results;
    /// results are cached in `cache`.
    pub fn measure(
        &self,
        settings: Settings,
        cache: &Path,
        (choice, read): (&Choice, Option<&str>),
        context: &Context<'_>,
    ) -> Result<BenchResult> {
        let (chosen, output) = (self.chosen()?, self.results()?);
        let open = |path: &PathBuf| {
            let particles = choice.read(std::slice::from_ref(path), &Storage::Memory, context)?;
            let name = path.file_stem().map_or("snapshot".into(), |n| n.to_string_lossy().into_owned());
            Ok(Snapshot::new(name, path.clone(), particles, read))
        };
        let snapshots = self.snapshots.iter().map(open).collect::<Result<Vec<_>>>()?;
        let work = BenchProgress(context);
        let work = context.with_sink(&work);
        let lab = Lab::new(settings, cache, &work)?;
        let sections = experiment_by_experiment(&chosen, &lab, &snapshots)?;
        write(output, &sections, &self.provenance(&lab, &snapshots, read))?;
        summary(&sections, output)
    }

    /// Measures a GPU without a snapshot. With training it also trains by the published recipe, with a checkpoint in
    /// `cache`.
    #[cfg(feature = "gpu")]
    pub fn measure_gpu(
        &self,
        device: crate::gpu::TimedDevice,
        settings: Settings,
        cache: &Path,
        context: &Context<'_>,
    ) -> Result<BenchResult> {
        let work = BenchProgress(context);
        let work = context.with_sink(&work);
        let mut lab = Lab::new(settings, cache, &work)?;
        lab.gpu = Some(device);
        let experiment = self.chosen()?[0];
        let results = (experiment.run)(&lab, &[])?;
        let (text, value) = (crate::report::text(&results), serde_json::to_value(&results).unwrap_or_default());
        if let Some(output) = &self.output {
            write(output, &[ReportSection { experiment, found: Ok(results) }], &self.provenance(&lab, &[], None))?;
        }
        Ok(BenchResult { text, value })
    }

    /// Refuses options that have no effect when a GPU is measured.
    pub fn refuse_for_gpu(&self, read: Option<&str>) -> Result<()> {
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
        if let Some(words) = read {
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

    /// The settings that the options mean.
    pub fn settings(&self, seed: u64, device: Option<Arc<dyn Accelerator>>) -> Result<Settings> {
        let program = std::env::current_exe().map_err(|e| Error::io(Path::new("this program"), e))?;
        let mut s = Settings::new(self.quick, program);
        (s.training, s.seed, s.python) = (self.training, seed, self.python.clone());
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

    fn provenance(&self, lab: &Lab<'_>, snapshots: &[Snapshot], read: Option<&str>) -> Provenance {
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
        let snapshot_names: String = names.iter().map(|name| format!(" {name}")).collect();
        let read = read.map_or(String::new(), |w| format!(" {w}"));
        let command = format!(
            "particlegs bench {}{snapshot_names}{read}{quick}{training}{scale}{device}{python}{measured} --seed {}",
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

/// Runs them all, and reports those that fail.
fn experiment_by_experiment(
    chosen: &[&'static Experiment],
    lab: &Lab<'_>,
    snapshots: &[Snapshot],
) -> Result<Vec<ReportSection>> {
    lab.context.begin("experiments", chosen.iter().map(|e| e.weight).sum());
    let mut sections = Vec::new();
    for experiment in chosen {
        lab.context.begin(experiment.name, 0);
        let outcome = match (experiment.run)(lab, snapshots) {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(e) => {
                lab.context.message(&format!("{}: {e}", experiment.name));
                Err(e.to_string())
            }
            Ok(results) => Ok(results),
        };
        sections.push(ReportSection { experiment, found: outcome });
        lab.context.end();
        lab.context.advance(experiment.weight);
    }
    lab.context.end();
    Ok(sections)
}

/// Summary of the files; an error if every experiment failed.
fn summary(sections: &[ReportSection], output: &Path) -> Result<BenchResult> {
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
    Ok(BenchResult { text, value })
}

const RESULTS: &str = "results.json";

/// The cache in an output folder, which must be new, empty or contain results; `make` makes the folder.
pub fn folder(output: &Path, make: impl FnOnce(&Path) -> Result<()>) -> Result<PathBuf> {
    let io = |e| Error::io(output, e);
    if output.is_dir() {
        let names: Vec<_> = std::fs::read_dir(output).map_err(io)?.filter_map(|e| Some(e.ok()?.file_name())).collect();
        // A run that was stopped leaves only `kept` behind.
        if !(names.is_empty() || names.iter().any(|n| n == RESULTS || n == "kept")) {
            return Err(Error::output(output, "contains other files and no results of `bench`", "name another folder"));
        }
    }
    make(output)?;
    let cache = output.join("kept");
    std::fs::create_dir_all(&cache).map_err(|e| Error::io(&cache, e))?;
    Ok(cache)
}

fn write(output: &Path, sections: &[ReportSection], provenance: &Provenance) -> Result<()> {
    let figures = output.join("figures");
    std::fs::create_dir_all(&figures).map_err(|e| Error::io(&figures, e))?;
    let mut drawn = std::collections::BTreeMap::new();
    for results in sections.iter().filter_map(|s| s.found.as_ref().ok()) {
        for table in &results.tables {
            write_bytes(&figures.join(format!("{}.csv", table.name)), csv(table).as_bytes())?;
        }
        for p in &results.plots {
            write_plots(&figures, std::slice::from_ref(p), &[FileKind::Svg, FileKind::Png])?;
        }
        for p in &results.pictures {
            let bytes = joined(p)?;
            write_bytes(&figures.join(format!("{}.png", p.name)), &bytes)?;
            drawn.insert(p.name.clone(), bytes);
        }
    }
    for s in sections {
        let page = markdown(s, provenance, "figures");
        write_bytes(&output.join(format!("{}.md", s.experiment.name)), page.as_bytes())?;
    }
    let page = html(sections, provenance, &|p| drawn.get(&p.name).cloned().unwrap_or_default());
    write_bytes(&output.join("report.html"), page.as_bytes())?;
    write_bytes(&output.join(RESULTS), results(sections, provenance).as_bytes())
}

fn results(sections: &[ReportSection], provenance: &Provenance) -> String {
    let experiments: serde_json::Map<_, _> = sections
        .iter()
        .map(|s| {
            let json = match &s.found {
                Ok(results) => serde_json::to_value(results).unwrap_or_default(),
                Err(why) => serde_json::json!({ "not_measured": why }),
            };
            (s.experiment.name.to_string(), json)
        })
        .collect();
    let all = serde_json::json!({ "made_by": provenance, "experiments": experiments });
    serde_json::to_string_pretty(&all).unwrap_or_default() + "\n"
}

/// Height of labels above pictures in pixels; pages show a row of three at two thirds of its size.
const LETTERS: f64 = 20.0;

/// The labelled pictures side by side, as a PNG.
fn joined(p: &Pictures) -> Result<Vec<u8>> {
    let panel = |(caption, picture): &(String, Rgb8)| Panel {
        caption: Some(caption.clone()),
        ..Panel::plain(FigureImage::Color(picture.clone()))
    };
    let bar = |c: &Colours| ColourBar::logarithmic(c.title.clone(), c.range, |share| c.map.color(share));
    let panels = p.panels.iter().map(panel).collect();
    let figure = Figure { bar: p.colours.as_ref().map(bar), ..Figure::plain(panels, p.columns) };
    let page = raster(&layout(&figure, LETTERS, FigureSpace::Pixels)?)?;
    coded(&plainest(page), &PngMetadata::default())
}

/// Uses grey levels if there are no colours, which takes a third of the bytes.
fn plainest(page: Rgb8) -> FigureImage {
    match page.data.iter().all(|[r, g, b]| r == g && g == b) {
        true => FigureImage::Gray(Gray8 { size: page.size, data: page.data.iter().map(|p| p[0]).collect() }),
        false => FigureImage::Color(page),
    }
}
