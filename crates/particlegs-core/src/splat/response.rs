//! The level curve R(tau; a): the mean grey level of ParaView's picture where splats of opacity
//! `a` are scattered at random with optical depth tau (docs/law/response.md).
//!
//! The number of fragments on a pixel is Poisson, their alphas are `a g(u) g(v)` with (u, v)
//! uniform on the splat's square, and the 8-bit blending is a Markov chain on 256 levels. All laws
//! are exact: the area of the square where alpha exceeds a value is a circle cut by a square.
//!
//! [`ToneStyle`] lists the looks that a picture can have, of which this is one.

use super::{CUT_SIGMA, MEAN_COVERED_ALPHA, PEELS};

/// Levels of an 8-bit buffer.
const LEVELS: usize = 256;
/// The curve is tabulated at `2^e (1 + k/64)` for `2^FIRST_EXPONENT <= tau < 2^LAST_EXPONENT`.
const STEP_BITS: u32 = 6;
const FIRST_EXPONENT: i32 = -14;
const LAST_EXPONENT: i32 = 4;
/// Splats of at most this opacity change no 8-bit buffer: every one of their fragments is rounded
/// away, however many there are.
const INVISIBLE_OPACITY: f64 = 0.5 / 255.0;

/// ParaView's blending as a curve from optical depth to grey levels, for one opacity.
#[derive(Clone, Debug)]
pub struct Response {
    /// Mean level (0 to 255) at the table's depths, and at its end.
    levels: Vec<f32>,
}

impl Response {
    /// The curve of one opacity in (0, 1]: zero up to half a grey level. Takes some milliseconds.
    pub fn new(opacity: f64) -> Self {
        // What is not a number is invisible, too: the chain's length is bounded by this alone.
        if opacity.is_nan() || opacity <= INVISIBLE_OPACITY {
            return Response { levels: vec![0.0; table_length() + 1] };
        }
        let chain = BlendStep::new(opacity);
        let per_fragment = MEAN_COVERED_ALPHA * opacity;
        let by_count = chain.levels_by_count(table_tau(table_length()) / per_fragment);
        let levels =
            (0..=table_length()).map(|i| poisson_mean(&by_count, table_tau(i) / per_fragment) as f32).collect();
        Response { levels }
    }

    /// The curve times a factor that changes little between two depths of the table, such as [`super::FxaaMean::ratio`].
    pub fn scaled(&self, factor: impl Fn(f32) -> f32) -> Response {
        let scaled = self.levels.iter().enumerate().map(|(i, level)| level * factor(table_tau(i) as f32));
        Response { levels: scaled.collect() }
    }

    /// The table: levels at the depths `2^e (1 + k/64)`, e from -14 to 3, k from 0 to 63, and at 16.
    pub fn levels(&self) -> &[f32] {
        &self.levels
    }

    /// Mean level (0 to 255, not rounded) at optical depth `tau` >= 0.
    #[inline]
    pub fn level(&self, tau: f32) -> f32 {
        let first = f32::from_bits(((127 + FIRST_EXPONENT) as u32) << 23);
        if tau.is_nan() || tau <= first {
            // Nearly empty: the curve is a line through zero (and a depth of NaN is black).
            return if tau > 0.0 { tau / first * self.levels[0] } else { 0.0 };
        }
        // Exponent and leading mantissa bits are the index, the other bits the way to the next.
        let offset = tau.to_bits() - first.to_bits();
        let index = (offset >> (23 - STEP_BITS)) as usize;
        if index >= table_length() {
            return self.levels[table_length()];
        }
        let mask = (1u32 << (23 - STEP_BITS)) - 1;
        let t = (offset & mask) as f32 / (mask + 1) as f32;
        let (a, b) = (self.levels[index], self.levels[index + 1]);
        a + t * (b - a)
    }
}

fn table_length() -> usize {
    ((LAST_EXPONENT - FIRST_EXPONENT) as usize) << STEP_BITS
}

fn table_tau(i: usize) -> f64 {
    let per_octave = 1usize << STEP_BITS;
    let octave = libm::ldexp(1.0, FIRST_EXPONENT + (i / per_octave) as i32);
    octave * (1.0 + (i % per_octave) as f64 / per_octave as f64)
}

