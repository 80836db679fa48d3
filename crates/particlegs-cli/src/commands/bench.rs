//! `particlegs bench NAME SNAPSHOT... -o DIR`.

use crate::common::Common;
use crate::device::DeviceArgs;
use crate::snapshot_args::SnapshotArgs;
use clap::Args;
use particlegs_core::Result;
use particlegs_lab::bench::{self, BenchOptions};
use std::path::PathBuf;

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
    #[command(flatten)]
    bench: BenchOptions,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

/// Runs experiments and writes their results.
pub fn run(a: &Arguments) -> Result<()> {
    let bench = &a.bench;
    if bench.name == "list" {
        let context = a.common.clone().start()?;
        context.reads(std::iter::empty(), false)?;
        let list = bench::list();
        return context.finish(&list.text, &list.value);
    }
    if bench.name == "gpu" {
        return gpu(a);
    }
    bench.chosen()?;
    let settings = bench.settings(a.common.seed, a.device.open()?)?;
    let output = bench.results()?;
    let context = a.common.clone().start()?;
    context.reads(bench.snapshots.iter().chain(&a.snapshot.topology).map(PathBuf::as_path), false)?;
    let folder = bench::folder(output, |folder| context.outputs.make_folder(folder))?;
    let (choice, read) = (a.snapshot.choice()?, a.snapshot.describe());
    let measurements = bench.measure(settings, &folder, (&choice, read.as_deref()), &context)?;
    context.finish(&measurements.text, &measurements.value)
}

/// Measures a GPU without a snapshot: the first real one, or that of --device. With --training it also trains by the
/// published recipe, with a checkpoint in a folder.
#[cfg(feature = "gpu")]
fn gpu(a: &Arguments) -> Result<()> {
    use std::sync::Arc;
    let bench = &a.bench;
    bench.refuse_for_gpu(a.snapshot.describe().as_deref())?;
    let context = a.common.clone().start()?;
    let device = a.device.open_timed()?;
    let trainer = particlegs_gpu::GpuAccelerator::new(Arc::clone(&device.device));
    let settings = bench.settings(a.common.seed, Some(Arc::new(trainer)))?;
    let make = |folder: &std::path::Path| context.outputs.make_folder(folder);
    let folder = bench.output.as_deref().map(|folder| bench::folder(folder, make)).transpose()?;
    if folder.is_some() {
        context.finishes_its_steps();
    }
    let measurements = bench.measure_gpu(device, settings, &folder.unwrap_or_default(), &context)?;
    context.finish(&measurements.text, &measurements.value)
}

#[cfg(not(feature = "gpu"))]
fn gpu(a: &Arguments) -> Result<()> {
    a.bench.refuse_for_gpu(a.snapshot.describe().as_deref())?;
    Err(crate::device::no_gpu_support())
}
