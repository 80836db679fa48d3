//! `--device`: the CPU or a GPU.

use clap::Args;
use particlegs_core::{Error, Result};
use particlegs_train::Accelerator;
use std::str::FromStr;
use std::sync::Arc;

/// The option.
#[derive(Args, Clone, Debug)]
pub struct DeviceArgs {
    /// Device: `cpu`, `gpu`, `auto` (a GPU if there is one), or a number that `devices` lists.
    ///
    /// GPUs use float32: grey levels may differ by one from the CPU's, which are reproducible.
    #[arg(long, value_name = "DEVICE", default_value = "cpu", hide_short_help = true)]
    device: DeviceRequest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DeviceRequest {
    Cpu,
    Auto,
    Gpu,
    Number(usize),
}

impl FromStr for DeviceRequest {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<DeviceRequest, String> {
        match text {
            "cpu" => Ok(DeviceRequest::Cpu),
            "auto" => Ok(DeviceRequest::Auto),
            "gpu" => Ok(DeviceRequest::Gpu),
            number => number.parse().map(DeviceRequest::Number).map_err(|_| "not cpu, gpu, auto or a number".into()),
        }
    }
}

impl DeviceArgs {
    /// The GPU; `None` = the CPU.
    pub fn open(&self) -> Result<Option<Arc<dyn Accelerator>>> {
        match self.device {
            DeviceRequest::Cpu => Ok(None),
            DeviceRequest::Auto => Ok(accelerator(None).ok()),
            DeviceRequest::Gpu => accelerator(None).map(Some),
            DeviceRequest::Number(n) => accelerator(Some(n)).map(Some),
        }
    }

    /// [`DeviceArgs::open`] for training; without training a GPU is refused.
    pub fn trainer(&self, trains: bool) -> Result<Option<Arc<dyn Accelerator>>> {
        match self.device {
            _ if trains => self.open(),
            DeviceRequest::Cpu | DeviceRequest::Auto => Ok(None),
            DeviceRequest::Gpu | DeviceRequest::Number(_) => {
                Err(Error::argument("--device has no effect without --train: here a GPU only trains"))
            }
        }
    }

    /// The requested GPU, or the first real one, with kernels that can be timed.
    #[cfg(all(feature = "gpu", feature = "lab"))]
    pub fn open_timed(&self) -> Result<particlegs_lab::gpu::TimedDevice> {
        let number = if let DeviceRequest::Number(n) = self.device { Some(n) } else { None };
        particlegs_lab::gpu::TimedDevice::open(choice(number), particlegs_gpu::Checks::Off)
    }
}

/// The GPU with a number, or the first real one.
#[cfg(feature = "gpu")]
fn accelerator(number: Option<usize>) -> Result<Arc<dyn Accelerator>> {
    let device = particlegs_gpu::Device::open(choice(number), particlegs_gpu::Checks::Off)?;
    Ok(Arc::new(particlegs_gpu::GpuAccelerator::new(Arc::new(device))))
}

#[cfg(feature = "gpu")]
fn choice(number: Option<usize>) -> particlegs_gpu::AdapterChoice {
    number.map_or(particlegs_gpu::AdapterChoice::Gpu, particlegs_gpu::AdapterChoice::Number)
}

/// Stands for GPUs in a program without GPU support.
#[cfg(not(feature = "gpu"))]
fn accelerator(_: Option<usize>) -> Result<Arc<dyn Accelerator>> {
    Err(no_gpu_support())
}

/// The error of a program without GPU support.
#[cfg(not(feature = "gpu"))]
pub fn no_gpu_support() -> Error {
    let message = "this program was built without GPU support";
    Error::argument_with(message, "build it with `cargo build --release -p particlegs-cli --features gpu`")
}