/// Share of the splat's square where a fragment's alpha is at least `alpha`.
fn share_above(alpha: f64, opacity: f64) -> f64 {
    if alpha >= opacity {
        return 0.0;
    }
    let (c, square) = (CUT_SIGMA, 4.0 * CUT_SIGMA * CUT_SIGMA);
    let rho2 = if alpha > 0.0 { -2.0 * libm::log(alpha / opacity) } else { f64::INFINITY };
    if rho2 >= 2.0 * c * c {
        return 1.0;
    }
    let circle = std::f64::consts::PI * rho2;
    if rho2 <= c * c {
        return circle / square;
    }
    let rho = rho2.sqrt();
    // The four segments of the circle beyond the sides of the square.
    let outside = 4.0 * (rho2 * libm::acos(c / rho) - c * (rho2 - c * c).sqrt());
    (circle - outside) / square
}

/// Mesa's product of two bytes.
#[inline]
pub fn mul8(a: u32, b: u32) -> u32 {
    let t = a * b;
    (t + (t >> 8) + 128) >> 8
}

/// One fragment's step of the back and of the front buffer.
struct BlendStep {
    /// Probability of a fragment's alpha in the back buffer, quantised before blending, and the level that each level
    /// becomes.
    back: Vec<(f64, [u8; LEVELS])>,
    /// Row f: probabilities of the front level after one more fragment (float alpha, one rounding).
    front: Vec<[f64; LEVELS]>,
}

impl BlendStep {
    fn new(opacity: f64) -> Self {
        let share = |low: f64, high: f64| share_above(low, opacity) - share_above(high, opacity);
        let back = (0..LEVELS as u32)
            .map(|q| (q, share((f64::from(q) - 0.5) / 255.0, (f64::from(q) + 0.5) / 255.0)))
            .filter(|&(_, p)| p > 0.0)
            .map(|(q, p)| (p, std::array::from_fn(|level| (q + mul8(level as u32, 255 - q)).min(255) as u8)))
            .collect();
        let mut front = vec![[0.0; LEVELS]; LEVELS];
        for (f, row) in front.iter_mut().enumerate() {
            // level = f + (255 - f) alpha, rounded.
            let room = (255 - f) as f64;
            if f == 255 {
                row[255] = 1.0;
                continue;
            }
            for (g, p) in row.iter_mut().enumerate().skip(f) {
                let up = (g - f) as f64;
                *p = share((up - 0.5) / room, (up + 0.5) / room);
            }
        }
        BlendStep { back, front }
    }

    fn back_step(&self, from: &[f64; LEVELS]) -> [f64; LEVELS] {
        let mut to = [0.0; LEVELS];
        for (level, &p) in from.iter().enumerate() {
            if p == 0.0 {
                continue;
            }
            for (share, next) in &self.back {
                to[usize::from(next[level])] += p * share;
            }
        }
        to
    }

    /// Mean level after exactly N fragments, N from 0 to enough for a Poisson mean of `most`.
    /// Ends earlier where another fragment changes nothing any more.
    fn levels_by_count(&self, most: f64) -> Vec<f64> {
        let n = (most + 8.0 * most.sqrt() + 30.0) as usize;
        let start = || {
            let mut d = [0.0; LEVELS];
            d[0] = 1.0;
            d
        };
        let mut fronts = vec![start()];
        for k in 0..PEELS {
            let mut next = [0.0; LEVELS];
            for f in 0..LEVELS {
                for (to, p) in next.iter_mut().zip(&self.front[f]) {
                    *to += fronts[k][f] * p;
                }
            }
            fronts.push(next);
        }
        // Of each front, for every back level: the mean of the composed level over the front's law.
        let composed_levels: Vec<[f64; LEVELS]> = fronts.iter().map(composed).collect();
        let mut back = start();
        let mut drawn = 0;
        let mut levels = Vec::with_capacity(n + 1);
        for count in 0..=n {
            // A peel takes a front and a back layer, and a lone fragment is a front one (docs/law/splat.md).
            let peeled = PEELS.min(count.div_ceil(2));
            while drawn < count - peeled {
                let next = self.back_step(&back);
                let moved: f64 = next.iter().zip(&back).map(|(a, b)| (a - b).abs()).sum();
                back = next;
                drawn += 1;
                if moved < 1e-12 && count > 2 * PEELS {
                    levels.push(dot(&composed_levels[peeled], &back));
                    return levels;
                }
            }
            levels.push(dot(&composed_levels[peeled], &back));
        }
        levels
    }
}

