//! Lines in space as a camera sees them: the edges of a box with the names of its axes, and circles about places.

use particlegs_core::Result;
use particlegs_core::camera::{Camera, Frame, Projection};
use particlegs_core::math::each_axis;
use particlegs_core::picture::Size;
use particlegs_core::space::{Bounds, Cell};

/// Lines, and names with their places, in shares of the picture's width and height.
pub type CubeOutline = (Vec<[[f64; 2]; 2]>, Vec<([f64; 2], String)>);

/// Distance of an axis' name from its edge's middle, in shares of the picture's height.
const AWAY: f64 = 0.035;
/// Share of the distance to the focal point: nearer points are behind the camera.
const NEAR: f64 = 1e-3;
/// Sides of a circle.
const SIDES: usize = 48;
/// Radius of the smallest circle that is drawn, in pixels.
const SMALLEST: f64 = 2.0;

/// Places in the picture at which a camera sees points.
struct LineView {
    frame: Frame,
    near: f64,
    focal: f64,
    size: Size,
    projection: Projection,
}

impl LineView {
    fn new(camera: &Camera, size: Size) -> Result<Self> {
        let near = match camera.projection {
            Projection::Perspective { .. } => NEAR * camera.distance(),
            // Parallel lines of sight meet nowhere: what is behind the camera has a place, too.
            Projection::Orthographic { .. } => f64::NEG_INFINITY,
        };
        let (frame, focal, projection) = (camera.frame()?, camera.focal_pixels(size), camera.projection);
        Ok(LineView { frame, near, focal, size, projection })
    }

    /// Pixels of a length of 1 at a point about the camera.
    fn scale(&self, p: [f64; 3]) -> f64 {
        match self.projection {
            Projection::Perspective { .. } => self.focal / -p[2],
            Projection::Orthographic { .. } => self.focal,
        }
    }

    /// The part of a line about the camera that the picture shows, in shares of its width and height.
    fn line(&self, ends: [[f64; 3]; 2]) -> Option<[[f64; 2]; 2]> {
        let place = |p: [f64; 3]| {
            let scale = self.scale(p);
            [0.5 + scale * p[0] / self.size.width as f64, 0.5 - scale * p[1] / self.size.height as f64]
        };
        within(in_front(ends, self.near)?.map(place))
    }
}

