//! Values of a field as colours: on a linear, a logarithmic or a signed scale.

use super::Rgb8;
use super::colormap::{Colormap, cool_to_warm};
use super::plane::Plane;
use crate::parallel;

crate::named_values! {
    /// Scales of values along the colours.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum ValueScale {
        Linear = "linear": "In equal steps",
        Logarithmic = "log": "In equal steps of the logarithm",
        Signed = "signed": "In equal steps, symmetric about zero, blue below and red above",
    }
}

/// The darkest that shading makes a colour.
const DARKEST: f32 = 0.06;

/// A positive field over a wider range gets a logarithmic scale.
const WIDE: f64 = 30.0;

/// Steps of the colours of a picture.
const STEPS: usize = 4096;

impl ValueScale {
    /// The scale that suits values whose sign matters or not.
    pub fn suited(plane: &Plane<f64>, signed: bool) -> ValueScale {
        let finite_values = || plane.data.iter().copied().filter(|v| v.is_finite());
        let [lo, hi] = [1.0, 99.0].map(|p| percentile(finite_values(), p));
        match (signed, lo, hi) {
            (true, ..) => ValueScale::Signed,
            (false, Some(lo), Some(hi)) if lo > 0.0 && hi > WIDE * lo && finite_values().all(|v| v > 0.0) => {
                ValueScale::Logarithmic
            }
            _ => ValueScale::Linear,
        }
    }

    /// From the 1st to the 99th percentile of the values, or as far as the 99th of their sizes on either side of zero.
    pub fn range(self, plane: &Plane<f64>) -> Option<[f64; 2]> {
        let finite_values = || plane.data.iter().copied().filter(|v| v.is_finite());
        let [lo, hi] = match self {
            ValueScale::Signed => {
                let far = percentile(finite_values().map(f64::abs), 99.0)?;
                [-far, far]
            }
            ValueScale::Linear => [percentile(finite_values(), 1.0)?, percentile(finite_values(), 99.0)?],
            ValueScale::Logarithmic => {
                let positive = || finite_values().filter(|v| *v > 0.0);
                [percentile(positive(), 1.0)?, percentile(positive(), 99.0)?]
            }
        };
        Some(match self {
            // A field of one value still gets a scale.
            _ if hi > lo => [lo, hi],
            ValueScale::Logarithmic => [lo / 1.5, hi * 1.5],
            _ => [lo - 0.5 * lo.abs().max(1e-300), hi + 0.5 * hi.abs().max(1e-300)],
        })
    }

    /// One range for several.
    pub fn common_range(self, ranges: impl IntoIterator<Item = Option<[f64; 2]>>) -> [f64; 2] {
        let all = ranges.into_iter().flatten().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        all.unwrap_or(if self == ValueScale::Signed { [-1.0, 1.0] } else { [1.0, 10.0] })
    }

    /// Whether it can show a range.
    pub fn shows(self, [lo, hi]: [f64; 2]) -> bool {
        lo.is_finite() && hi.is_finite() && lo < hi && (self != ValueScale::Logarithmic || lo > 0.0)
    }
}

