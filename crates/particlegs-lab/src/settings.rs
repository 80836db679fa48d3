//! How finely experiments measure.

use particlegs_pipeline::picture::Size;
use particlegs_pipeline::train::Accelerator;
use std::path::PathBuf;
use std::sync::Arc;

/// What is measured, and how finely.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Small pictures, few ratios, one frame an orbit: to see that all of it runs.
    pub quick: bool,
    /// Also experiments that train models.
    pub training: bool,
    /// Pixels of the pictures that are scored.
    pub size: Size,
    pub frames: usize,
    /// Raw bytes over bytes of a file, rising.
    pub ratios: Vec<f64>,
    pub seed: u64,
    /// Seeds, where a draw or a start is random.
    pub seeds: usize,
    /// Share of the published recipe's pixels, steps and Gaussians that models are trained with; `None` = each
    /// experiment's own.
    pub scale: Option<f64>,
    /// Minutes after which a long training run ends for now, to be gone on from by the same command; `None` = the
    /// experiment's own.
    pub minutes: Option<f64>,
    /// A Python that has the packages of other compressors and renderers.
    pub python: Option<PathBuf>,
    /// What draws the pictures that are scored, and trains; `None` = the CPU, whose results are the same everywhere.
    pub device: Option<Arc<dyn Accelerator>>,
    /// This program, where whole commands are measured.
    pub program: PathBuf,
}

impl Settings {
    /// The settings of `--quick`, or the full ones.
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

    /// The device's name, where there is one.
    pub fn device_name(&self) -> Option<&str> {
        self.device.as_ref().map(|d| d.name())
    }

    pub fn seeds(&self) -> impl Iterator<Item = u64> {
        let first = self.seed;
        (0..self.seeds as u64).map(move |i| first + i)
    }
}
