//! Pixels of splats, cut into slices that are equal work.

use super::DispatchLimits;

/// Particles whose pixels stand one behind the other: those of a workgroup.
pub(super) const GROUP: u32 = 64;
/// Pixels of a slice at most (slice.wgsl says so too).
pub(super) const SLICE: u32 = 4096;

/// The number of a group of particles in its piece, and the first of its pixels.
pub(super) type GroupSlice = [u32; 2];

/// The slices of a piece, in the order of its particles, as many at a time as a dispatch takes.
pub(super) struct Batches<'a> {
    /// Pixels of every group.
    counts: &'a [u32],
    next: GroupSlice,
    limits: &'a DispatchLimits,
}

impl<'a> Batches<'a> {
    pub fn new(counts: &'a [u32], limits: &'a DispatchLimits) -> Self {
        Batches { counts, next: [0, 0], limits }
    }
}

impl Iterator for Batches<'_> {
    type Item = Vec<GroupSlice>;

    fn next(&mut self) -> Option<Vec<GroupSlice>> {
        let mut batch = Vec::new();
        let mut pixels = 0;
        while let Some(&all) = self.counts.get(self.next[0] as usize) {
            if self.next[1] >= all {
                self.next = [self.next[0] + 1, 0];
                continue;
            }
            if batch.len() >= self.limits.slices || pixels >= self.limits.pixels {
                break;
            }
            batch.push(self.next);
            let slice_pixels = SLICE.min(all - self.next[1]);
            pixels += u64::from(slice_pixels);
            self.next[1] += slice_pixels;
        }
        (!batch.is_empty()).then_some(batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_in_one_slice() {
        let limits = DispatchLimits { slices: 3, pixels: 9000, keys: 0, band: 0, strip: 0 };
        let counts = [0, 1, 4096, 0, 4097, 20_000, 0];
        let batches: Vec<_> = Batches::new(&counts, &limits).collect();
        assert!(batches.iter().all(|b| (1..=3).contains(&b.len())), "{batches:?}");
        let mut next = [0; 7];
        for &[group, first] in batches.iter().flatten() {
            assert_eq!(next[group as usize], first);
            next[group as usize] = counts[group as usize].min(first + SLICE);
        }
        assert_eq!(next, counts);
    }
}
