//! Places and texts of ticks: one number style for all axes and bars.

use super::font;
use particlegs_core::picture::superscript;

/// Ticks of an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TickMarks {
    /// Share of the axis, and label.
    pub major: Vec<(f64, String)>,
    /// Shares of the axis, without labels.
    pub minor: Vec<f64>,
}

impl TickMarks {
    /// Width of the longest label.
    pub fn widest(&self, em: f64) -> f64 {
        self.major.iter().map(|(_, label)| font::width(label, em)).fold(0.0, f64::max)
    }
}

/// The largest of 1, 2, 5 times a power of ten that is at most `value` (> 0).
pub fn round_below(value: f64) -> f64 {
    let power = 10f64.powi(value.log10().floor() as i32);
    // A value that is round but for its last bits counts as itself.
    [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|v| *v <= value * (1.0 + 1e-9)).unwrap_or(power)
}

/// Ticks of a logarithmic axis: decades, with 2 and 5 where there are few, with even steps where the range is narrow.
pub fn logarithmic(lo: f64, hi: f64) -> TickMarks {
    let share = |v: f64| ((v / lo).ln() / (hi / lo).ln()).clamp(0.0, 1.0);
    let inside = |v: &f64| *v >= lo * (1.0 - 1e-9) && *v <= hi * (1.0 + 1e-9);
    let decades = || (lo.log10().floor() as i32)..=(hi.log10().ceil() as i32);
    let wide = (hi / lo).log10();
    let at = |fronts: &[f64]| -> Vec<f64> {
        decades().flat_map(|d| fronts.iter().map(move |f| f * 10f64.powi(d))).filter(inside).collect()
    };
    let mut values = at(if wide > 1.5 { &[1.0] } else { &[1.0, 2.0, 5.0] });
    if values.len() < 2 {
        values = at(&[1.0, 2.0, 5.0]);
    }
    let mut minor = if wide < 8.0 { at(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]) } else { Vec::new() };
    if values.len() < 3 && wide < 1.5 {
        let step = round_below((hi - lo) / 3.0);
        let first = (lo / step).ceil();
        values = (0..16).map(|i| (first + f64::from(i)) * step).filter(inside).collect();
        minor.clear();
    }
    // Decades as powers wherever one of them would be long.
    let decade = |v: &f64| (v.log10() - v.log10().round()).abs() < 1e-9;
    let powers = values.iter().all(decade) && values.iter().any(|v| !(0.1..1000.0).contains(v));
    let label = |v: f64| if powers { format!("10{}", superscript(v.log10().round() as i32)) } else { number(v) };
    let major = values.iter().map(|v| (share(*v), label(*v))).collect();
    minor.retain(|m| values.iter().all(|v| (v / m - 1.0).abs() > 1e-6));
    TickMarks { major, minor: minor.into_iter().map(share).collect() }
}

/// Ticks of an even axis from `low` to `high`, which may fall: at most so many.
pub fn even(low: f64, high: f64, most: f64) -> TickMarks {
    let (from, to) = (low.min(high), low.max(high));
    let length = to - from;
    if !(length > 0.0 && length.is_finite()) {
        return TickMarks::default();
    }
    let power = 10f64.powi((length / most.max(1.0)).log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| length / s <= most.max(1.0));
    let step = step.unwrap_or(10.0 * power);
    let share = |v: f64| ((v - low) / (high - low)).clamp(0.0, 1.0);
    let all = |step: f64| {
        // A tick at the very end of the axis is not lost to rounding.
        let first = (from / step - 1e-9).ceil();
        let count = (((to - first * step) / step + 1e-9).floor() + 1.0).clamp(0.0, 200.0) as usize;
        (0..count).map(move |i| (first + i as f64) * step).collect::<Vec<_>>()
    };
    let shown = all(step);
    // As many digits as tell ticks apart.
    let digits = (from.abs().max(to.abs()) / step).log10().ceil().clamp(2.0, 14.0) as i32 + 2;
    // Multiples of a step may miss zero by rounding.
    let label = |v: f64| rounded(if v.abs() < 1e-9 * length { 0.0 } else { v }, digits);
    // A step of 2 is divided by four and others by five: all parts are round.
    let mut minor = all(step / if (step / power - 2.0).abs() < 0.1 { 4.0 } else { 5.0 });
    minor.retain(|m| shown.iter().all(|v| (v - m).abs() > 0.01 * step));
    TickMarks {
        major: shown.into_iter().map(|v| (share(v), label(v))).collect(),
        minor: minor.into_iter().map(share).collect(),
    }
}

