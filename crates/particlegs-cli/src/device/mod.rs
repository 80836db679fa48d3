//! `--device`: what draws and trains.

#[cfg(feature = "gpu")]
mod card;
#[cfg(not(feature = "gpu"))]
#[path = "no_card.rs"]
mod card;
#[cfg(feature = "lab")]
mod lab;
mod particles;

pub use card::{Adapter, Device, ParticlePictures, Pictures, list};
#[cfg(all(feature = "gpu", feature = "lab"))]
pub use lab::NamedDevice;
pub use particles::{ModelAndParticles, on_card};

use clap::Args;
use particlegs::{Error, Result, train};
use std::str::FromStr;
use std::sync::Arc;

/// The option.
#[derive(Args, Clone, Debug)]
pub struct DeviceArgs {
    /// What computes: `cpu`, `gpu`, `auto` (a graphics card where there is one), or a number that `devices` lists.
    ///
    /// Cards count in float32: levels may differ by one from the processor's, which are the same everywhere.
    #[arg(long, value_name = "DEVICE", default_value = "cpu", hide_short_help = true)]
    device: DeviceRequest,
}

/// What is asked for.
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
            number => number.parse().map(DeviceRequest::Number).map_err(|_| "it is cpu, gpu, auto or a number".into()),
        }
    }
}

impl DeviceArgs {
    /// What takes the steps of training, where anything is trained; none for the processor.
    pub fn trainer(&self, trains: bool) -> Result<Option<Arc<dyn train::Device>>> {
        if trains {
            return self.open()?.as_ref().map(card::trainer).transpose();
        }
        match self.device {
            DeviceRequest::Cpu | DeviceRequest::Auto => Ok(None),
            DeviceRequest::Gpu | DeviceRequest::Number(_) => {
                Err(Error::argument("--device: nothing is trained here that a card could do: --train"))
            }
        }
    }

    /// What draws and trains for the laboratory.
    #[cfg(feature = "lab")]
    pub fn for_lab(&self) -> Result<Arc<dyn particlegs_lab::device::Device>> {
        Ok(match self.open()? {
            Some(device) => Arc::new(lab::NamedDevice::new(device)?),
            None => Arc::new(particlegs_lab::device::Processor),
        })
    }

    /// The card that is asked for, the first real one where none is, to be measured.
    #[cfg(feature = "lab")]
    pub fn open_card(&self) -> Result<Device> {
        match self.device {
            DeviceRequest::Number(n) => card::open_timed(Some(n)),
            DeviceRequest::Cpu | DeviceRequest::Auto | DeviceRequest::Gpu => card::open_timed(None),
        }
    }

    /// The card that is asked for; none for the processor.
    pub fn open(&self) -> Result<Option<Device>> {
        match self.device {
            DeviceRequest::Cpu => Ok(None),
            DeviceRequest::Auto => Ok(card::open(None).ok()),
            DeviceRequest::Gpu => card::open(None).map(Some),
            DeviceRequest::Number(n) => card::open(Some(n)).map(Some),
        }
    }
}
