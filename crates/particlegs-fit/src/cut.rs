//! The cut of a cell in two: across its principal axis, at the place that helps pictures most.
//!
//! A profile of the cell along the axis (count, place and spread of the particles in 32 slices)
//! gives every possible cut's two halves; the cut is the one whose halves, blurred, differ most
//! from the whole in a picture that shows the axis and a direction across it. On nbody128 that is
//! worth 0.4 dB over the best 2-means cut (Otsu): it frees small dense clumps from what surrounds them.

use super::Moments;
use super::eigen::largest_eigenvalue;
use super::gain::Blur;
use particlegs_core::context::Level;
use particlegs_core::math::{Sym3, each_axis, exp};

/// Slices along the axis; they span the mean +- [`SPAN`] standard deviations, the outermost take the rest.
const SLICES: usize = 32;
const SPAN: f64 = 2.8;
/// Particles projected at a time.
const BLOCK: usize = 64;
/// Particles after which sums in f32 are added to those in f64.
const FLUSH: usize = 2048;
/// Cells of more particles than twice this are profiled by about this many of them.
const SAMPLE: usize = 1 << 13;

/// Of a cell's particles every so manyth is looked at to choose its cut.
pub(super) fn stride(particles: usize) -> usize {
    if particles > 2 * SAMPLE { particles / SAMPLE } else { 1 }
}

/// Sums over a slice: particles, place t along the axis, t^2, distance^2 from the axis.
type SliceSums = [f64; 4];

/// A plane between two slices.
pub(super) struct Cut {
    axis: PrincipalAxis,
    /// Particles whose place is below go to the first half. Slices are one unit wide.
    below: f32,
}

/// The principal axis, scaled so that slices are one unit wide and start at 0.
#[derive(Clone, Copy)]
struct PrincipalAxis {
    direction: [f32; 3],
    reference: [f32; 3],
    offset: f32,
    /// Slices for a store unit.
    per_unit: f32,
}

impl PrincipalAxis {
    fn principal(moments: &Moments) -> Option<PrincipalAxis> {
        let (variance, direction) = principal_axis(&moments.cov);
        let per_unit = SLICES as f64 / (2.0 * SPAN * variance.sqrt());
        if variance <= 0.0 || !((per_unit * per_unit) as f32).is_finite() {
            return None;
        }
        let reference = moments.mean.map(|v| v as f32);
        let residue: f64 = (0..3).map(|k| (moments.mean[k] - f64::from(reference[k])) * direction[k]).sum();
        Some(PrincipalAxis {
            direction: direction.map(|v| (v * per_unit) as f32),
            reference,
            offset: (0.5 * SLICES as f64 - residue * per_unit) as f32,
            per_unit: per_unit as f32,
        })
    }

    #[inline(always)]
    fn place(&self, p: [f32; 3]) -> f32 {
        let [a, b, c] = self.direction;
        let r = self.reference;
        (a * (p[0] - r[0]) + b * (p[1] - r[1])) + (c * (p[2] - r[2]) + self.offset)
    }
}

impl Cut {
    /// The best cut of `xyz`, or `None` where its particles are all in one place.
    pub fn best(level: Level, xyz: &[[f32; 3]], moments: &Moments, blur: Blur) -> Option<Cut> {
        let axis = PrincipalAxis::principal(moments)?;
        let slices = fearless_simd::dispatch!(level, _simd => profile(&axis, xyz, stride(xyz.len())));
        let unit = f64::from(axis.per_unit);
        let two_s = 2.0 * blur.variance * unit * unit;
        let first = fearless_simd::dispatch!(level, _simd => best_slice(&slices, two_s))?;
        Some(Cut { axis, below: first as f32 })
    }

    /// Brings the first half to the front; returns its length.
    pub fn apply(&self, level: Level, xyz: &mut [[f32; 3]], weight: Option<&mut [f32]>) -> usize {
        let weight = weight.unwrap_or(&mut []);
        fearless_simd::dispatch!(level, _simd => self.apply_kernel(xyz, weight))
    }

    /// Blocks from either end give lists of the particles that are in the wrong half; pairs of them
    /// change places (block partition: Edelkamp and Weiss 2016). `weight` may be empty.
    #[inline(always)]
    fn apply_kernel(&self, xyz: &mut [[f32; 3]], weight: &mut [f32]) -> usize {
        let mut swap = |xyz: &mut [[f32; 3]], i: usize, j: usize| {
            xyz.swap(i, j);
            if !weight.is_empty() {
                weight.swap(i, j);
            }
        };
        let (mut left, mut right) = (0, xyz.len());
        let (mut low, mut high) = (MisplacedParticles::default(), MisplacedParticles::default());
        while right - left >= 2 * BLOCK {
            if low.is_empty() {
                low.fill(self, &xyz[left..left + BLOCK], false);
            }
            if high.is_empty() {
                high.fill(self, &xyz[right - BLOCK..right], true);
            }
            for _ in 0..low.len().min(high.len()) {
                swap(xyz, left + low.take(), right - BLOCK + high.take());
            }
            if low.is_empty() {
                left += BLOCK;
            }
            if high.is_empty() {
                right -= BLOCK;
            }
        }
        // Fewer than two blocks are left, among them those of a list that was not used up.
        let mut front = left;
        for i in left..right {
            let first = self.axis.place(xyz[i]) < self.below;
            swap(xyz, front, i);
            front += usize::from(first);
        }
        front
    }
}

