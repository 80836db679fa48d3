//! Splats sorted into bands of rows, in particle order: each band is then one task's own.

use particlegs_particles::{Chunk, ChunkBuffer, Particles};

/// Splats of a run of particles by band: those of band b are `splats[start[b]..start[b + 1]]`.
#[derive(Default)]
pub(super) struct BandedSplats<T> {
    splats: Vec<T>,
    start: Vec<u32>,
}

impl<T> BandedSplats<T> {
    /// The splats of a band, in particle order.
    pub fn band(&self, band: usize) -> &[T] {
        &self.splats[self.start[band] as usize..self.start[band + 1] as usize]
    }
}

/// Collects splats with the bands they reach, then sorts them by band.
pub(super) struct BandSorter<T> {
    splats: Vec<T>,
    reach: Vec<[u32; 2]>,
}

impl<T> Default for BandSorter<T> {
    fn default() -> Self {
        BandSorter { splats: Vec::new(), reach: Vec::new() }
    }
}

impl<T: Copy + Default> BandSorter<T> {
    pub fn with_capacity(n: usize) -> Self {
        BandSorter { splats: Vec::with_capacity(n), reach: Vec::with_capacity(n) }
    }

    /// Adds a splat that reaches bands `first..end`.
    #[inline]
    pub fn push(&mut self, splat: T, first: usize, end: usize) {
        if first < end {
            self.splats.push(splat);
            self.reach.push([first as u32, end as u32]);
        }
    }

    /// The splats by band (one that reaches several stands in each); empties the sorter.
    pub fn sort(&mut self, bands: usize) -> BandedSplats<T> {
        // A counting sort keeps the order of particles within a band, on which blending and sums depend.
        let mut start = vec![0u32; bands + 1];
        for &[first, end] in &self.reach {
            for band in first..end {
                start[band as usize + 1] += 1;
            }
        }
        for band in 0..bands {
            start[band + 1] += start[band];
        }
        let mut splats = vec![T::default(); start[bands] as usize];
        let mut next = start.clone();
        for (splat, &[first, end]) in self.splats.iter().zip(&self.reach) {
            for band in first..end {
                let at = &mut next[band as usize];
                splats[*at as usize] = *splat;
                *at += 1;
            }
        }
        self.splats.clear();
        self.reach.clear();
        BandedSplats { splats, start }
    }
}

/// Visits runs of particles spread evenly over a snapshot, a quarter of a million or all; says how many they were.
pub(super) fn visit_sample(particles: &Particles, mut visit: impl FnMut(Chunk<'_>)) -> usize {
    const RUN: usize = 1024;
    let n = particles.len();
    let stride = (n / (RUN * 256)).max(1) * RUN;
    let mut buffer = ChunkBuffer::default();
    (0..n).step_by(stride).fold(0, |sampled, start| {
        let chunk = particles.chunk(start..n.min(start + RUN), &mut buffer);
        visit(chunk);
        sampled + chunk.len()
    })
}
