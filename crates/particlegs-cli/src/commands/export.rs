//! `particlegs export MODEL -o OUT`.

use crate::common::{CommandContext, Common, named};
use crate::inputs::FrameArgs;
use crate::outputs::ForceArgs;
use crate::page_args::{AppearanceArgs, PageArgs};
use crate::picture_args::range_of;
use clap::{Args, ValueHint};
use particlegs::input::ModelOrSeries;
use particlegs::{ExportOptions, Model, plan_export};
use particlegs_core::codec::FileInfo;
use particlegs_core::{Error, Result};
use particlegs_export::{Cells, ColorBy, Group, Kind};
use particlegs_files::input::is_stream;
use particlegs_view::page::PageOpening;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(
    after_help = "\
For particles, run `recover`, then `convert` to any format.

Examples:
  particlegs export M.pgs -o page.html
  particlegs export M.pgs -o splats.ply --color density
  particlegs export M.pgs -o density.vti --grid 256",
    after_long_help = "\
What is lost; each file says so itself:
  .ply .glb .gltf   counts, masses and the box; the splats are for viewers that sort and blend, and
                    approximate an optical-depth model at one radius and opacity
  .npy .vti .fits .dx .mrc
                    structure smaller than a cell: cells hold mass or number per volume
  .npz .csv         blocks, certificate and VizMapper; the Gaussians are complete
  .html             nothing: the page contains the model file

For particles, run `recover`, then `convert` to any format:
  particlegs recover M.pgs -o particles && particlegs convert particles -o particles.hdf5

Examples:
  particlegs export M.pgs -o page.html                        # opens in any browser, offline
  particlegs export run.pgs -o run.html --link                # a series, for a web server
  particlegs export M.pgs -o splats.ply                       # as for 3-D Gaussian splatting
  particlegs export M.pgs -o splats.glb --color layer         # glTF with KHR_gaussian_splatting
  particlegs export M.pgs -o splats.ply --opacity 0.5 --color density --colormap viridis
  particlegs export M.pgs -o density.npy --grid 256           # and density.json beside it
  particlegs export M.pgs -o density.vti --cell 0.5           # for ParaView
  particlegs export M.pgs -o density.vti --fields velocity    # with its mean and dispersion in each cell
  particlegs export M.pgs -o density.fits --layer dm
  particlegs export M.pgs -o water.mrc --layer water          # or .dx: for VMD, PyMOL, ChimeraX
  particlegs export M.pgs -o gaussians.npz                    # means, covariances, counts, masses
  particlegs export M.pgs -o - --kind csv | head

docs/guide/export.md describes every file."
)]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "MODEL", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// File to write: .html .ply .glb .gltf .npy .vti .fits .dx .mrc .npz .csv.
    ///
    /// The extension selects what is written.
    #[arg(long, short, alias = "out", value_name = "OUT", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    /// What to write, if the extension does not tell.
    #[arg(long, value_name = "KIND", value_parser = named::<Kind>())]
    kind: Option<Kind>,
    /// Layers to write: species such as gas or dm, names that `info` lists, or `all`.
    ///
    /// A page contains all layers, and opens with these.
    #[arg(long = "layer", alias = "layers", value_name = "NAME,...", value_delimiter = ',', default_value = "all")]
    layers: Vec<String>,
    /// Leave the model's file out of the page, which then loads it from its own folder on a web server.
    ///
    /// A series plays while its frames are loading, if the server supports HTTP Range, as most do.
    #[arg(long, hide_short_help = true)]
    link: bool,
    #[command(flatten)]
    page: PageArgs,
    #[command(flatten, next_help_heading = "Pages and splats (.html, .ply, .glb, .gltf)")]
    dials: AppearanceArgs,
    #[command(flatten)]
    splats: SplatArgs,
    #[command(flatten)]
    grid: GridArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    series: FrameArgs,
    #[command(flatten)]
    common: Common,
}

