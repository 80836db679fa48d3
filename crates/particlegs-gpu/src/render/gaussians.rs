//! Gaussians on the device.

use super::frame::two_floats;
use crate::Device;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{LawKind, Mixture};
use particlegs_core::render::Scene;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::slices::{LARGEST_SPREAD, REACH};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};

/// Floats of a Gaussian, each a column: see project.wgsl.
const COLUMNS: usize = 13;
/// Gaussians of a buffer at most: a dispatch has 65,535 groups at most, and a binding 128 MiB on many GPUs.
pub(crate) const MOST: usize = 1 << 21;

/// The largest sum over pixels of a footprint of a density: its peak is at most five times that, which kernels can sum.
const LARGEST_SUM: f64 = 8192.0;

/// The Gaussians of a scene on a device, about a point near them.
pub struct Gaussians {
    pub(super) chunks: Vec<GaussianChunk>,
    pub(super) origin: [f64; 3],
    pub(super) bounds: Bounds,
    pub(super) shifts: Vec<[f64; 3]>,
    /// Their extent; none where training moves them.
    extent: Option<GaussianExtent>,
    /// The largest weight, which those of densities are over, so that float32 holds them in any unit.
    heaviest: Option<f64>,
}

/// Bounds of Gaussians' means, and the standard deviation that none of them exceeds.
struct GaussianExtent {
    means: Bounds,
    sigma: f64,
}

pub(super) struct GaussianChunk {
    pub columns: wgpu::Buffer,
    pub count: u32,
}

impl Gaussians {
    /// Of a scene of the optical-depth law, for its depth.
    pub fn upload(device: &Device, scene: &Scene) -> Result<Gaussians> {
        Gaussians::upload_in(device, scene, most(device))
    }

    /// The same for its surface density.
    pub fn upload_weighed(device: &Device, scene: &Scene) -> Result<Gaussians> {
        let heaviest = scene.weights().fold(0.0, f64::max);
        let gaussians = Gaussians::send(device, scene, scene.weights().map(|w| w / heaviest), most(device))?;
        Ok(Gaussians { heaviest: Some(heaviest), ..gaussians })
    }

    /// [`Gaussians::upload`] in buffers of so many at most.
    pub(super) fn upload_in(device: &Device, scene: &Scene, most: usize) -> Result<Gaussians> {
        Gaussians::send(device, scene, scene.parts().flat_map(|m| m.count.iter().copied()), most)
    }

    fn send(device: &Device, scene: &Scene, weights: impl Iterator<Item = f64>, most: usize) -> Result<Gaussians> {
        if scene.law() != LawKind::OpticalDepth {
            return Err(Error::argument("cannot draw an alpha-blend scene with the optical-depth law"));
        }
        // A repeated scene's bounds are those of all its images.
        let bounds = *scene.bounds();
        let extent = Some(GaussianExtent::new(scene));
        let origin = each_axis(|k| 0.5 * (bounds.min[k] + bounds.max[k]));
        let mut left: usize = scene.parts().map(Mixture::len).sum();
        let mut all = scene.parts().flat_map(|m| (0..m.len()).map(move |i| (m, i))).zip(weights);
        let mut chunks = Vec::new();
        while left > 0 {
            let n = left.min(most.max(1));
            chunks.push(GaussianChunk::new(device, all.by_ref().take(n), n, origin));
            left -= n;
            device.check()?;
        }
        Ok(Gaussians { chunks, origin, bounds, shifts: scene.shifts().to_vec(), extent, heaviest: None })
    }

    /// Those of a buffer that has the columns, and may have more, about `origin`.
    pub(crate) fn of_buffer(columns: wgpu::Buffer, count: u32, origin: [f64; 3], bounds: Bounds) -> Gaussians {
        Gaussians {
            chunks: vec![GaussianChunk { columns, count }],
            origin,
            bounds,
            shifts: vec![[0.0; 3]],
            extent: None,
            heaviest: None,
        }
    }

    /// Whether a lens may cut any of them along depth: else the kernels that draw those need not run.
    pub(super) fn may_be_cut(&self, lens: &Lens) -> bool {
        let cuts = |extent: &GaussianExtent| self.shifts.iter().any(|s| extent.may_be_cut(&lens.shifted(*s)));
        self.extent.as_ref().is_none_or(cuts)
    }

    /// How many times as large kernels see the depth through a lens: 1, but densities, which are of any unit, as large as
    /// sums of whole numbers allow.
    pub(super) fn exposure(&self, lens: &Lens) -> f64 {
        let (Some(extent), Some(heaviest)) = (&self.extent, self.heaviest) else { return 1.0 };
        let nearest = self.shifts.iter().map(|s| extent.depths(&lens.shifted(*s))[0]).fold(f64::INFINITY, f64::min);
        let nearest = if lens.perspective { nearest.max(lens.range[0]) } else { 1.0 };
        LARGEST_SUM * nearest * nearest / (lens.unit * heaviest)
    }