fn percentile(values: impl Iterator<Item = f64>, percent: f64) -> Option<f64> {
    let mut all: Vec<f64> = values.collect();
    let at = (all.len().checked_sub(1)? as f64 * percent / 100.0).round() as usize;
    Some(*all.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Colours over a range of values.
#[derive(Clone, Copy, Debug)]
pub struct ValueColors {
    /// The scale.
    pub scale: ValueScale,
    /// Values of the first and the last colour.
    pub range: [f64; 2],
    /// The map; none for that of the scale: viridis, or blue over grey to red of a signed one.
    pub map: Option<Colormap>,
}

impl ValueColors {
    /// The colour of a share of the range.
    pub fn at(&self, share: f32) -> [u8; 3] {
        match (self.map, self.scale) {
            (Some(map), _) => map.color(share),
            (None, ValueScale::Signed) => cool_to_warm(2.0 * share - 1.0),
            (None, _) => Colormap::Viridis.color(share),
        }
    }

    /// The colour of a value that is a number; beyond the range, that of the nearer end.
    pub fn of(&self, value: f64) -> [u8; 3] {
        self.at(self.share(value) as f32)
    }

    /// The share of the range that lies below a value.
    fn share(&self, value: f64) -> f64 {
        let [lo, hi] = self.range;
        let share = match self.scale {
            ValueScale::Logarithmic => libm::log(value.max(f64::MIN_POSITIVE) / lo) / libm::log(hi / lo),
            _ => (value - lo) / (hi - lo),
        };
        share.clamp(0.0, 1.0)
    }

    /// A picture of values. Those that are not numbers have the background's colour, and colours come near it where there
    /// is little `shade`.
    pub fn image(&self, values: &Plane<f64>, shade: Option<&Plane>, white: bool) -> Rgb8 {
        let shades = shade.map(|s| (s, s.log_range().unwrap_or([1.0, 10.0])));
        let background = if white { [255; 3] } else { [0; 3] };
        let colors: Vec<[u8; 3]> = (0..=STEPS).map(|i| self.at(i as f32 / STEPS as f32)).collect();
        let data = parallel::map_range(values.data.len(), |i| {
            let value = values.data[i];
            if value.is_nan() {
                return background;
            }
            let color = colors[(self.share(value) * STEPS as f64 + 0.5) as usize];
            let Some((shade, [lo, hi])) = &shades else { return color };
            let bright = (libm::log(f64::from(shade.data[i]) / lo) / libm::log(hi / lo)) as f32;
            let bright = if bright.is_nan() { DARKEST } else { bright.clamp(DARKEST, 1.0) };
            [0, 1, 2].map(|k| {
                let (from, to) = (f32::from(background[k]), f32::from(color[k]));
                (from + (to - from) * bright).round() as u8
            })
        });
        Rgb8 { size: values.size, data }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Size;

    fn plane<T>(data: Vec<T>) -> Plane<T> {
        Plane { size: Size { width: data.len(), height: 1 }, data }
    }

    #[test]
    fn scales_suit_the_values() {
        let velocities = plane((0..1000).map(|i| f64::from(i) - 300.0).collect());
        let [lo, hi] = ValueScale::suited(&velocities, true).range(&velocities).unwrap();
        assert!(lo == -hi && (680.0..700.0).contains(&hi), "{lo} {hi}");
        let temperatures = plane((0..1000).map(|i| 10f64.powf(4.0 + f64::from(i) / 250.0)).chain([f64::NAN]).collect());
        assert_eq!(ValueScale::suited(&temperatures, false), ValueScale::Logarithmic);
        let even = plane((0..1000).map(|i| 100.0 + f64::from(i) / 10.0).collect());
        assert_eq!(ValueScale::suited(&even, false), ValueScale::Linear);
        let one = plane(vec![5.0; 10]);
        assert!(ValueScale::Linear.range(&one).is_some_and(|[lo, hi]| lo < 5.0 && 5.0 < hi));
        assert_eq!(ValueScale::Linear.range(&plane(vec![f64::NAN; 3])), None);
    }

    #[test]
    fn places_without_mass_have_the_colour_of_the_background() {
        let colors = ValueColors { scale: ValueScale::Signed, range: [-2.0, 2.0], map: None };
        let pixels = |shade| colors.image(&plane(vec![f64::NAN, -2.0, 0.0, 2.0]), shade, true).data;
        let [empty, blue, middle, red] = pixels(None)[..] else { panic!("four pixels") };
        assert!(
            empty == [255; 3] && blue[2] > 180 && blue[0] < 80 && middle == [221; 3] && red[0] > 170 && red[2] < 50
        );
        let shaded = pixels(Some(&plane(vec![1.0, 1e-9, 1.0, 10.0])));
        assert!(shaded[1][0] > 230, "{:?}", shaded[1]);
    }
}
