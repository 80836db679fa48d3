//! How far away a camera stands, or how wide a window is, for a box to be in the picture whole.

use crate::view_args::ViewSubject;
use clap::ValueEnum;
use particlegs::camera::spherical_camera;
use particlegs::math::each_axis;
use particlegs::picture::Size;
use particlegs::{Error, Result};

/// What has to be in a picture whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Fit {
    /// The simulation box.
    Box,
    /// The bounds of the particles.
    Data,
}

/// Share of the picture that is filled at most.
const FILLED: f64 = 0.96;

/// The corners of what has to fit.
pub fn corners(fit: Fit, subject: &ViewSubject) -> Result<[[f64; 3]; 8]> {
    let bit = |c: usize, k: usize| (c >> k & 1) as f64;
    match (fit, subject.cell) {
        (Fit::Box, Some(cell)) => Ok(std::array::from_fn(|c| {
            each_axis(|k| cell.origin[k] + (0..3).map(|a| bit(c, a) * cell.vectors[a][k]).sum::<f64>())
        })),
        (Fit::Box, None) => {
            let what = "--fit box: no simulation box is known";
            Err(Error::argument_with(what, "fit the particles with --fit data"))
        }
        (Fit::Data, _) => {
            let b = subject.bounds;
            Ok(std::array::from_fn(|c| each_axis(|k| if bit(c, k) == 0.0 { b.min[k] } else { b.max[k] })))
        }
    }
}

/// The middle of corners.
pub fn center(corners: &[[f64; 3]; 8]) -> [f64; 3] {
    each_axis(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 8.0)
}

/// The corners seen along a direction: right, up, towards the eye, from the centre.
fn seen(corners: &[[f64; 3]; 8], center: [f64; 3], [azimuth, elevation]: [f64; 2]) -> Result<[[f64; 3]; 8]> {
    let mut frame = spherical_camera([0.0; 3], azimuth, elevation, 1.0).frame()?;
    frame.position = center;
    Ok(corners.map(|c| frame.to_camera(c)))
}

/// The distance from which all corners are in a picture with these slopes of its edges, along every direction.
pub fn distance(
    corners: &[[f64; 3]; 8],
    center: [f64; 3],
    directions: impl Iterator<Item = [f64; 2]>,
    slopes: [f64; 2],
) -> Result<f64> {
    let mut most = 0.0f64;
    for direction in directions {
        for [x, y, z] in seen(corners, center, direction)? {
            let from = z + (x.abs() / slopes[0]).max(y.abs() / slopes[1]) / FILLED;
            most = most.max(from);
        }
    }
    positive(most)
}

/// The width of an orthographic window that holds all corners, along every direction.
pub fn width(
    corners: &[[f64; 3]; 8],
    center: [f64; 3],
    directions: impl Iterator<Item = [f64; 2]>,
    size: Size,
) -> Result<f64> {
    let aspect = size.width as f64 / size.height as f64;
    let mut half = 0.0f64;
    for direction in directions {
        half = seen(corners, center, direction)?.iter().fold(half, |h, p| h.max(p[0].abs()).max(p[1].abs() * aspect));
    }
    // Rounding leaves nothing outside.
    positive(2.0 * half * (1.0 + 1e-9))
}

fn positive(length: f64) -> Result<f64> {
    let fault = || Error::argument("--fit: what has to fit has no extent; choose --width or --distance");
    if length > 0.0 && length.is_finite() { Ok(length) } else { Err(fault()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::camera::{Extent, FOV_DEG};
    use particlegs::space::{Bounds, Cell};

    fn subject(cell: Option<Cell>) -> ViewSubject {
        let bounds = Bounds { min: [1.0, 2.0, 3.0], max: [5.0, 4.0, 9.0] };
        let extent = Extent::new(&bounds, cell.as_ref());
        ViewSubject { bounds, cell, extent, radius: 0.1, opacity: 0.05, density: false }
    }

    #[test]
    fn what_is_fitted_is_inside_and_touches_an_edge() {
        let corners = corners(Fit::Data, &subject(None)).unwrap();
        let center = center(&corners);
        assert_eq!(center, [3.0, 3.0, 6.0]);
        let slope = (0.5 * FOV_DEG.to_radians()).tan();
        for direction in [[0.0, 0.0], [30.0, 20.0], [200.0, -70.0]] {
            let d = distance(&corners, center, [direction].into_iter(), [2.0 * slope, slope]).unwrap();
            let most = seen(&corners, center, direction)
                .unwrap()
                .iter()
                .fold(0.0f64, |m, [x, y, z]| m.max(x.abs() / (d - z) / (2.0 * slope)).max(y.abs() / (d - z) / slope));
            assert!((0.9..=FILLED + 1e-9).contains(&most), "{most}");
        }
        let seen_from_front = width(&corners, center, [[0.0, 0.0]].into_iter(), Size { width: 100, height: 100 });
        assert!((seen_from_front.unwrap() - 4.0).abs() < 1e-8);
    }

    #[test]
    fn a_box_that_is_not_known_is_refused() {
        assert!(corners(Fit::Box, &subject(None)).is_err());
        let of_box = corners(Fit::Box, &subject(Some(Cell::orthogonal([10.0; 3])))).unwrap();
        assert_eq!(center(&of_box), [5.0; 3]);
    }
}