    /// The weight that a column's 1 stands for.
    pub(super) fn unit(&self) -> f64 {
        self.heaviest.unwrap_or(1.0)
    }

    /// The first buffer of theirs.
    pub(crate) fn buffer(&self) -> &wgpu::Buffer {
        &self.chunks[0].columns
    }

    pub fn len(&self) -> usize {
        self.chunks.iter().map(|c| c.count as usize).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Share that float32 may round.
const ROOM: f64 = 1.001;

impl GaussianExtent {
    fn new(scene: &Scene) -> GaussianExtent {
        let mut extent =
            GaussianExtent { means: Bounds { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] }, sigma: 0.0 };
        for (m, i) in scene.parts().flat_map(|m| (0..m.len()).map(move |i| (m, i))) {
            let (mean, [xx, _, _, yy, _, zz]) = (m.mean_of(i), m.cov_of(i).0);
            extent.means.min = each_axis(|k| extent.means.min[k].min(mean[k]));
            extent.means.max = each_axis(|k| extent.means.max[k].max(mean[k]));
            // The root of the trace is at least the standard deviation along any direction.
            extent.sigma = extent.sigma.max((xx + yy + zz).sqrt());
        }
        extent
    }

    /// Whether a Gaussian may reach beyond the lens's range or be too wide for its distance.
    fn may_be_cut(&self, lens: &Lens) -> bool {
        let ([nearest, farthest], [near, far], sigma) = (self.depths(lens), lens.range, self.spread(lens));
        // Negated as a whole, so that the answer is yes where a bound is not a number.
        let whole = nearest > near
            && farthest < far
            && (!lens.perspective || sigma < LARGEST_SPREAD / ROOM * (nearest + REACH * sigma));
        !whole
    }

    /// Depths between which all are seen: those of the corners of the box of means, with room for what float32 rounds.
    fn depths(&self, lens: &Lens) -> [f64; 2] {
        let forward = lens.axes[2];
        let along = each_axis(|k| {
            let ends = [self.means.min[k], self.means.max[k]].map(|v| forward[k] * (v - lens.position[k]));
            [ends[0].min(ends[1]), ends[0].max(ends[1])]
        });
        let [nearest, farthest] = [0, 1].map(|end| along.iter().map(|a| a[end]).sum::<f64>());
        let room = (ROOM - 1.0) * nearest.abs().max(farthest.abs()) + REACH * self.spread(lens);
        [nearest - room, farthest + room]
    }

    /// The standard deviation of depth that none exceeds.
    fn spread(&self, lens: &Lens) -> f64 {
        ROOM * self.sigma * lens.axes[2].iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

impl GaussianChunk {
    fn new<'a>(
        device: &Device,
        some: impl Iterator<Item = ((&'a Mixture, usize), f64)>,
        n: usize,
        origin: [f64; 3],
    ) -> GaussianChunk {
        let mut columns = vec![0.0f32; COLUMNS * n];
        for (place, ((m, i), weight)) in some.enumerate() {
            let (mean, factor) = (m.mean_of(i), factor(&m.cov_of(i)));
            let mut put = |column: usize, v: f32| columns[column * n + place] = v;
            for k in 0..3 {
                let [high, low] = two_floats(mean[k] - origin[k]);
                put(k, high);
                put(3 + k, low);
            }
            factor.iter().enumerate().for_each(|(k, v)| put(6 + k, *v as f32));
            put(12, weight as f32);
        }
        GaussianChunk { columns: device.filled("gaussians", &columns, wgpu::BufferUsages::STORAGE), count: n as u32 }
    }
}

/// Gaussians that a kernel of this device sees at once.
fn most(device: &Device) -> usize {
    MOST.min((device.largest_binding() / (4 * COLUMNS as u64)) as usize)
}

/// The lower triangle L with L L^T the covariance: xx, yx, yy, zx, zy, zz. A variance that rounding left below zero
/// counts as 0.
pub(crate) fn factor(cov: &Sym3) -> [f64; 6] {
    let [xx, xy, xz, yy, yz, zz] = cov.0;
    // Where a variance is 0, its covariances are 0 as well, except for rounding.
    let over = |v: f64, by: f64| if by > 0.0 { v / by } else { 0.0 };
    let a = xx.max(0.0).sqrt();
    let (b, d) = (over(xy, a), over(xz, a));
    let c = (yy - b * b).max(0.0).sqrt();
    let e = over(yz - d * b, c);
    [a, b, c, d, e, (zz - d * d - e * e).max(0.0).sqrt()]
}
