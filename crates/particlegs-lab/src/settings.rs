//! Settings of the experiments.

use particlegs_core::picture::Size;
use particlegs_train::Accelerator;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct Settings {
    /// Small pictures, few ratios and one view per orbit, to check that everything runs.
    pub quick: bool,
    /// Also run experiments that train models.
    pub training: bool,
    /// Size of the scored pictures.
    pub size: Size,
    pub frames: usize,
    /// Compression ratios, ascending.
    pub ratios: Vec<f64>,
    pub seed: u64,
    /// Number of seeds for random results.
    pub seeds: usize,
    /// Share of the published recipe's pixels, steps and Gaussians to train with; `None` = each experiment's default.
    pub scale: Option<f64>,
    /// Minutes after which a long training run pauses, to be continued by the same command; `None` = the experiment's
    /// default.
    pub minutes: Option<f64>,
    /// Python with the packages of other compressors and renderers.
    pub python: Option<PathBuf>,
    /// Device that draws scored pictures and trains; `None` = the CPU, whose results are reproducible.
    pub device: Option<Arc<dyn Accelerator>>,
    /// Path of this program, to measure whole commands.
    pub program: PathBuf,
}

impl Settings {
    pub fn new(quick: bool, program: PathBuf) -> Settings {
        let (size, frames, seeds) = match quick {
            true => (Size { width: 640, height: 360 }, 1, 2),
            false => (Size { width: 1920, height: 1080 }, 2, 3),
        };
        let ratios = match quick {
            true => vec![50.0, 263.0, 1000.0],
            false => vec![20.0, 50.0, 100.0, 263.0, 500.0, 1000.0, 2000.0, 5000.0],
        };
        let (training, scale, minutes, python, device) = (false, None, None, None, None);
        Settings { quick, training, size, frames, ratios, seed: 42, seeds, scale, minutes, python, device, program }
    }

    pub fn device_name(&self) -> Option<&str> {
        self.device.as_ref().map(|d| d.name())
    }

    pub fn seeds(&self) -> impl Iterator<Item = u64> {
        let first = self.seed;
        (0..self.seeds as u64).map(move |i| first + i)
    }
}