#[derive(Args)]
#[command(next_help_heading = "Splats (.ply, .glb, .gltf)")]
struct SplatArgs {
    /// What the colours show.
    #[arg(long, value_name = "WHAT", default_value = "grey", value_parser = named::<ColorBy>())]
    color: ColorBy,
}

#[derive(Args)]
#[command(next_help_heading = "Density on a grid (.npy, .vti, .fits, .dx, .mrc)")]
struct GridArgs {
    /// Cells along the longest edge of the box [default: 128].
    #[arg(long, value_name = "N", conflicts_with = "cell")]
    grid: Option<usize>,
    /// Edge of a cell in world units, rounded so that cells fill the box.
    #[arg(long, value_name = "SIZE")]
    cell: Option<f64>,
    /// Fields to add, or `all`: mean and dispersion in each cell (.vti, .fits).
    ///
    /// Means are over the cell, weighted by density, as the density is the mean over the cell. They are NaN where no
    /// Gaussian with the field reaches. A vector has three components. `info` lists the fields.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fields: Vec<String>,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads([&a.model].into_iter().chain(a.page.files()).map(PathBuf::as_path), a.force.force)?;
    let kind = plan_export(&a.output, a.kind, &context.outputs, &context)?;
    let start = Instant::now();
    if a.link && is_stream(&a.model) {
        return Err(Error::argument("--link needs the name of a file that the page can load, not standard input"));
    }
    if a.link && a.series.is_given() {
        let message = "--link leaves the whole file beside the page, so it takes no --frame or --time";
        return Err(Error::argument_with(message, "extract the frame first, or leave out --link"));
    }
    let paged = kind.group() == Group::Page;
    // A page can play a whole series; all other files hold one moment of it.
    let content = match paged && !a.series.is_given() {
        true => ModelOrSeries::open(&a.model, &context)?,
        false => ModelOrSeries::Model(Model::open_frame(&a.model, &a.series.choice(), &context)?.into()),
    };
    let opening = match (&content, paged) {
        (_, false) => PageOpening::default(),
        (ModelOrSeries::Model(model), _) => a.opening(&model.info()?, &context)?,
        (ModelOrSeries::Series(series), _) => a.opening(&series.first_info()?, &context)?,
    };
    let options = ExportOptions {
        kind: a.kind,
        layers: a.layers,
        cells: match (a.grid.grid, a.grid.cell) {
            (_, Some(side)) => Cells::OfSide(side),
            (Some(n), None) => Cells::Along(n),
            (None, None) => Cells::default(),
        },
        fields: a.grid.fields,
        color: a.splats.color,
        colormap: a.dials.colormap.unwrap_or_default(),
        range: range_of(a.dials.range.as_deref())?,
        radius: a.dials.radius,
        opacity: a.dials.opacity,
        opening,
        link: a.link,
    };
    let export = match content {
        ModelOrSeries::Model(model) => model.export(&a.output, &options, &context.outputs, &context)?,
        ModelOrSeries::Series(series) => series.export(&a.output, &options, &context.outputs, &context)?,
    };
    let (out, megabytes, seconds) = (a.output.display(), export.bytes as f64 / 1e6, start.elapsed().as_secs_f64());
    let text = format!("{out}: {}, {megabytes:.1} MB, in {seconds:.2} s", export.content);
    let mut report = json!({
        "output": a.output.to_string_lossy(), "kind": kind.ending(), "gaussians": export.gaussians,
        "bytes": export.bytes, "seconds": seconds, "lost": export.lost,
    });
    report.as_object_mut().into_iter().for_each(|r| r.extend(export.figures.as_object().cloned().unwrap_or_default()));
    context.finish(&text, &report)
}

impl Arguments {
    fn opening(&self, info: &FileInfo, context: &CommandContext) -> Result<PageOpening> {
        self.page.opening(&self.dials, &self.layers, &[info], context)
    }
}
