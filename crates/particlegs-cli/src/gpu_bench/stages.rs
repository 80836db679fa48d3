//! Where the time of a frame, a step or a picture goes, kernel by kernel, on devices that show their clock.

use particlegs::Result;
use particlegs_gpu::Device;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A kernel's part.
#[derive(Serialize, Deserialize)]
struct KernelStage {
    kernel: String,
    /// Runs a frame, step or picture, and how long they take together.
    runs: f64,
    milliseconds: f64,
}

/// Kernels in the order of their first runs; none where the device shows no clock.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
pub struct KernelStages(Option<Vec<KernelStage>>);

impl KernelStages {
    /// Of `work`, which is so many frames, steps or pictures.
    pub fn of(device: &Arc<Device>, number: usize, work: impl FnOnce() -> Result<()>) -> Result<KernelStages> {
        let one = |s: particlegs_gpu::KernelTime| KernelStage {
            kernel: s.kernel.into(),
            runs: s.runs as f64 / number as f64,
            milliseconds: 1e3 * s.seconds / number as f64,
        };
        Ok(KernelStages(device.timed(work)?.map(|all| all.into_iter().map(one).collect())))
    }

    /// Milliseconds of all, and of those that take a hundredth of that or more, the longest first.
    fn text(&self) -> Option<String> {
        let mut all: Vec<&KernelStage> = self.0.as_ref()?.iter().collect();
        all.sort_by(|a, b| b.milliseconds.total_cmp(&a.milliseconds));
        let sum: f64 = all.iter().map(|s| s.milliseconds).sum();
        let long = all.iter().filter(|s| s.milliseconds >= 0.01 * sum);
        let each = long.map(|s| format!("{} {:.3}", s.kernel, s.milliseconds)).collect::<Vec<_>>().join("; ");
        Some(format!("{sum:.3} ms: {each}"))
    }

    /// Those of all rows, a line each behind what the row is of.
    pub fn table<'a>(rows: impl IntoIterator<Item = (String, &'a KernelStages)>) -> String {
        let line = |(of, stages): (String, &KernelStages)| Some(format!("\n{of}: {}", stages.text()?));
        let lines: String = rows.into_iter().filter_map(line).collect();
        match lines.is_empty() {
            true => "kernels: not timed, as the device shows no clock".into(),
            false => format!("milliseconds of kernels, but for those below a hundredth{lines}"),
        }
    }
}
