//! Notes of the report.

use super::clock::Machine;
use super::command::Cost;
use super::commands::CommandTiming;
use super::growth::GrowthPoint;
use super::scale::{self, ScaleBlocks};
use super::tables::{SizeTimings, StartupTimes};
use crate::experiments::published::performance as paper;
use crate::experiments::rates::COMPARED;
use crate::results::Spread;
use crate::snapshot::Snapshot;

/// All measurements.
pub(super) struct PerformanceTimings<'a> {
    pub steps: &'a StartupTimes<'a>,
    pub frames: &'a [SizeTimings],
    pub grown: &'a [GrowthPoint],
    pub commands: &'a [CommandTiming],
    pub scale: &'a ScaleBlocks,
}

pub(super) fn notes(snapshot: &Snapshot, all: &PerformanceTimings<'_>, machine: &Machine) -> Vec<String> {
    let gaussians = all.steps.compressions.last().map_or(0, |c| c.1.gaussians);
    let mut notes = vec![
        format!(
            "Everything was timed on {}: {} particles, and a model of {gaussians} Gaussians at ratio {COMPARED}. \
             Both our renderers and VTK draw pictures on the CPU. A frame goes from particles or Gaussians in \
             memory to grey levels in memory. The model's renderer and VTK reuse their buffers; our renderer of all \
             particles allocates new ones for each frame. Frames with a new camera: one on each of the three \
             orbits, at the default radius and opacity. Frames with a new radius and opacity: three pairs from the \
             published ranges with one camera. The model's frames were drawn three times each, the others once. \
             Speed-ups are ratios for the same view in the same run.",
            machine.describe(),
            snapshot.particles.len(),
        ),
        format!(
            "The paper used an {}, {:.0} million particles and {:.0} thousand Gaussians. Machine and number of \
             particles differ from ours, so only the order of the times can be compared. Its ParaView rebuilds its \
             buffers when radius or opacity change (its row \"Combined\" is in our row of a new radius and \
             opacity); our renderers need no such step. On the GPU its model took {:.0} MB for drawing and {:.0} MB \
             for training.",
            paper::HARDWARE,
            paper::PARTICLES / 1e6,
            paper::GAUSSIANS / 1e3,
            paper::DRAWING_MEMORY,
            paper::TRAINING_MEMORY,
        ),
    ];
    notes.extend(vtk(all.frames));
    notes.push(
        "Peak memory is RssAnon and RssShmem of /proc, read every millisecond; it does not include memory-mapped \
         snapshots. Whole commands read the positions as raw float32, and `compress` measures a certificate."
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
            "VTK {} draws its Point Gaussian off-screen with {}, set up as in ParaView (Gaussian shader, not \
             emissive, four peels, FXAA). With a software renderer, VTK is slower than on a GPU, and the speed-up \
             compares two programs on one CPU, unlike the paper's. VTK drew frames until a time limit; the numbers \
             of frames with new cameras, and with new radii and opacities, were {}.",
            v.version,
            v.opengl,
            counts.join(", "),
        ));
    }
    notes
}

fn growth(grown: &[GrowthPoint]) -> Option<String> {
    let growth_power = |f: fn(&Cost) -> Option<f64>| {
        scale::power(grown.iter().filter_map(|g| Some([g.particles as f64, f(g.ran.cost.as_ref()?)?])))
    };
    let seconds = growth_power(|c| Some(c.seconds))?;
    let memory = growth_power(|c| c.peak.map(|b| b as f64));
    let memory = memory.map_or(String::new(), |m| format!(", and peak memory as N^{m:.2}"));
    Some(format!(
        "Growth: for these numbers of particles N, the time of a compression grows as N^{seconds:.2}{memory} (least \
         squares in logarithms). Smaller snapshots are random subsets of the box, and larger ones are copies of the \
         whole box."
    ))
}

fn scaling(scale: &ScaleBlocks) -> String {
    let ours = scale.powers().map_or("could not be fitted to the number".to_string(), |[bytes, gaussians]| {
        format!("grow as N^{bytes:.2} (bytes) and N^{gaussians:.2} (Gaussians) with the number N")
    });
    let published = scale::power(paper::SCALE.into_iter()).unwrap_or(f64::NAN);
    format!(
        "Scale: blocks are parts of the box, halved along x, y, z and x, from its lower and its upper corner. Each \
         is its own snapshot, fitted with effort fast to a masked PSNR of {} dB (look `expected`, six held-out \
         views of the block, particle radius from its own spacing). That is {} dB below the whole box at ratio \
         {COMPARED} in six other views, because means over six views of one model differ by about that much; the \
         table shows the ratio that the whole box needs. Models {ours} of particles. The paper's two points give an \
         exponent of {published:.2} for Gaussians: its blocks are trained alike, to no stated quality, with a \
         capacity that hardly depends on their particles.",
        scale.quality,
        scale::BELOW,
    )
}

/// Note on the load of the machine.
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
    let load_text = Spread::new(&loads).map_or("is not available on this system".into(), |s| {
        format!("was {:.1} ({:.1} to {:.1}) during the measurements", s.median, s.low, s.high)
    });
    format!(
        "The load of the machine (mean number of runnable processes over a minute, with this one) {load_text}. If it \
         exceeds the number of threads, the machine was busy. Like all results, times are stored by commit, CPU and \
         number of threads: to measure again, use another folder."
    )
}
