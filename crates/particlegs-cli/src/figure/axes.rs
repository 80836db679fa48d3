//! Coordinates along the edges of an orthographic picture.

use super::panel::Axis;
use crate::annotate::text::labelled;
use particlegs::camera::{Camera, Projection};
use particlegs::picture::Size;
use particlegs::{Error, Result};

/// An axis of the picture is one of the world's where it leaves it by less than this.
const ALONG: f64 = 1e-6;

/// The axes across and upwards: world coordinates where the picture looks along an axis, else distances from its
/// middle.
///
/// # Errors
/// [`Error::Argument`] for a perspective picture, which has no coordinates.
pub fn about(camera: &Camera, size: Size, unit: &str) -> Result<[Axis; 2]> {
    let Projection::Orthographic { height_world } = camera.projection else {
        let what = "--axes frame does nothing here: it belongs to --projection orthographic; in perspective a length \
                    changes with its depth";
        return Err(Error::Argument { what: what.into(), remedy: "--axes cube draws the box with its axes".into() });
    };
    let frame = camera.frame()?;
    let half = [0.5 * height_world * size.width as f64 / size.height as f64, 0.5 * height_world];
    let axis = |k: usize, from_middle: &str| {
        let along = frame.axes[k];
        let of = (0..3).find(|a| (along[*a].abs() - 1.0).abs() < ALONG);
        match of {
            Some(a) => {
                let (center, sign) = (camera.focal_point[a], along[a].signum());
                let label = labelled(["x", "y", "z"][a], unit);
                Axis { label, low: center - sign * half[k], high: center + sign * half[k] }
            }
            None => Axis { label: labelled(from_middle, unit), low: -half[k], high: half[k] },
        }
    };
    Ok([axis(0, "across"), axis(1, "upwards")])
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::camera::spherical_camera;

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
}