/// Places in a block whose particles belong to the other half.
struct MisplacedParticles {
    place: [u8; BLOCK],
    next: usize,
    end: usize,
}

impl Default for MisplacedParticles {
    fn default() -> Self {
        MisplacedParticles { place: [0; BLOCK], next: 0, end: 0 }
    }
}

impl MisplacedParticles {
    fn is_empty(&self) -> bool {
        self.next == self.end
    }

    fn len(&self) -> usize {
        self.end - self.next
    }

    #[inline(always)]
    fn take(&mut self) -> usize {
        self.next += 1;
        usize::from(self.place[(self.next - 1) % BLOCK])
    }

    /// Lists the particles that belong to the first half (`first`) or to the second.
    #[inline(always)]
    fn fill(&mut self, cut: &Cut, block: &[[f32; 3]], first: bool) {
        let block: &[[f32; 3]; BLOCK] = block.try_into().expect("a block");
        let mut wrong = [0u8; BLOCK];
        for l in 0..BLOCK {
            wrong[l] = u8::from((cut.axis.place(block[l]) < cut.below) == first);
        }
        // Without a branch: each place is written, and only wrong ones move the end; `end % BLOCK` is `end`.
        let mut end = 0;
        for l in 0..BLOCK {
            self.place[end % BLOCK] = l as u8;
            end += usize::from(wrong[l]);
        }
        (self.next, self.end) = (0, end);
    }
}

/// Sums by slice of every `stride`-th particle.
#[inline(always)]
fn profile(axis: &PrincipalAxis, xyz: &[[f32; 3]], stride: usize) -> [SliceSums; SLICES] {
    let mut total = [[0f64; 4]; SLICES];
    let mut part = [[0f32; 4]; SLICES];
    let mut part_count = 0;
    let mut copy = [axis.reference; BLOCK];
    let sample_count = xyz.len().div_ceil(stride);
    for start in (0..sample_count).step_by(BLOCK) {
        let len = BLOCK.min(sample_count - start);
        if stride == 1 && len == BLOCK {
            let block = xyz[start..start + BLOCK].try_into().expect("a block");
            add_block(axis, block, BLOCK, &mut part);
        } else {
            for (l, p) in copy[..len].iter_mut().enumerate() {
                *p = xyz[(start + l) * stride];
            }
            add_block(axis, &copy, len, &mut part);
        }
        part_count += len;
        // Sums go to f64 before their rounding in f32 matters.
        if part_count >= FLUSH || start + len == sample_count {
            for (t, p) in total.iter_mut().flatten().zip(part.iter_mut().flatten()) {
                *t += f64::from(*p);
                *p = 0.0;
            }
            part_count = 0;
        }
    }
    total
}

/// Adds the first `len` particles of a block.
#[inline(always)]
fn add_block(axis: &PrincipalAxis, xyz: &[[f32; 3]; BLOCK], len: usize, part: &mut [[f32; 4]; SLICES]) {
    let mut slice = [0u8; BLOCK];
    let mut sums = [[0f32; 4]; BLOCK];
    let unit = axis.per_unit * axis.per_unit;
    for l in 0..BLOCK {
        let [x, y, z]: [f32; 3] = each_axis(|k| xyz[l][k] - axis.reference[k]);
        let t = axis.place(xyz[l]);
        let along = t - axis.offset;
        let across = (x * x + y * y + z * z) * unit - along * along;
        slice[l] = t.max(0.0).min(SLICES as f32 - 1.0) as i32 as u8;
        sums[l] = [1.0, along, along * along, across];
    }
    for l in 0..len {
        let to = &mut part[usize::from(slice[l]) % SLICES];
        for k in 0..4 {
            to[k] += sums[l][k];
        }
    }
}