/// Circles of some radii about places, across the line of sight, as lines in shares of the picture's width and height.
/// Those beyond the clipping range, and those that are too small to see, are left out.
pub fn circles(camera: &Camera, size: Size, all: &[([f64; 3], f64)]) -> Result<Vec<[[f64; 2]; 2]>> {
    let view = LineView::new(camera, size)?;
    let corner = |i: usize| (i as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
    let mut lines = Vec::new();
    for (place, radius) in all {
        let center = view.frame.to_camera(*place);
        let [near, far] = camera.clipping_range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let seen = -center[2] > view.near && (near..=far).contains(&-center[2]);
        if !seen || radius * view.scale(center) < SMALLEST {
            continue;
        }
        let at = |i: usize| {
            let (sine, cosine) = corner(i);
            [center[0] + radius * cosine, center[1] + radius * sine, center[2]]
        };
        lines.extend((0..SIDES).filter_map(|i| view.line([at(i), at(i + 1)])));
    }
    Ok(lines)
}

/// The edges of a cell, or of bounds.
pub fn edges(camera: &Camera, size: Size, bounds: &Bounds, cell: Option<&Cell>) -> Result<CubeOutline> {
    let (corner, vectors) = match cell {
        Some(c) => (c.origin, c.vectors),
        None => {
            let e = bounds.extent();
            (bounds.min, [[e[0], 0.0, 0.0], [0.0, e[1], 0.0], [0.0, 0.0, e[2]]])
        }
    };
    let view = LineView::new(camera, size)?;
    let at = |n: [usize; 3]| {
        let world = each_axis(|k| corner[k] + (0..3).map(|a| n[a] as f64 * vectors[a][k]).sum::<f64>());
        view.frame.to_camera(world)
    };
    let (mut lines, mut sides) = (Vec::new(), [const { Vec::new() }; 3]);
    for axis in 0..3 {
        for others in 0..4 {
            let mut from = [0; 3];
            // Two bits are the ends along the other two axes: of four parallel edges each has one pair.
            (from[(axis + 1) % 3], from[(axis + 2) % 3]) = (others & 1, others >> 1);
            let mut to = from;
            to[axis] = 1;
            let Some(line) = view.line([at(from), at(to)]) else { continue };
            lines.push(line);
            sides[axis].push(line);
        }
    }
    Ok((lines, names(&sides, size)))
}

/// Each axis' name beside the outermost of its edges, away from the middle of all.
fn names(sides: &[Vec<[[f64; 2]; 2]>; 3], size: Size) -> Vec<([f64; 2], String)> {
    let middle = |l: &[[f64; 2]; 2]| [0.5 * (l[0][0] + l[1][0]), 0.5 * (l[0][1] + l[1][1])];
    let all: Vec<[f64; 2]> = sides.iter().flatten().map(middle).collect();
    let n = all.len().max(1) as f64;
    let center = [all.iter().map(|p| p[0]).sum::<f64>() / n, all.iter().map(|p| p[1]).sum::<f64>() / n];
    let shape = size.height as f64 / size.width as f64;
    let mut names = Vec::new();
    for (side, name) in sides.iter().zip(["x", "y", "z"]) {
        // Of an axis that is seen end on there is nothing to name.
        let long = |l: &&[[f64; 2]; 2]| ((l[0][0] - l[1][0]) / shape).hypot(l[0][1] - l[1][1]) > 0.05;
        // The edge farthest from the middle, of those as far the lowest, then the leftmost: names stand outside the
        // box.
        let out = |l: &[[f64; 2]; 2]| {
            let m = middle(l);
            let far = ((m[0] - center[0]) / shape).hypot(m[1] - center[1]);
            far + 0.2 * m[1] - 1e-3 * m[0]
        };
        let Some(line) = side.iter().filter(long).max_by(|a, b| out(a).total_cmp(&out(b))) else { continue };
        let m = middle(line);
        let d = [(m[0] - center[0]) / shape, m[1] - center[1]];
        let far = d[0].hypot(d[1]).max(1e-9);
        names.push(([m[0] + AWAY * d[0] / far * shape, m[1] + AWAY * d[1] / far], name.to_string()));
    }
    names
}

/// The part of a line in front of the camera, which looks along -z.
fn in_front([a, b]: [[f64; 3]; 2], near: f64) -> Option<[[f64; 3]; 2]> {
    let depth = [-a[2], -b[2]];
    if depth.iter().all(|d| *d >= near) {
        return Some([a, b]);
    }
    if depth.iter().all(|d| *d < near) {
        return None;
    }
    let t = (near - depth[0]) / (depth[1] - depth[0]);
    let cut = each_axis(|k| a[k] + t * (b[k] - a[k]));
    Some(if depth[0] < near { [cut, b] } else { [a, cut] })
}

/// The part of a line within the unit square (Liang and Barsky 1984).
fn within([a, b]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let d = [b[0] - a[0], b[1] - a[1]];
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for k in 0..2 {
        for (toward, room) in [(-d[k], a[k]), (d[k], 1.0 - a[k])] {
            // Parallel to this side, all of the line lies on one side of it.
            if toward == 0.0 {
                if room < 0.0 {
                    return None;
                }
                continue;
            }
            let t = room / toward;
            // The line comes in through this side, or goes out through it.
            if toward < 0.0 { from = from.max(t) } else { to = to.min(t) }
        }
    }
    let at = |t: f64| [a[0] + t * d[0], a[1] + t * d[1]];
    // `max` and `min` pass over NaN, so the ends are looked at once more.
    (from < to && at(from).iter().chain(&at(to)).all(|v| v.is_finite())).then(|| [at(from), at(to)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::spherical_camera;

    const SIZE: Size = Size { width: 160, height: 90 };

    #[test]
    fn circles_are_about_their_places_and_small_ones_are_left_out() {
        let camera = Camera {
            position: [0.0, 0.0, 10.0],
            focal_point: [0.0; 3],
            view_up: [0.0, 1.0, 0.0],
            projection: Projection::Orthographic { height_world: 4.0 },
            clipping_range: Some([9.0, 11.0]),
        };
        let size = Size { width: 200, height: 100 };
        let all = [([1.0, 0.0, 0.5], 0.5), ([0.0; 3], 0.05), ([0.0, 0.0, 5.0], 0.5), ([4.0, 0.0, 0.0], 0.5)];
        let lines = circles(&camera, size, &all).unwrap();
        // The first is whole, half of the last is in the picture.
        assert!((SIDES..2 * SIDES).contains(&lines.len()), "{}", lines.len());
        for [from, _] in &lines[..SIDES] {
            let (x, y) = ((from[0] - 0.5) * 8.0 - 1.0, (from[1] - 0.5) * 4.0);
            assert!((x.hypot(y) - 0.5).abs() < 1e-9);
        }
    }

    #[test]
    fn a_box_in_view_has_twelve_edges_within_the_picture() {
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        for distance in [40.0, 6.0, 1.0] {
            let camera = spherical_camera([5.0; 3], 30.0, 20.0, distance);
            let (lines, names) = edges(&camera, SIZE, &bounds, None).unwrap();
            assert!(lines.as_flattened().as_flattened().iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v)));
            if distance == 40.0 {
                assert_eq!((lines.len(), names.len()), (12, 3));
            }
        }
        let mut camera = spherical_camera([5.0; 3], 0.0, 0.0, 40.0);
        camera.projection = Projection::Orthographic { height_world: 20.0 };
        let (lines, names) = edges(&camera, SIZE, &bounds, None).unwrap();
        // Seen along z: its edges are points.
        let names: Vec<&str> = names.iter().map(|n| n.1.as_str()).collect();
        assert_eq!(names, ["x", "y"]);
        assert!(lines.iter().any(|l| (l[0][1] - 0.75).abs() < 1e-9 && (l[1][1] - 0.75).abs() < 1e-9));
    }

    #[test]
    fn lines_are_cut_at_the_edge() {
        assert_eq!(within([[-1.0, 0.5], [2.0, 0.5]]), Some([[0.0, 0.5], [1.0, 0.5]]));
        assert_eq!(within([[-1.0, 2.0], [2.0, 2.0]]), None);
        assert_eq!(within([[f64::NAN, 0.5], [2.0, 0.5]]), None);
    }
}
