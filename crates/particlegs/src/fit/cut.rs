//! Where a cell is cut in two: Otsu's threshold (the best 2-means cut) along its principal axis.

use super::Moments;

/// Bins along the axis; they span the mean +- [`SPAN`] standard deviations, the outermost take the rest.
const BINS: usize = 64;
const SPAN: f64 = 3.2;

/// A plane as a bin number along a direction: particles of bin `<= last` go to the first half.
pub(super) struct Cut {
    direction: [f32; 3],
    reference: [f32; 3],
    offset: f32,
    last: i32,
}

impl Cut {
    fn bin(&self, p: [f32; 3]) -> usize {
        let d: [f32; 3] = std::array::from_fn(|k| p[k] - self.reference[k]);
        let t = self.direction[0] * d[0] + self.direction[1] * d[1] + self.direction[2] * d[2] + self.offset;
        (t.max(0.0) as i32).min(BINS as i32 - 1) as usize
    }

    fn first_half(&self, p: [f32; 3]) -> bool {
        self.bin(p) as i32 <= self.last
    }

    /// The best cut of `xyz`, or `None` where its particles are all in one place.
    pub fn best(xyz: &[[f32; 3]], moments: &Moments) -> Option<Cut> {
        let eigen = moments.cov.eigen();
        let sigma = eigen.values[0].max(0.0).sqrt();
        if sigma == 0.0 {
            return None;
        }
        let per_unit = BINS as f64 / (2.0 * SPAN * sigma);
        let reference = moments.mean.map(|v| v as f32);
        let residue: f64 =
            (0..3).map(|k| (moments.mean[k] - f64::from(reference[k])) * eigen.vectors[0][k]).sum::<f64>();
        let direction = eigen.vectors[0].map(|v| (v * per_unit) as f32);
        if !direction.iter().all(|v| v.is_finite()) {
            return None;
        }
        let offset = (0.5 * BINS as f64 - residue * per_unit) as f32;
        let mut cut = Cut { direction, reference, offset, last: 0 };
        let mut histogram = [0u32; BINS];
        for &p in xyz {
            histogram[cut.bin(p)] += 1;
        }
        cut.last = otsu(&histogram)? as i32;
        Some(cut)
    }

    /// Brings the first half to the front; returns its length.
    pub fn apply(&self, xyz: &mut [[f32; 3]], mut weight: Option<&mut [f32]>) -> usize {
        let mut front = 0;
        for i in 0..xyz.len() {
            let first = self.first_half(xyz[i]);
            xyz.swap(front, i);
            if let Some(w) = &mut weight {
                w.swap(front, i);
            }
            front += usize::from(first);
        }
        front
    }
}

/// The last bin of the first class where the variance between the classes is largest; `None`
/// where fewer than two bins are filled.
fn otsu(histogram: &[u32; BINS]) -> Option<usize> {
    let total: f64 = histogram.iter().map(|&h| f64::from(h)).sum();
    let sum: f64 = histogram.iter().enumerate().map(|(b, &h)| b as f64 * f64::from(h)).sum();
    let (mut n, mut s) = (0.0, 0.0);
    let mut best = None;
    for (b, &h) in histogram.iter().enumerate() {
        n += f64::from(h);
        s += b as f64 * f64::from(h);
        if h == 0 || n == total {
            continue;
        }
        let difference = s / n - (sum - s) / (total - n);
        let between = n * (total - n) * difference * difference;
        if best.is_none_or(|(v, _)| between > v) {
            best = Some((between, b));
        }
    }
    best.map(|(_, b)| b)
}
