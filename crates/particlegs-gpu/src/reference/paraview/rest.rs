//! Fragments that the peels left, blended in the order of the particles.

use super::{DispatchLimits, GroupSlice, PictureRequest, Strip, StripWork};
use crate::groups;
use crate::reference::DeviceParticles;
use crate::reference::ViewRecord;
use crate::reference::source::ParticleSource;
use particlegs_core::Result;
use std::ops::Range;

impl PictureRequest<'_> {
    /// Blends the rest, band of a strip's rows by band.
    pub(super) fn rest(&self, source: &dyn ParticleSource, work: &[StripWork<'_>]) -> Result<()> {
        let height = band_of(self.record.size[0], &self.paraview.limits);
        for strip_work in work {
            let rows = strip_work.strip.rows.clone();
            // A key has 24 bits for the pixel, so the pixels of a large strip are drawn in several bands.
            for first in rows.clone().step_by(height as usize) {
                let last = rows.end.min(first.saturating_add(height));
                let band = ViewRecord { first, last, ..self.within(strip_work.strip) };
                self.each_batch(source, std::slice::from_ref(strip_work), &mut |points, strip, batch| {
                    self.rest_of_batch(points, strip, batch, band)
                })?;
            }
        }
        Ok(())
    }

    /// The fragments of a batch of slices, as many at a time as there is room for.
    fn rest_of_batch(
        &self,
        points: &DeviceParticles,
        strip: &Strip,
        batch: &[GroupSlice],
        band: ViewRecord,
    ) -> Result<()> {
        let (canvas, device, kernels) = (self.canvas, self.device(), &self.paraview.kernels);
        let record = ViewRecord { count: points.count, ..band };
        let buffers = [&canvas.view, &points.positions, &canvas.slices, &strip.ranges, &canvas.counts];
        let bound = kernels.rest_count.bind(device, &buffers);
        self.run_slices(&kernels.rest_count, &bound, record, batch);
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&device.read(&canvas.counts, 4 * batch.len() as u64)?);
        let buffers =
            [&canvas.view, &points.positions, &canvas.slices, &strip.ranges, &canvas.offsets, &canvas.keys.keys];
        let bound = kernels.rest_keys.bind(device, &buffers);
        for run in runs(&counts, self.paraview.limits.keys) {
            let offsets = starts(&counts[run.clone()]);
            device.queue.write_buffer(&canvas.offsets, 0, bytemuck::cast_slice(&offsets));
            self.run_slices(&kernels.rest_keys, &bound, record, &batch[run.clone()]);
            self.blend(strip, counts[run].iter().sum(), band);
        }
        Ok(())
    }

    /// Sorts keys and blends them.
    fn blend(&self, strip: &Strip, count: u32, band: ViewRecord) {
        let (canvas, device, kernels) = (self.canvas, self.device(), &self.paraview.kernels);
        canvas.keys.set(&device.queue, count);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernels.sorter.run(&mut pass, &canvas.keys, count);
        drop(pass);
        device.queue.submit([encoder.finish()]);
        let bound = kernels.rest.bind(device, &[&canvas.view, &canvas.keys.keys, &strip.layers]);
        self.run(&kernels.rest, &bound, ViewRecord { count, ..band }, groups(u64::from(count)));
    }
}

/// Rows of a picture so wide that are sorted together. The last pixel's number is left to keys that are none.
pub(super) fn band_of(width: u32, limits: &DispatchLimits) -> u32 {
    ((limits.band - 1) / width).max(1)
}

/// Runs of slices that have at most so many fragments, without those that have none.
fn runs(counts: &[u32], most: u32) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let (mut start, mut held) = (0, 0);
    for (k, &count) in counts.iter().enumerate() {
        if held + count > most {
            runs.push(start..k);
            (start, held) = (k, 0);
        }
        held += count;
    }
    if held > 0 {
        runs.push(start..counts.len());
    }
    runs
}

/// The sum of those before each.
fn starts(counts: &[u32]) -> Vec<u32> {
    let before = |sum: &mut u32, count: &u32| Some(std::mem::replace(sum, *sum + count));
    counts.iter().scan(0, before).collect()
}
