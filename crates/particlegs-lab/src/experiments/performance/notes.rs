//! What a reader of the figures must know.

use super::clock::Machine;
use super::command::Cost;
use super::commands::CommandTiming;
use super::growth::GrowthPoint;
use super::paper;
use super::scale::{self, ScaleBlocks};
use super::tables::{SizeTimings, StartupTimes};
use crate::experiments::shared::rates::COMPARED;
use crate::results::Spread;
use crate::snapshot::Snapshot;

/// All that notes are made of.
pub(super) struct PerformanceTimings<'a> {
    pub steps: &'a StartupTimes<'a>,
    pub frames: &'a [SizeTimings],
    pub grown: &'a [GrowthPoint],
    pub commands: &'a [CommandTiming],
    pub scale: &'a ScaleBlocks,
}

pub(super) fn notes(of: &Snapshot, all: &PerformanceTimings<'_>, machine: &Machine) -> Vec<String> {
    let gaussians = all.steps.compressions.last().map_or(0, |c| c.1.gaussians);
    let mut notes = vec![
        format!(
            "Everything was timed on {}: {} particles, and a model of {gaussians} Gaussians at ratio {COMPARED}. Pictures \
             are drawn on the processor, by us and by VTK. A frame goes from particles or Gaussians in memory to grey \
             levels in memory; the model's renderer and VTK keep their buffers from frame to frame, ours of all particles takes \
             its own anew. Frames under a new camera: one on \
             each of the three orbits, at the default radius and opacity; under a new radius and opacity: three pairs of \
             the published ranges, under one camera. The model's were drawn three times each, the others once. Speed-ups \
             are ratios of the same view in the same run.",
            machine.describe(),
            of.particles.len(),
        ),
        format!(
            "The paper's figures are of an {}, {:.0} million particles and {:.0} thousand Gaussians: its milliseconds and \
             ours are not of one machine, nor of one number of particles, and stand beside each other for their order \
             alone. Its ParaView rebuilds its buffers when radius or opacity change (its row \"Combined\" stands in ours \
             of a new radius and opacity); our renderers have no such step, a model needs none. On the GPU its model took \
             {:.0} MB for drawing and {:.0} MB for training.",
            paper::HARDWARE,
            paper::PARTICLES / 1e6,
            paper::GAUSSIANS / 1e3,
            paper::DRAWING_MEMORY,
            paper::TRAINING_MEMORY,
        ),
    ];
    notes.extend(vtk(all.frames));
    notes.push(
        "Peak memory is what no file backs (RssAnon and RssShmem of /proc), looked at every millisecond: snapshots that are \
         mapped are not in it. Whole commands are given the positions as raw float32, with a certificate where they \
         compress."
            .into(),
    );
    notes.extend(growth(all.grown));
    notes.push(scaling(all.scale));
    notes.push(loads(all));
    notes
}

fn vtk(all: &[SizeTimings]) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(Err(why)) = all.first().map(|a| &a.vtk) {
        notes.push(format!("VTK was not measured: {why}."));
    }
    if let Some(v) = all.iter().find_map(|a| a.vtk.as_ref().ok()) {
        let counts: Vec<String> = all
            .iter()
            .filter_map(|a| {
                let v = a.vtk.as_ref().ok()?;
                let [cameras, settings] = [v.cameras.views.len(), v.settings.views.len()];
                Some(format!("{cameras} and {settings} at {}x{}", a.size.width, a.size.height))
            })
            .collect();
        notes.push(format!(
            "VTK {} draws its Point Gaussian off-screen by {}, set up as ParaView does it (Gaussian shader, not emissive, four \
             peels, FXAA): where that is a software renderer, VTK is slower than on a GPU, and the speed-up is that of \
             two programs on one processor, not the paper's. No further frame was begun after a time limit: frames under \
             new cameras, and under new radii and opacities, were {}.",
            v.version,
            v.opengl,
            counts.join(", "),
        ));
    }
    notes
}

fn growth(grown: &[GrowthPoint]) -> Option<String> {
    let of = |f: fn(&Cost) -> Option<f64>| {
        scale::power(grown.iter().filter_map(|g| Some([g.particles as f64, f(g.ran.cost.as_ref()?)?])))
    };
    let seconds = of(|c| Some(c.seconds))?;
    let memory = of(|c| c.peak.map(|b| b as f64));
    let memory = memory.map_or(String::new(), |m| format!(", peak memory as its power {m:.2}"));
    Some(format!(
        "Growth: over these numbers of particles the seconds of a compression grow as the number's power {seconds:.2}{memory} \
         (least squares in logarithms). Subsets are random, and as sparse as they are few; copies are of the whole box."
    ))
}

fn scaling(scale: &ScaleBlocks) -> String {
    let ours = scale.powers().map_or("could not be told".to_string(), |[bytes, gaussians]| {
        format!("grow as its power {bytes:.2} (bytes) and {gaussians:.2} (Gaussians)")
    });
    let published = scale::power(paper::SCALE.into_iter()).unwrap_or(f64::NAN);
    format!(
        "Scale: blocks are parts of the box, halved along x, y, z and x, from its lower and its upper corner; each is a \
         snapshot of its own, fitted with effort fast to the masked PSNR of {} dB (look `expected`, six held-out views of \
         the block, particle radius by its own spacing). That is {} dB below what the whole box has at ratio {COMPARED} in six other \
         views, as means over six views of one model differ by about as much: the ratio that the whole box needs stands in \
         the table. Models {ours} of the particles. The paper's \
         two points give {published:.2} for Gaussians: its blocks are trained alike, to no quality that is named, with a \
         capacity that hardly depends on their particles.",
        scale.quality,
        scale::BELOW,
    )
}

/// The loads under which all that was timed.
fn loads(all: &PerformanceTimings<'_>) -> String {
    let of_frames = all.frames.iter().flat_map(|a| {
        let ours = [&a.model, &a.paraview, &a.expected].map(|f| f.settings.load);
        ours.into_iter().chain([a.vtk.as_ref().ok().and_then(|v| v.settings.load)])
    });
    let of_commands = all.commands.iter().flat_map(|t| &t.runs).chain(all.grown.iter().map(|g| &g.ran));
    let mut loads: Vec<Option<f64>> = of_frames.chain(of_commands.map(|r| r.cost.as_ref()?.load)).collect();
    loads.extend(all.steps.compressions.iter().map(|c| c.1.load));
    loads.extend([all.steps.decoding.load, all.steps.opening.as_ref().and_then(|t| t.load)]);
    let loads: Vec<f64> = loads.into_iter().flatten().collect();
    let told = Spread::new(&loads).map_or("is not told by this system".into(), |s| {
        format!("was {:.1} (from {:.1} to {:.1}) when they were taken", s.median, s.low, s.high)
    });
    format!(
        "Load of the machine (mean number of processes that want to run, over a minute, this one's included) {told}: above \
         the number of its threads, times are of a busy machine. Times are kept as all results are, by the commit of the \
         program, the processor and the number of threads: to take them again, name another folder."
    )
}
