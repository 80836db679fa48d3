//! What the peels left, blended in the order of the particles.

use super::slices::Slice;
use super::{Limits, Shot};
use crate::groups;
use crate::reference::Points;
use crate::reference::source::Source;
use crate::reference::view::ViewRecord;
use particlegs_core::Result;
use std::ops::Range;

impl Shot<'_> {
    /// Blends the rest, band of rows by band.
    pub(super) fn rest(&self, source: &dyn Source, work: &[Vec<u32>]) -> Result<()> {
        let [width, height] = self.record.size;
        let rows = band_of(width, &self.paraview.limits);
        for first in (0..height).step_by(rows as usize) {
            let band = ViewRecord { first, last: height.min(first.saturating_add(rows)), ..self.record };
            self.each_batch(source, work, &mut |points, batch| self.rest_of_batch(points, batch, band))?;
        }
        Ok(())
    }

    /// The fragments of a batch of slices, as many at a time as there is room for.
    fn rest_of_batch(&self, points: &Points, batch: &[Slice], band: ViewRecord) -> Result<()> {
        let (canvas, device, kernels) = (self.canvas, self.device(), &self.paraview.kernels);
        let record = ViewRecord { count: points.count, ..band };
        let buffers = [&canvas.view, &points.positions, &canvas.slices, &canvas.ranges, &canvas.counts];
        let bound = kernels.rest_count.bind(device, &buffers);
        self.run_slices(&kernels.rest_count, &bound, record, batch);
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&device.read(&canvas.counts, 4 * batch.len() as u64)?);
        let buffers =
            [&canvas.view, &points.positions, &canvas.slices, &canvas.ranges, &canvas.offsets, &canvas.keys.keys];
        let bound = kernels.rest_keys.bind(device, &buffers);
        for run in runs(&counts, self.paraview.limits.keys) {
            let offsets = starts(&counts[run.clone()]);
            device.queue.write_buffer(&canvas.offsets, 0, bytemuck::cast_slice(&offsets));
            self.run_slices(&kernels.rest_keys, &bound, record, &batch[run.clone()]);
            self.blend(counts[run].iter().sum(), band);
        }
        Ok(())
    }

    /// Sorts keys and blends them.
    fn blend(&self, count: u32, band: ViewRecord) {
        let (canvas, device, kernels) = (self.canvas, self.device(), &self.paraview.kernels);
        canvas.keys.set(&device.queue, count);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernels.sorter.run(&mut pass, &canvas.keys, count);
        drop(pass);
        device.queue.submit([encoder.finish()]);
        let bound = kernels.rest.bind(device, &[&canvas.view, &canvas.keys.keys, &canvas.layers]);
        self.run(&kernels.rest, &bound, ViewRecord { count, ..band }, groups(u64::from(count)));
    }
}

/// Rows of a picture so wide that are sorted together. The last pixel's number is left to keys that are none.
pub(super) fn band_of(width: u32, limits: &Limits) -> u32 {
    ((limits.band - 1) / width).max(1)
}

/// Runs of slices that have at most so many fragments, without those that have none.
fn runs(counts: &[u32], most: u32) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let (mut start, mut held) = (0, 0);
    for (k, &own) in counts.iter().enumerate() {
        if held + own > most {
            runs.push(start..k);
            (start, held) = (k, 0);
        }
        held += own;
    }
    if held > 0 {
        runs.push(start..counts.len());
    }
    runs
}

/// What stands before each.
fn starts(counts: &[u32]) -> Vec<u32> {
    let before = |sum: &mut u32, own: &u32| Some(std::mem::replace(sum, *sum + own));
    counts.iter().scan(0, before).collect()
}
