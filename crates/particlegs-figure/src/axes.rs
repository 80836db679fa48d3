//! Coordinates along the edges of an orthographic picture.

use super::panel::EdgeAxis;
use super::ticks::labelled;
use particlegs_core::camera::{Camera, Projection};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Hint, Result};

/// An axis of the picture is one of the world's where it leaves it by less than this.
const ALONG: f64 = 1e-6;
/// Coordinates of so many half windows are counted from a round number.
const FAR: f64 = 200.0;

/// The axes across and upwards: world coordinates where the picture looks along an axis, else distances from its
/// middle.
pub fn about(camera: &Camera, size: Size, unit: &str) -> Result<[EdgeAxis; 2]> {
    let Projection::Orthographic { height_world } = camera.projection else {
        let message =
            "axes on the edges need an orthographic view: in perspective, lengths have no fixed size in pixels";
        let hint = Hint::from("use ").option("projection", "orthographic").words(", or ");
        let hint = hint.option("axes", "cube").words(", which draws the axes of the box");
        return Err(Error::argument_with(message, hint));
    };
    let frame = camera.frame()?;
    let half = [0.5 * height_world * size.width as f64 / size.height as f64, 0.5 * height_world];
    let axis = |k: usize, from_middle: &str| {
        let along = frame.axes[k];
        let world_axis = (0..3).find(|a| (along[*a].abs() - 1.0).abs() < ALONG);
        match world_axis {
            Some(a) => {
                // Seen from behind, an axis of the world runs to the left or downwards: its ends change places.
                let (center, sign) = (camera.focal_point[a], along[a].signum());
                let from = offset(center, half[k]);
                let name = ["x", "y", "z"][a];
                let label = labelled(&counted(name, from, half[k]), unit);
                let middle = center - from;
                EdgeAxis { label, low: middle - sign * half[k], high: middle + sign * half[k] }
            }
            None => EdgeAxis { label: labelled(from_middle, unit), low: -half[k], high: half[k] },
        }
    };
    Ok([axis(0, "across"), axis(1, "upwards")])
}

/// The place that coordinates are counted from, if they are so large that ticks would have many digits in common; else
/// 0.
fn offset(center: f64, half: f64) -> f64 {
    let step = step(half);
    if center.abs() > FAR * half { (center / step).floor() * step } else { 0.0 }
}

/// A power of ten no smaller than the window.
fn step(half: f64) -> f64 {
    10f64.powi((2.0 * half).log10().ceil() as i32)
}

/// `x − 212000`.
fn counted(name: &str, from: f64, half: f64) -> String {
    // The origin is a whole number of steps: further decimals would be zeros.
    let digits = (-step(half).log10().round()).clamp(0.0, 300.0) as usize;
    let sign = if from > 0.0 { '\u{2212}' } else { '+' };
    if from == 0.0 { name.into() } else { format!("{name} {sign} {:.digits$}", from.abs()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::spherical_camera;

    #[test]
    fn axes_are_the_worlds_where_they_can_be() {
        let size = Size { width: 200, height: 100 };
        let seen = |azimuth: f64| {
            let mut camera = spherical_camera([10.0, 20.0, 30.0], azimuth, 0.0, 50.0);
            camera.projection = Projection::Orthographic { height_world: 6.0 };
            about(&camera, size, "Mpc").unwrap().map(|a| (a.label, a.low.round(), a.high.round()))
        };
        assert_eq!(seen(0.0), [("x (Mpc)".into(), 4.0, 16.0), ("y (Mpc)".into(), 17.0, 23.0)]);
        // From behind x runs to the left; from the side the edge is -z.
        assert_eq!(seen(180.0)[0], ("x (Mpc)".into(), 16.0, 4.0));
        assert_eq!(seen(90.0)[0], ("z (Mpc)".into(), 36.0, 24.0));
        assert_eq!(seen(30.0)[0], ("across (Mpc)".into(), -6.0, 6.0));
        assert!(about(&spherical_camera([0.0; 3], 0.0, 0.0, 1.0), size, "").is_err());
    }

    #[test]
    fn far_from_the_origin_ticks_differ() {
        let size = Size { width: 100, height: 100 };
        for (at, height, label, low) in [
            (212_345.0, 20.0, "x \u{2212} 212300 (kpc)", 35.0),
            (-98_765.4, 0.02, "x + 98765.4 (kpc)", -0.01),
            (1e12, 3.0, "x \u{2212} 1000000000000 (kpc)", -1.5),
            (500.0, 20.0, "x (kpc)", 490.0),
        ] {
            let mut camera = spherical_camera([at; 3], 0.0, 0.0, 50.0);
            camera.projection = Projection::Orthographic { height_world: height };
            let [x, _] = about(&camera, size, "kpc").unwrap();
            assert_eq!(x.label, label);
            assert!((x.low - low).abs() < 1e-4, "{} for {low}", x.low);
            let ticks = crate::ticks::even(x.low, x.high, 6.0).major;
            assert!(ticks.len() > 1 && ticks.windows(2).all(|t| t[0].1 != t[1].1), "{ticks:?}");
        }
    }
}
