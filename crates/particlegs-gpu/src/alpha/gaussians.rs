//! Gaussians on the device, in the training frame.

use super::adapt::NetworkBuffers;
use super::fixed;
use crate::Device;
use crate::render::factor;
use particlegs_core::camera::View;
use particlegs_core::model::{Mixture, VizRanges};
use particlegs_core::render::Scene;
use particlegs_core::render::alpha::Blend;
use particlegs_core::render::alpha::network::{Setting, inputs};
use particlegs_core::{Error, Hint, Result};

/// Words of a Gaussian, each a column: see project.wgsl.
pub(crate) const COLUMNS: usize = 16;
/// The column of the odds against its opacity.
const ODDS: usize = 12;
/// Gaussians of a buffer at most: a binding has 128 MiB on many GPUs.
pub(crate) const MOST: usize = 1 << 21;
/// Opacities of these odds against are below every threshold.
const NEVER: f32 = 3e38;

/// The Gaussians of a scene of the alpha-blend law on a device, and its network.
pub struct Gaussians {
    pub(super) chunks: Vec<AlphaGaussianChunk>,
    pub(super) network: Option<NetworkBuffers>,
    /// Frame and defaults; the network is on the device.
    pub(super) blend: Blend<'static>,
}

pub(super) struct AlphaGaussianChunk {
    pub columns: wgpu::Buffer,
    /// The network's changes to each.
    pub bent: wgpu::Buffer,
    /// The number that come before.
    pub first: u32,
    pub count: u32,
}

impl Gaussians {
    /// Of a scene of the alpha-blend law.
    pub fn upload(device: &Device, scene: &Scene) -> Result<Gaussians> {
        let seen = (device.largest_binding() / (4 * COLUMNS as u64)) as usize;
        Gaussians::upload_in(device, scene, MOST.min(seen))
    }

    /// [`Gaussians::upload`] in buffers of so many at most.
    pub(super) fn upload_in(device: &Device, scene: &Scene, most: usize) -> Result<Gaussians> {
        let Some(blend) = scene.blend() else {
            return Err(Error::argument("cannot draw an optical-depth scene with the alpha-blend law"));
        };
        let all: usize = scene.parts().map(Mixture::len).sum();
        // Kernels number Gaussians with 32 bits.
        if u32::try_from(all).is_err() {
            return Err(Error::argument_with(format!("{all} Gaussians are too many for a GPU"), Hint::use_cpu()));
        }
        let mut some = scene.parts().flat_map(|m| (0..m.len()).map(move |i| (m, i)));
        let mut chunks = Vec::new();
        for first in (0..all).step_by(most.max(1)) {
            let n = most.max(1).min(all - first);
            chunks.push(AlphaGaussianChunk::new(device, &blend, some.by_ref().take(n), [first, n])?);
            device.check()?;
        }
        let network = blend.vizmapper.map(|v| NetworkBuffers::new(device, v, chunks.len()));
        device.check()?;
        Ok(Gaussians { chunks, network, blend: Blend { vizmapper: None, ..blend } })
    }

    /// Those that `columns` are to hold when they are drawn, in one buffer, with a network whose numbers are to lie in
    /// another.
    pub(crate) fn of_buffers(
        device: &Device,
        [columns, bent]: [wgpu::Buffer; 2],
        count: u32,
        network: Option<(wgpu::Buffer, VizRanges)>,
        blend: Blend<'static>,
    ) -> Gaussians {
        let chunks = vec![AlphaGaussianChunk { columns, bent, first: 0, count }];
        let network = network.map(|(weights, ranges)| NetworkBuffers::of_buffer(device, weights, ranges, chunks.len()));
        Gaussians { chunks, network, blend }
    }

    /// The network or the Gaussians were changed.
    pub(crate) fn changed(&self) {
        if let Some(network) = &self.network {
            network.forget();
        }
    }

    /// The view's radius and opacity over the defaults, for the network.
    pub(super) fn setting(&self, view: &View) -> Setting {
        self.blend.setting(view)
    }

    pub fn len(&self) -> usize {
        self.chunks.iter().map(|c| c.count as usize).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl AlphaGaussianChunk {
    /// Of `n` Gaussians that `first` come before.
    fn new<'a>(
        device: &Device,
        blend: &Blend,
        some: impl Iterator<Item = (&'a Mixture, usize)>,
        [first, n]: [usize; 2],
    ) -> Result<AlphaGaussianChunk> {
        let mut columns = vec![0u32; COLUMNS * n];
        for (place, (m, i)) in some.enumerate() {
            let words = column(blend, m, i).map_err(|(message, hint)| {
                Error::argument_with(format!("Gaussian {}: {message}", first + place), hint)
            })?;
            words.iter().enumerate().for_each(|(k, v)| columns[k * n + place] = *v);
        }
        use wgpu::BufferUsages as Use;
        Ok(AlphaGaussianChunk {
            columns: device.filled("gaussians", &columns, Use::STORAGE),
            // Without a network they stay as they are.
            bent: device.filled("bent", &vec![[1.0f32; 2]; n], Use::STORAGE),
            first: first as u32,
            count: n as u32,
        })
    }
}

/// The numbers of a Gaussian.
fn column(blend: &Blend, m: &Mixture, i: usize) -> std::result::Result<[u32; COLUMNS], (String, Hint)> {
    let trained = blend.trained(m, i).map_err(|message| (message, Hint::default()))?;
    let g = trained.gaussian;
    // Those that are a Gaussian's own do not depend on the setting.
    let [_, _, scale, logit] = inputs(Setting { radius: 1.0, opacity: 1.0 }, trained.log_scale, trained.logit);
    let factor = factor(&g.cov).map(|v| v as f32);
    // The odds against it: so an opacity of 1 is a finite number, and the network's factor divides them.
    let odds = ((1.0 - g.opacity) / g.opacity) as f32;
    let mut values = [0.0; COLUMNS];
    values[6..ODDS].copy_from_slice(&factor);
    values[ODDS..].copy_from_slice(&[odds, g.grey as f32, scale, logit]);
    if !values.iter().all(|v| v.is_finite()) {
        // The CPU does not draw values outside float32 either.
        values = [0.0; COLUMNS];
        values[ODDS] = NEVER;
    }
    let mut words = values.map(f32::to_bits);
    for (k, v) in g.mean.into_iter().enumerate() {
        let far = "it is more than a million boxes away, too far for GPU arithmetic";
        let coordinate = fixed::place(v).ok_or_else(|| (far.into(), Hint::use_cpu()))?;
        words[2 * k..2 * k + 2].copy_from_slice(&coordinate);
    }
    Ok(words)
}
