//! The cubic spline kernel (Monaghan and Lattanzio 1985), projected along a line of sight and shared among
//! pixels. Lengths are in its support radius.

use particlegs_particles::cubic_spline;

/// Intervals of the table of the projected kernel, even in the square of the distance.
const STEPS: usize = 2048;
/// Intervals of the sum along the line of sight.
const ALONG: usize = 128;

/// Discs below this radius (pixels) reach two pixels along an axis at most.
const SMALL: f32 = 0.5;
/// Samples along the radius of all others, at least: pixels, or parts of pixels where those are larger.
const SAMPLES: f32 = 6.0;
/// Radius of the largest disc, pixels; larger ones go to coarser planes.
pub(super) const LARGEST: f32 = 2.0 * SAMPLES;
/// Samples across a disc, at most.
const ACROSS: usize = 2 * LARGEST as usize + 2;

/// The surface density at the square of a distance from the line through the centre (Simpson's rule).
pub(super) fn projected(square: f64) -> f64 {
    let half = (1.0 - square).max(0.0).sqrt();
    let at = |k: usize| cubic_spline((square + (half * k as f64 / ALONG as f64).powi(2)).sqrt());
    let inner: f64 = (1..ALONG).map(|k| if k % 2 == 1 { 4.0 * at(k) } else { 2.0 * at(k) }).sum();
    2.0 * half / (3.0 * ALONG as f64) * (at(0) + inner + at(ALONG))
}

/// The share of the mass below a plane at `t` from the centre.
fn share_below(t: f32) -> f32 {
    let far = t.abs().min(1.0);
    // Integrals of the spline's two pieces over the cap beyond the plane.
    let beyond = if far < 0.5 {
        let square = far * far;
        0.5 - far * (1.4 - square * (8.0 / 3.0 - square * (4.8 - 3.2 * far)))
    } else {
        let s = 1.0 - far;
        s.powi(5) * (1.6 - 16.0 / 15.0 * s)
    };
    if t < 0.0 { beyond } else { 1.0 - beyond }
}

/// A particle's disc in the pixels of a plane, rows upward.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Disc {
    pub x: f32,
    pub y: f32,
    /// At most [`LARGEST`].
    pub radius: f32,
    /// Surface density of a pixel that holds all of its mass.
    pub density: f32,
}

/// Rows of a plane while they are summed.
pub(super) struct RowSums<'a> {
    pub data: &'a mut [f64],
    pub width: usize,
    /// The pixel coordinates of `data[0]`'s lower left corner.
    pub corner: [i32; 2],
}

impl RowSums<'_> {
    /// The beginning of a pixel's row; `None` outside.
    #[inline(always)]
    fn row(&self, y: i32) -> Option<usize> {
        let row = usize::try_from(y - self.corner[1]).ok()? * self.width;
        (row < self.data.len()).then_some(row)
    }

    /// The place of a pixel in its row; `None` outside.
    #[inline(always)]
    fn column(&self, x: i32) -> Option<usize> {
        usize::try_from(x - self.corner[0]).ok().filter(|x| *x < self.width)
    }
}

/// The kernel as a table.
pub(super) struct KernelTable {
    /// Surface density at squares of distances, and twice zero.
    table: Vec<f32>,
}

impl KernelTable {
    pub fn new() -> Self {
        let inside = (0..STEPS).map(|k| projected(k as f64 / STEPS as f64) as f32);
        KernelTable { table: inside.chain([0.0; 2]).collect() }
    }

    /// Surface density at the square of a distance.
    #[inline(always)]
    fn at(&self, square: f32) -> f32 {
        let t = square.min(1.0) * STEPS as f32;
        let k = t as usize;
        let (a, b) = (self.table[k], self.table[k + 1]);
        a + (t - k as f32) * (b - a)
    }

    /// Adds a disc to some rows. The shares of all pixels that it reaches, within these rows or not, sum to 1.
    pub fn add(&self, disc: &Disc, sums: &mut RowSums<'_>) {
        if disc.radius < SMALL { add_small(disc, sums) } else { self.add_sampled(disc, sums) }
    }

    /// Samples each pixel at its centre, or at those of its parts.
    fn add_sampled(&self, disc: &Disc, sums: &mut RowSums<'_>) {
        let parts = (SAMPLES / disc.radius).ceil().max(1.0);
        let [x, y, radius] = [disc.x, disc.y, disc.radius].map(|v| v * parts);
        let first = [x, y].map(|v| (v - radius).floor());
        let scale = (radius * radius).recip();
        // Squares of the distances of columns and of rows.
        let squares = |first: f32, center: f32| -> [f32; ACROSS] {
            std::array::from_fn(|k| {
                let away = first + k as f32 + 0.5 - center;
                away * away * scale
            })
        };
        let (across, up) = (squares(first[0], x), squares(first[1], y));
        let count = ((2.0 * radius) as usize + 2).min(ACROSS);
        let mut shares = [[0.0f32; ACROSS]; ACROSS];
        let mut whole = 0.0f64;
        for (row, up) in shares[..count].iter_mut().zip(up) {
            let mut sum = 0.0;
            for (share, across) in row[..count].iter_mut().zip(&across) {
                *share = self.at(across + up);
                sum += *share;
            }
            whole += f64::from(sum);
        }
        // Over the sum of the samples, so that their coarseness costs no mass.
        let density = f64::from(disc.density) / whole;
        let pixel = |first: f32, k: usize| (first as i32 + k as i32).div_euclid(parts as i32);
        let columns: [Option<usize>; ACROSS] = std::array::from_fn(|k| sums.column(pixel(first[0], k)));
        for (j, shares) in shares[..count].iter().enumerate() {
            let Some(row) = sums.row(pixel(first[1], j)) else { continue };
            for (share, column) in shares[..count].iter().zip(&columns) {
                if let Some(column) = column {
                    sums.data[row + column] += density * f64::from(*share);
                }
            }
        }
    }
}

