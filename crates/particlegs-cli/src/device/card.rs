//! Graphics cards.

use particlegs::Result;
use particlegs_gpu::{Checks, Choice, adapters, advice};
use std::sync::Arc;

pub use particlegs_gpu::Adapter;
pub use particlegs_gpu::reference::{Columns, Pictures as ParticlePictures};
pub use particlegs_gpu::render::Pictures;

/// A graphics card.
pub type Device = Arc<particlegs_gpu::Device>;

/// The one of a number, or the first real one.
pub fn open(number: Option<usize>) -> Result<Device> {
    particlegs_gpu::Device::open(number.map_or(Choice::Card, Choice::Number), Checks::Off).map(Arc::new)
}

/// The same, whose kernels are to be timed.
#[cfg(feature = "lab")]
pub fn open_timed(number: Option<usize>) -> Result<Device> {
    particlegs_gpu::Device::open_timed(number.map_or(Choice::Card, Choice::Number), Checks::Off).map(Arc::new)
}

/// Its name.
#[cfg(feature = "lab")]
pub fn name(device: &Device) -> String {
    device.name().to_string()
}

/// What trains on one.
pub fn trainer(device: &Device) -> Result<Arc<dyn particlegs::train::Device>> {
    Ok(Arc::new(particlegs_gpu::train::Trainer::new(device)?))
}

/// All of them; and what would help where none is a real card.
pub fn list() -> Result<(Vec<Adapter>, Option<String>)> {
    let all = adapters();
    let advice = all.iter().all(|a| a.software).then(advice);
    Ok((all, advice))
}