/// The first slice of the best cut's second half; `None` where fewer than two slices are filled.
///
/// Each half is a Gaussian along the axis (mean m, variance v) and across it (variance u); with
/// the blur, <A,B> = n_A n_B N(m_A - m_B; v_A + v_B + 2 s^2) N(0; u_A + u_B + 2 s^2), constants left out.
#[inline(always)]
fn best_slice(slices: &[SliceSums; SLICES], two_s: f64) -> Option<usize> {
    let mut running = [[0f64; SLICES]; 4];
    let mut sum = [0f64; 4];
    for (b, slice) in slices.iter().enumerate() {
        for k in 0..4 {
            sum[k] += slice[k];
            running[k][b] = sum[k];
        }
    }
    // Rounding may leave a variance below 0; two axes across share the squared distance.
    let gaussian = |n: f64, t: f64, tt: f64, rr: f64| {
        let inv = 1.0 / n;
        let m = t * inv;
        (m, (tt * inv - m * m).max(0.0), 0.5 * rr.max(0.0) * inv)
    };
    let n = sum[0];
    let (m, v, u) = gaussian(n, sum[1], sum[2], sum[3]);
    let self_product = |n: f64, v: f64, u: f64| n * n / ((2.0 * v + two_s) * (2.0 * u + two_s)).sqrt();
    let whole = self_product(n, v, u);
    let mut gains = [0f64; SLICES];
    for b in 0..SLICES {
        // Counts are whole numbers; empty halves get a stand-in and are skipped below.
        let na = running[0][b].max(0.5);
        let nb = (n - running[0][b]).max(0.5);
        let (ma, va, ua) = gaussian(na, running[1][b], running[2][b], running[3][b]);
        let (mb, vb, ub) = gaussian(nb, sum[1] - running[1][b], sum[2] - running[2][b], sum[3] - running[3][b]);
        let cross = |n: f64, d: f64, v: f64, u: f64| {
            let v = v + two_s;
            n * exp(-0.5 * d * d / v) / (v * (u + two_s)).sqrt()
        };
        let ab = cross(na * nb, ma - mb, va + vb, ua + ub);
        let wa = cross(n * na, m - ma, v + va, u + ua);
        let wb = cross(n * nb, m - mb, v + vb, u + ub);
        gains[b] = whole + self_product(na, va, ua) + self_product(nb, vb, ub) + 2.0 * (ab - wa - wb);
    }
    let mut best: Option<(f64, usize)> = None;
    for b in 0..SLICES - 1 {
        // A cut behind an empty slice is that behind the slice before it.
        if slices[b][0] == 0.0 || running[0][b] >= n {
            continue;
        }
        if best.is_none_or(|(g, _)| gains[b] > g) {
            best = Some((gains[b], b + 1));
        }
    }
    best.map(|(_, b)| b)
}

/// Largest eigenvalue and its unit vector: in closed form where that is safe, else by Jacobi.
pub(super) fn principal_axis(cov: &Sym3) -> (f64, [f64; 3]) {
    closed_principal_axis(cov).unwrap_or_else(|| {
        let e = cov.eigen();
        (e.values[0], e.vectors[0])
    })
}

/// The trigonometric solution; the vector is the longest cross product of two rows of cov - l I.
fn closed_principal_axis(cov: &Sym3) -> Option<(f64, [f64; 3])> {
    let t = cov.trace();
    if t.is_nan() || t <= 1e-60 {
        return None;
    }
    // With a trace of 1 the bounds below are on shapes, whatever the unit.
    let c = cov.scale(1.0 / t);
    let q = 1.0 / 3.0;
    let [a, b, d, e, f, g] = c.0;
    let (largest, spread) = largest_eigenvalue(&c, q);
    // Of a sphere the cross products are rounding errors.
    if spread < 1e-6 {
        return None;
    }
    let rows = Sym3([a - largest, b, d, e - largest, f, g - largest]).rows();
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let square = |v: &[f64; 3]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    let mut best = cross(rows[0], rows[1]);
    for v in [cross(rows[0], rows[2]), cross(rows[1], rows[2])] {
        if square(&v) > square(&best) {
            best = v;
        }
    }
    let n = square(&best).sqrt();
    (n > 1e-6).then(|| (largest * t, best.map(|v| v / n)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn closed_axis_is_the_axis(m in proptest::array::uniform6(-1.0f64..1.0), unit in -20i32..20) {
            let u = Sym3::outer([m[0], m[1], m[2]]).add(&Sym3::outer([m[3], m[4], m[5]]).scale(0.3));
            let cov = u.add(&Sym3::scaled_identity(0.01)).scale(10f64.powi(unit));
            let (value, v) = principal_axis(&cov);
            let e = cov.eigen();
            prop_assert!((value / e.values[0] - 1.0).abs() < 1e-9);
            prop_assert!((cov.quadratic(v) / e.values[0] - 1.0).abs() < 1e-8);
        }
    }

    #[test]
    fn a_clump_is_freed() {
        // 1000 particles spread evenly over [0, 1], 200 in a clump at 0.9.
        let mut xyz: Vec<[f32; 3]> = (0..1000).map(|i| [i as f32 * 1e-3, (i % 10) as f32 * 1e-3, 0.0]).collect();
        xyz.extend((0..200).map(|i| [0.9 + i as f32 * 1e-5, 0.005, 0.0]));
        let blur = Blur { variance: 1e-4 };
        let cut = Cut::best(Level::new(), &xyz, &Moments::from_points(&xyz, None), blur).unwrap();
        let first = cut.apply(Level::new(), &mut xyz, None);
        assert!(xyz[..first].iter().all(|p| p[0] < 0.9) && xyz[first..].iter().all(|p| p[0] > 0.7), "{first}");
    }
}