/// Two by two pixels, as if the shares along the axes were independent: exact where one edge cuts the disc.
fn add_small(disc: &Disc, sums: &mut RowSums<'_>) {
    let split = |center: f32| {
        let pixel = (center - disc.radius).floor();
        let edge = pixel + 1.0 - center;
        let below = if edge < disc.radius { share_below(edge / disc.radius) } else { 1.0 };
        (pixel as i32, [below, 1.0 - below])
    };
    let ((column, across), (row, up)) = (split(disc.x), split(disc.y));
    for (j, up) in up.into_iter().enumerate().filter(|(_, up)| *up > 0.0) {
        let Some(row) = sums.row(row + j as i32) else { continue };
        for (i, across) in across.into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
            if let Some(column) = sums.column(column + i as i32) {
                sums.data[row + column] += f64::from(disc.density * up * across);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// All mass of the kernel, of its projection and of its projection onto a line.
    #[test]
    fn the_kernel_is_normalised() {
        let n = 20_000;
        let at = |k: usize| (k as f64 + 0.5) / n as f64;
        let sphere: f64 = (0..n).map(|k| 4.0 * PI * at(k) * at(k) * cubic_spline(at(k))).sum::<f64>() / n as f64;
        assert!((sphere - 1.0).abs() < 1e-6, "{sphere}");
        // d(area) = pi d(b^2).
        let disc: f64 = (0..n).map(|k| PI * projected(at(k))).sum::<f64>() / n as f64;
        assert!((disc - 1.0).abs() < 1e-6, "{disc}");
        let kernel = KernelTable::new();
        let table: f64 = (0..n).map(|k| PI * f64::from(kernel.at(at(k) as f32))).sum::<f64>() / n as f64;
        assert!((table - 1.0).abs() < 1e-5, "{table}");
        assert_eq!([share_below(-1.0), share_below(0.0), share_below(1.0), share_below(7.0)], [0.0, 0.5, 1.0, 1.0]);
        for t in [0.1, 0.3, 0.499, 0.501, 0.8] {
            // The mass below a plane: a sum over slabs of the projection's chords.
            let slab = |x: f64| -> f64 {
                let half = (1.0 - x * x).sqrt();
                let along = |k: usize| half * ((k as f64 + 0.5) / 500.0 * 2.0 - 1.0);
                (0..500).map(|k| projected(x * x + along(k).powi(2))).sum::<f64>() * half / 250.0
            };
            let below: f64 = (0..500).map(|k| slab(t * (k as f64 + 0.5) / 500.0)).sum::<f64>() * t / 500.0;
            assert!((f64::from(share_below(t as f32)) - 0.5 - below).abs() < 1e-5, "{t}");
            assert!((share_below(t as f32) + share_below(-t as f32) - 1.0).abs() < 1e-6);
        }
    }

    /// Whatever the disc's size and place, the shares sum to 1, and their mean place is the disc's.
    #[test]
    fn discs_keep_their_mass_and_place() {
        let kernel = KernelTable::new();
        for k in 0..400 {
            let radius = 0.01 * 1.0185f32.powi(k);
            if radius > LARGEST {
                break;
            }
            let disc = Disc { x: 20.0 + 0.0173 * k as f32, y: 21.0 - 0.0311 * k as f32, radius, density: 1.0 };
            let mut data = vec![0.0; 48 * 48];
            kernel.add(&disc, &mut RowSums { data: &mut data, width: 48, corner: [0, -4] });
            let sum = |term: &dyn Fn(usize) -> f64| data.iter().enumerate().map(|(i, v)| v * term(i)).sum::<f64>();
            assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-6, "{disc:?}");
            let place = [sum(&|i| (i % 48) as f64 + 0.5), sum(&|i| (i / 48) as f64 - 3.5)];
            let off = [place[0] - f64::from(disc.x), place[1] - f64::from(disc.y)];
            // Within one pixel the place is lost.
            let allowed = if radius < 1.0 { 0.5 } else { 0.06 };
            assert!(off.iter().all(|v| v.abs() < allowed), "{disc:?}: {off:?}");
        }
    }

    /// Rows that hold a part of a disc get what whole planes have there.
    #[test]
    fn parts_of_a_disc_are_those_of_the_whole() {
        let kernel = KernelTable::new();
        for radius in [0.3, 0.9, 5.0, 11.0] {
            let disc = Disc { x: 15.9, y: 16.1, radius, density: 3.0 };
            let (mut whole, mut part) = (vec![0.0; 32 * 32], vec![0.0; 20 * 16]);
            kernel.add(&disc, &mut RowSums { data: &mut whole, width: 32, corner: [0, 0] });
            kernel.add(&disc, &mut RowSums { data: &mut part, width: 20, corner: [10, 16] });
            for (i, value) in part.iter().enumerate() {
                assert_eq!(*value, whole[(16 + i / 20) * 32 + 10 + i % 20], "{radius} {i}");
            }
        }
    }
}
