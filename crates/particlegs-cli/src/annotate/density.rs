//! Surface density as people publish it: logarithmic colours, a colour bar and a scale bar.

use super::bar::{Bar, colour_bar, round_below, scale_bar};
use super::text;
use particlegs::parallel;
use particlegs::picture::{Colormap, Plane, Rgb8};

/// How to draw a plane of surface density.
pub struct DensityPicture {
    /// Colours.
    pub colormap: Colormap,
    /// Values of the first and last colour; `None` = [`log_range`] of the plane.
    pub range: Option<[f64; 2]>,
    /// Unit of the values, e.g. `Msun/h / (Mpc/h)²`.
    pub unit: String,
    /// The scale bar.
    pub scale_bar: ScaleBar,
    /// Draw the bars?
    pub annotations: bool,
}

/// What a length in the picture means.
pub struct ScaleBar {
    /// World units a pixel.
    pub world_per_pixel: f64,
    /// Unit of length; empty where it is not known.
    pub unit: String,
    /// Comoving lengths are labelled so.
    pub comoving: bool,
    /// Said after the length, e.g. `at the focal point` in perspective; or empty.
    pub note: String,
}

/// A range of four decades at most that shows nearly all lit pixels: up to the 99.9th percentile,
/// down to the 1st or a ten-thousandth of the top.
fn log_range(plane: &Plane) -> [f64; 2] {
    let mut lit: Vec<f32> = plane.data.iter().copied().filter(|v| *v > 0.0 && v.is_finite()).collect();
    if lit.is_empty() {
        return [1.0, 10.0];
    }
    let mut at = |share: f64| {
        let place = ((lit.len() - 1) as f64 * share) as usize;
        f64::from(*lit.select_nth_unstable_by(place, f32::total_cmp).1)
    };
    let hi = at(0.999);
    let lo = at(0.01).max(hi * 1e-4).min(hi);
    // A flat plane still gets a scale.
    if hi / lo < 1.5 { [lo / 1.5, hi * 1.5] } else { [lo, hi] }
}

/// Colours a plane of surface density by the logarithm; zero has the first colour. The picture has
/// the plane's size; bars lie on dark plates inside it and are left out where it is too small.
pub fn annotate_density(plane: &Plane, options: &DensityPicture) -> Rgb8 {
    let [lo, hi] = options.range.unwrap_or_else(|| log_range(plane));
    let (from, length) = (lo.ln() as f32, (hi / lo).ln() as f32);
    let color = |i: usize| {
        let v = plane.data[i];
        options.colormap.color(if v > 0.0 { (v.ln() - from) / length } else { 0.0 })
    };
    let data = parallel::map_range(plane.data.len(), color);
    let mut picture = Rgb8 { size: plane.size, data };
    if options.annotations {
        let title = format!("Σ [{}]", options.unit);
        let color = |t: f32| options.colormap.color(t);
        colour_bar(&mut picture, &Bar { title: &title, color: &color, ticks: log_ticks(lo, hi) });
        let bar = &options.scale_bar;
        let length = round_below(0.22 * plane.size.width as f64 * bar.world_per_pixel);
        let comoving = if bar.comoving { "comoving" } else { "" };
        let length_text = text::number(length);
        let parts = [length_text.as_str(), bar.unit.as_str(), comoving, bar.note.as_str()];
        let label = parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ");
        scale_bar(&mut picture, (length / bar.world_per_pixel).round() as i64, &label);
    }
    picture
}

/// Ticks of a logarithmic axis: decades, with 2 and 5 where there are few, with even steps where
/// the range is narrow.
fn log_ticks(lo: f64, hi: f64) -> Vec<(f64, String)> {
    let share = |v: f64| (v / lo).ln() / (hi / lo).ln();
    let inside = |v: &f64| *v >= lo * (1.0 - 1e-9) && *v <= hi * (1.0 + 1e-9);
    let decades = (lo.log10().floor() as i32)..=(hi.log10().ceil() as i32);
    let fronts: &[f64] = if (hi / lo).log10() > 2.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let mut values: Vec<f64> =
        decades.flat_map(|d| fronts.iter().map(move |f| f * 10f64.powi(d))).filter(inside).collect();
    if values.len() < 3 {
        let step = round_below((hi - lo) / 3.0);
        let first = (lo / step).ceil();
        values = (0..16).map(|i| (first + f64::from(i)) * step).filter(inside).collect();
    }
    values.into_iter().map(|v| (share(v).clamp(0.0, 1.0), text::number(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::picture::Size;

    fn options() -> DensityPicture {
        DensityPicture {
            colormap: Colormap::Grey,
            range: Some([1e6, 3e11]),
            unit: "10¹⁰ Msun/h / (Mpc/h)²".into(),
            scale_bar: ScaleBar {
                world_per_pixel: 0.02,
                unit: "Mpc/h".into(),
                comoving: true,
                note: "at the focal point".into(),
            },
            annotations: true,
        }
    }

    /// On a black plane all that is lit was drawn; none of it touches the edge.
    #[test]
    fn nothing_is_cut_off() {
        for (width, height) in [(480, 270), (270, 480), (512, 512), (1920, 1080), (3840, 2160)] {
            let picture = annotate_density(&Plane::zeros(Size { width, height }), &options());
            let mut lit = 0;
            for (i, p) in picture.data.iter().enumerate() {
                if p[0] > 0 {
                    let (x, y) = (i % width, i / width);
                    assert!(x > 1 && y > 1 && x + 2 < width && y + 2 < height, "{width}x{height}: {x} {y}");
                    lit += 1;
                }
            }
            assert!(lit > 500, "{width}x{height}: {lit}");
        }
    }

    #[test]
    fn there_are_always_ticks() {
        for (lo, hi) in [(1.0, 1e4), (3.1, 4.2), (7e-12, 9e-12), (2e3, 9e3), (1e-20, 1e20)] {
            assert!(log_ticks(lo, hi).len() >= 2, "{lo} {hi}: {:?}", log_ticks(lo, hi));
        }
    }

    #[test]
    fn the_range_ignores_specks() {
        let size = Size { width: 100, height: 100 };
        let mut plane = Plane { size, data: (0..10_000).map(|i| 1.0 + (i % 100) as f32).collect() };
        plane.data[5] = 1e30;
        plane.data[6] = 1e-30;
        let [lo, hi] = log_range(&plane);
        assert!(lo >= 1.0 && hi <= 101.0);
        assert_eq!(log_range(&Plane::zeros(size)), [1.0, 10.0]);
    }
}
