//! Footprints in the order of depth, parted into what is listed and blended together: memory and the time of a dispatch
//! stay bounded, whatever is drawn.

use super::frame::SlabRecord;

/// Entries of a slab's lists, at most, where a single block has no more.
pub(super) const MOST_ENTRIES: u32 = 1 << 22;
/// Footprints of a block.
pub(super) const BLOCK: u32 = 64;

/// The slabs of a picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Slabs {
    /// At least one, where there is a picture.
    pub all: Vec<SlabRecord>,
    /// The first entry of each block among those of its slab.
    pub starts: Vec<u32>,
}

impl Slabs {
    /// Of the entries of each block, `most` together where no block alone has more.
    pub fn new(gaussians: u32, blocks: &[u32], most: u32) -> Slabs {
        let slab = |first: usize| SlabRecord { gaussians, first: first as u32, ..SlabRecord::default() };
        let mut all = vec![SlabRecord { is_first: 1, ..slab(0) }];
        let mut starts = Vec::with_capacity(blocks.len());
        let mut last = all[0];
        for (place, entries) in blocks.iter().enumerate() {
            if last.entries > 0 && *entries > 0 && u64::from(last.entries) + u64::from(*entries) > u64::from(most) {
                last = slab(place);
                all.push(last);
            }
            starts.push(last.entries);
            last.entries += entries;
            last.blocks += 1;
            if let Some(newest) = all.last_mut() {
                *newest = last;
            }
        }
        Slabs { all, starts }
    }

    /// Entries of the largest.
    pub fn largest(&self) -> u32 {
        self.all.iter().map(|s| s.entries).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_hold_each_block_once_and_no_more_than_they_may() {
        let blocks = [3, 0, 4, 4, 20, 0, 1];
        let slabs = Slabs::new(400, &blocks, 8);
        let summary: Vec<_> = slabs.all.iter().map(|s| (s.first, s.blocks, s.entries, s.is_first)).collect();
        assert_eq!(summary, [(0, 3, 7, 1), (3, 1, 4, 0), (4, 2, 20, 0), (6, 1, 1, 0)]);
        assert_eq!(slabs.starts, [0, 3, 3, 0, 0, 20, 0]);
        assert_eq!(slabs.largest(), 20);
        let none = Slabs::new(0, &[], 8);
        assert_eq!((none.all.len(), none.largest(), none.all[0].is_first), (1, 0, 1));
    }
}
