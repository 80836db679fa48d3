//! Surface densities against each other, in decades (docs/law/scores.md).

use super::Plane;
use crate::context::Context;
use crate::memory::reserved;
use crate::parallel;
use crate::{Error, Result};

/// Densities below this share of the truth's median count as that share.
const FLOOR: f64 = 1e-3;

const STEP: usize = 1 << 16;

/// The scores of a surface density against the truth's, over the pixels where the truth is above zero. Densities
/// below a floor, a thousandth of the truth's median over these pixels, are raised to it on both sides, so that an
/// empty pixel has a logarithm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DensityScores {
    /// Pixels where the truth is above zero.
    pub pixels: u64,
    /// Those of them where the density scored is below the floor.
    pub empty: u64,
    /// Root mean square of log10(density / truth), decades; `None` without pixels.
    pub rms_dex: Option<f64>,
    /// Mean of log10(density / truth), decades.
    pub mean_dex: Option<f64>,
    /// Pearson's correlation of the two logarithms; `None` where one does not vary.
    pub correlation: Option<f64>,
}

impl DensityScores {
    /// Of two planes of one size.
    pub fn new(density: &Plane, truth: &Plane, context: &Context<'_>) -> Result<Self> {
        if density.size != truth.size {
            return Err(Error::argument("surface densities of different sizes cannot be compared"));
        }
        let Some(median) = median(&truth.data, context)? else {
            return Ok(DensityScores { pixels: 0, empty: 0, rms_dex: None, mean_dex: None, correlation: None });
        };
        let pairs = DensityPairs { density: &density.data, truth: &truth.data, floor: FLOOR * f64::from(median) };
        let [pixels, empty, x, y] = pairs.sums(|[x, y], empty| [1.0, f64::from(u8::from(empty)), x, y]);
        let [x, y] = [x / pixels, y / pixels];
        let [xx, xy, yy, square] = pairs.sums(|[a, b], _| [sq(a - x), (a - x) * (b - y), sq(b - y), sq(a - b)]);
        Ok(DensityScores {
            pixels: pixels as u64,
            empty: empty as u64,
            rms_dex: Some((square / pixels).sqrt()),
            mean_dex: Some(x - y),
            correlation: (xx > 0.0 && yy > 0.0).then(|| xy / (xx.sqrt() * yy.sqrt())),
        })
    }
}

fn sq(v: f64) -> f64 {
    v * v
}

/// The median of the values above zero: the upper one of two.
fn median(values: &[f32], context: &Context<'_>) -> Result<Option<f32>> {
    context.require_memory("scores", 4 * values.len() as u64)?;
    let mut above = reserved("scores", values.len(), context)?;
    above.extend(values.iter().copied().filter(|v| *v > 0.0));
    let middle = above.len() / 2;
    Ok((!above.is_empty()).then(|| *above.select_nth_unstable_by(middle, f32::total_cmp).1))
}

struct DensityPairs<'a> {
    density: &'a [f32],
    truth: &'a [f32],
    floor: f64,
}

impl DensityPairs<'_> {
    /// Sums of `terms_of` the logarithms of a pixel and whether it is empty; the same whatever the
    /// threads.
    fn sums(&self, terms_of: impl Fn([f64; 2], bool) -> [f64; 4] + Sync) -> [f64; 4] {
        let log = |v: f32| libm::log10(f64::from(v).max(self.floor));
        let run = |(density, truth): (&[f32], &[f32])| {
            let mut sums = [0.0; 4];
            for (d, t) in density.iter().zip(truth).filter(|(_, t)| **t > 0.0) {
                let terms = terms_of([log(*d), log(*t)], f64::from(*d) < self.floor);
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
            sums
        };
        let plus = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|k| a[k] + b[k]);
        parallel::map(self.density.chunks(STEP).zip(self.truth.chunks(STEP)), run).into_iter().fold([0.0; 4], plus)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Context;
    use crate::picture::Size;

    fn scores(density: &[f32], truth: &[f32]) -> DensityScores {
        let plane = |v: &[f32]| Plane { size: Size { width: v.len(), height: 1 }, data: v.to_vec() };
        DensityScores::new(&plane(density), &plane(truth), &Context::SILENT).unwrap()
    }

    #[test]
    fn logarithms_are_compared_where_the_truth_is_above_zero() {
        let truth = [1.0, 10.0, 100.0, 0.0];
        let s = scores(&[10.0, 100.0, 1000.0, 77.0], &truth);
        assert_eq!((s.pixels, s.empty), (3, 0));
        let near = |v: Option<f64>, to: f64| (v.unwrap() - to).abs() < 1e-7;
        assert!(near(s.rms_dex, 1.0) && near(s.mean_dex, 1.0) && near(s.correlation, 1.0), "{s:?}");
        let s = scores(&[100.0, 10.0, 1.0, 0.0], &truth);
        assert!(near(s.rms_dex, (8.0f64 / 3.0).sqrt()) && near(s.mean_dex, 0.0) && near(s.correlation, -1.0), "{s:?}");
    }

    #[test]
    fn holes_count_as_the_floor() {
        let s = scores(&[1.0, 1.0, 0.0], &[1.0, 1.0, 1.0]);
        assert_eq!((s.pixels, s.empty, s.correlation), (3, 1, None));
        assert!((s.rms_dex.unwrap() - 3.0f64.sqrt()).abs() < 1e-6 && (s.mean_dex.unwrap() + 1.0).abs() < 1e-6);
        // What the truth has less than the floor of counts as the floor too.
        assert_eq!(scores(&[1.0, 1.0, 0.0], &[1.0, 1.0, 1e-30]).rms_dex, Some(0.0));
        assert_eq!(scores(&[1.0], &[0.0]), DensityScores { rms_dex: None, ..scores(&[0.0], &[0.0]) });
        let plane = |width| Plane::zeros(Size { width, height: 1 });
        assert!(DensityScores::new(&plane(1), &plane(2), &Context::SILENT).is_err());
    }

    /// Sums over many runs.
    #[test]
    fn large_planes_have_the_scores_of_their_parts() {
        let n = 3 * STEP + 17;
        let truth: Vec<f32> = (0..n).map(|i| 1.0 + (i % 97) as f32).collect();
        let density: Vec<f32> = truth.iter().map(|v| v * 1.1).collect();
        let s = scores(&density, &truth);
        assert!((s.rms_dex.unwrap() - 1.1f64.log10()).abs() < 1e-7 && s.correlation.unwrap() > 1.0 - 1e-9, "{s:?}");
    }
}