/// A number as people write it in pictures: `0.02`, `300`, `10⁻⁷`, `2×10⁹`.
pub fn number(value: f64) -> String {
    rounded(value, 4)
}

/// A number with so many digits, two fewer before a power.
fn rounded(value: f64, digits: i32) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    let mut exponent = size.log10().floor() as i32;
    if (1e-2..1e5).contains(&size) {
        let digits = (digits - 1 - exponent).clamp(0, digits + 1) as usize;
        let text = format!("{value:.digits$}");
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        return text.replace('-', "\u{2212}");
    }
    let unit = 10f64.powi(digits - 2);
    let mut front = (value / 10f64.powi(exponent) * unit).round() / unit;
    // Rounding may make a digit more: 9.9996 is 10.
    if front.abs() >= 10.0 {
        front /= 10.0;
        exponent += 1;
    }
    let power = format!("10{}", superscript(exponent));
    match front {
        1.0 => power,
        -1.0 => format!("\u{2212}{power}"),
        _ => format!("{front}\u{d7}{power}").replace('-', "\u{2212}"),
    }
}

/// A label with its unit in brackets, or alone.
pub fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_string() } else { format!("{name} ({unit})") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        for (value, text) in [
            (0.02, "0.02"),
            (300.0, "300"),
            (1e-7, "10⁻⁷"),
            (2e9, "2×10⁹"),
            (1.5, "1.5"),
            (-3.0, "−3"),
            (9.999e9, "10¹⁰"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn numbers_are_short() {
        let shown = [0.05, 1.0, 20.0, 12345.0, 0.0, -2.5, 1e-5, 1e7].map(number);
        assert_eq!(shown, ["0.05", "1", "20", "12345", "0", "−2.5", "10⁻⁵", "10⁷"]);
        assert_eq!([32.0, 32.05, 32.1].map(number), ["32", "32.05", "32.1"]);
        assert_eq!([1e5, 1.2e5].map(number), ["10⁵", "1.2×10⁵"]);
        let far: Vec<_> = even(1e9, 1e9 + 10.0, 6.0).major.into_iter().map(|t| t.1).collect();
        assert_eq!(far[..2], ["10⁹", "1.000000002×10⁹"]);
    }

    #[test]
    fn there_are_always_ticks() {
        for (lo, hi) in [(1.0, 1e4), (3.1, 4.2), (7e-12, 9e-12), (2e3, 9e3), (1e-20, 1e20), (2.5, 70.0), (3.0, 60.0)] {
            let ticks = logarithmic(lo, hi);
            assert!(ticks.major.len() >= 2, "{lo} {hi}: {ticks:?}");
            assert!(ticks.major.iter().map(|t| t.0).chain(ticks.minor).all(|s| (0.0..=1.0).contains(&s)));
        }
    }

    #[test]
    fn decades_have_one_style() {
        let labels = |lo, hi| logarithmic(lo, hi).major.into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(labels(5.0, 2e4), ["10¹", "10²", "10³", "10⁴"]);
        assert_eq!(labels(0.5, 200.0), ["1", "10", "100"]);
        assert_eq!(labels(1.0, 10.0), ["1", "2", "5", "10"]);
    }

    #[test]
    fn even_ticks_are_round_and_few() {
        let labels = |low, high| even(low, high, 6.0).major.into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 25.0), ["0", "5", "10", "15", "20", "25"]);
        assert_eq!(labels(-1.0, 1.0), ["−1", "−0.5", "0", "0.5", "1"]);
        assert_eq!(labels(7.0, 3.0), ["3", "4", "5", "6", "7"]);
        let falling = even(7.0, 3.0, 6.0).major;
        assert!(falling[0].0 == 1.0 && falling[4].0 == 0.0);
        for (low, high) in [(1e-30, 3e-30), (1e9, 1e9 + 10.0), (-4e12, 8e12), (0.123, 0.124)] {
            let n = even(low, high, 6.0).major.len();
            assert!((2..=7).contains(&n), "{low} {high}: {n}");
        }
        assert!(even(1.0, 1.0, 5.0).major.is_empty() && even(f64::NAN, 1.0, 5.0).major.is_empty());
    }
}