/// Mean over the front's law of the final level, for every back level.
fn composed(front: &[f64; LEVELS]) -> [f64; LEVELS] {
    std::array::from_fn(|b| {
        front
            .iter()
            .enumerate()
            .map(|(f, p)| p * (f as f64 + b as f64 * (1.0 - f as f64 / 255.0)).round_ties_even())
            .sum()
    })
}

fn dot(a: &[f64; LEVELS], b: &[f64; LEVELS]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Mean of `values[N]` (its last value beyond its end) over N ~ Poisson(mean).
fn poisson_mean(values: &[f64], mean: f64) -> f64 {
    let at = |n: usize| values[n.min(values.len() - 1)];
    let reach = 8.0 * mean.sqrt() + 20.0;
    let middle = mean.floor() as usize;
    // All likely counts lie beyond the table, where the level no longer changes.
    if middle as f64 - reach >= values.len() as f64 {
        return at(middle);
    }
    // Weights relative to the middle's, by recurrence both ways; their sum normalises.
    let (mut sum, mut total) = (at(middle), 1.0);
    let mut weight = 1.0;
    for n in middle + 1..=middle + reach as usize {
        weight *= mean / n as f64;
        sum += weight * at(n);
        total += weight;
    }
    weight = 1.0;
    for n in (middle.saturating_sub(reach as usize)..middle).rev() {
        weight *= (n + 1) as f64 / mean;
        sum += weight * at(n);
        total += weight;
    }
    sum / total
}

crate::named_values! {
    /// Grey levels of optical depth or of a snapshot; scores are given for all (docs/law/response.md, "Looks").
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ToneStyle {
        /// ParaView 6.0's default: four-layer dual depth peeling, 8-bit blending, FXAA.
        Paraview = "paraview",
        /// The same without FXAA.
        ParaviewNoFxaa = "paraview-no-fxaa",
        /// 255 (1 - exp(-tau)).
        Expected = "expected",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (opacity, [(tau, level)]) of the exact chain, computed apart in Python (docs/law/response.md, "R").
    const FIXTURES: &str = include_str!("response_fixture.txt");

    #[test]
    fn agrees_with_the_tables() {
        let mut pairs = 0;
        for line in FIXTURES.lines().filter(|l| !l.starts_with('#')) {
            let v: Vec<f64> = line.split_whitespace().map(|t| t.parse().unwrap()).collect();
            let response = Response::new(v[0]);
            for pair in v[1..].chunks_exact(2) {
                let level = f64::from(response.level(pair[0] as f32));
                assert!((level - pair[1]).abs() < 0.03, "a {} tau {}: {level} for {}", v[0], pair[0], pair[1]);
                pairs += 1;
            }
        }
        assert!(pairs > 100);
    }

    #[test]
    fn ends_are_sane() {
        for a in [f64::MIN_POSITIVE, 1e-12, 1e-6, 0.001, INVISIBLE_OPACITY, INVISIBLE_OPACITY * 1.001, 0.05, 1.0] {
            let r = Response::new(a);
            assert_eq!(r.level(0.0), 0.0);
            assert_eq!(r.level(f32::NAN), 0.0);
            assert!(r.level(1e-30) >= 0.0);
            assert_eq!(r.level(f32::INFINITY), r.level(100.0));
            assert!(r.level(100.0) <= 255.0);
        }
        assert!((Response::new(0.05).level(12.0) - 246.12).abs() < 0.02);
    }

    /// The closed form of faint splats is what their chain says.
    #[test]
    fn faint_splats_are_rounded_away() {
        for a in [0.001, INVISIBLE_OPACITY] {
            let chain = BlendStep::new(a);
            assert!(chain.levels_by_count(1000.0).iter().all(|level| *level == 0.0));
            assert!(chain.back.iter().all(|(_, next)| (0..=255).all(|level| next[usize::from(level)] == level)));
        }
        assert!(Response::new(INVISIBLE_OPACITY * 1.001).level(8.0) > 0.0);
    }
}
