//! The extent that an orthographic map shows whole: the periodic cell, or the bounds of what does not repeat; and
//! windows that hold points.

use super::view::Frame;
use crate::math::{dot, each_axis, norm};
use crate::picture::Size;
use crate::space::{Bounds, Cell, PeriodicCell};

/// Windows are so much larger than what they hold that rounding leaves nothing outside.
pub(super) const ROOM: f64 = 1e-9;

/// A parallelepiped that holds all there is, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Its middle.
    pub center: [f64; 3],
    /// Its edges.
    pub edges: [[f64; 3]; 3],
    /// The length of tails that reach out of each edge, over the edge.
    pub tails: [f64; 3],
    /// Whether it repeats along each edge.
    pub periodic: [bool; 3],
}

impl Extent {
    /// Of particles with these bounds, in this cell.
    pub fn new(bounds: &Bounds, cell: Option<&Cell>) -> Extent {
        let cell = cell.filter(|c| c.periodic.contains(&true) && c.inverse().is_some());
        let (whole, right) = (|c: &&Cell| c.periodic == [true; 3], |c: &&Cell| c.lengths().is_some());
        let side = bounds.extent();
        let along = |k: usize, length: f64| each_axis(|j| if j == k { length } else { 0.0 });
        let mut extent = Extent {
            center: bounds.center(),
            edges: each_axis(|k| k).map(|k| along(k, side[k])),
            tails: [0.0; 3],
            periodic: [false; 3],
        };
        if let Some(cell) = cell.filter(|c| whole(c) || right(c)) {
            extent.periodic = cell.periodic;
            for k in (0..3).filter(|k| cell.periodic[*k]) {
                extent.edges[k] = cell.vectors[k];
            }
            extent.center = match whole(&cell) {
                true => each_axis(|k| cell.origin[k] + 0.5 * cell.vectors.map(|v| v[k]).iter().sum::<f64>()),
                false => each_axis(|k| match cell.periodic[k] {
                    true => cell.origin[k] + 0.5 * cell.vectors[k][k],
                    false => extent.center[k],
                }),
            };
        } else if let Some(cell) = cell {
            // Of a tilted cell that is open somewhere: the box about all of it.
            let mut all = *bounds;
            cell.corners().into_iter().for_each(|corner| all.include(corner));
            (extent.center, extent.edges) = (all.center(), each_axis(|k| k).map(|k| along(k, all.extent()[k])));
        }
        extent
    }

    /// Half of what it takes along a direction of length 1, without tails and with them.
    fn halves(&self, direction: [f64; 3]) -> [f64; 2] {
        let share = |k: usize| 0.5 * dot(self.edges[k], direction).abs();
        [(0..3).map(share).sum(), (0..3).map(|k| share(k) * (1.0 + self.tails[k])).sum()]
    }

    /// Whether a window holds all of it, and more.
    pub(super) fn is_in(&self, frame: &Frame, half: [f64; 2]) -> bool {
        // `width` leaves ROOM: a tenth of that tells such a window from a smaller one, whatever the rounding.
        let room = [0, 1].map(|k| half[k] / self.halves(frame.axes[k])[0] - 1.0);
        room.iter().all(|r| *r > -0.1 * ROOM) && room.iter().any(|r| *r > 0.1 * ROOM)
    }

    /// The width of the smallest window that holds all of it about its middle, world units; positive. Tails that come in
    /// on the other side take no room.
    pub fn width(&self, frame: &Frame, size: Size) -> f64 {
        let aspect = size.width as f64 / size.height as f64;
        let edges = across_and_up(&self.edges, self.periodic, frame);
        let [x, y] = [0, 1].map(|d| self.halves(frame.axes[d])[usize::from(edges[d].is_none())]);
        let half = x.max(y * aspect) * (1.0 + ROOM);
        if half > 0.0 && half.is_finite() { 2.0 * half } else { 1.0 }
    }
}

/// Share of a picture in perspective that points take at most.
const FILLED: f64 = 0.96;

/// Points that a picture shows whole along every direction.
#[derive(Clone, Copy, Debug)]
pub struct WindowContent<'a> {
    /// The points, such as the corners of a box, world units.
    pub points: &'a [[f64; 3]],
    /// The picture's middle, world units.
    pub center: [f64; 3],
    /// The directions, as frames anywhere.
    pub frames: &'a [Frame],
}

impl WindowContent<'_> {
    /// The distance from which a picture of these slopes of its edges shows them; not above 0 where they have no extent.
    pub fn distance(&self, slopes: [f64; 2]) -> f64 {
        // A point that lies z towards the eye is seen from a distance that is z less.
        self.most(|[x, y, z]| z + (x.abs() / slopes[0]).max(y.abs() / slopes[1]) / FILLED)
    }

    /// The width of an orthographic picture that holds them; 0 where they have no extent.
    pub fn width(&self, size: Size) -> f64 {
        let aspect = size.width as f64 / size.height as f64;
        2.0 * self.most(|[x, y, _]| x.abs().max(y.abs() * aspect)) * (1.0 + ROOM)
    }

    /// The most that `extent_of` gives for a point right, up and towards the eye from the centre, or 0.
    fn most(&self, extent_of: impl Fn([f64; 3]) -> f64) -> f64 {
        let frames = self.frames.iter().map(|frame| Frame { position: self.center, ..*frame });
        frames.flat_map(|frame| self.points.iter().map(move |p| frame.to_camera(*p))).map(extent_of).fold(0.0, f64::max)
    }
}

/// The edges that run across and up a picture where a map repeats along them alone, so that what leaves the cell on one
/// side comes in on the other.
pub(super) fn across_and_up(edges: &[[f64; 3]; 3], periodic: [bool; 3], frame: &Frame) -> [Option<usize>; 2] {
    [0, 1].map(|d| {
        let along = |k: usize| dot(edges[k], frame.axes[d]).abs() / norm(edges[k]).max(f64::MIN_POSITIVE);
        (0..3).find(|a| periodic[*a] && (0..3).all(|k| if k == *a { along(k) > 1.0 - 1e-12 } else { along(k) < 1e-6 }))
    })
}

/// The copies of a cell that a map of a part of it is continued by: those across the line of sight, so that every
/// particle counts once along it. `None` where the line of sight is oblique.
pub(super) fn across(cell: &Cell, frame: &Frame) -> Option<Cell> {
    let along = |k: usize| dot(cell.vectors[k], frame.axes[2]).abs() / norm(cell.vectors[k]);
    let periodic = |k: &usize| cell.periodic[*k];
    let mut copies = *cell;
    match (0..3).filter(periodic).find(|k| along(*k) > 1.0 - 1e-12) {
        Some(k) => copies.periodic[k] = false,
        None if (0..3).filter(periodic).all(|k| along(k) < 1e-6) => {}
        None => return None,
    }
    Some(copies)
}

/// Moves points to their images in the cell about a point.
#[derive(Clone, Copy, Debug)]
pub struct CenteredCell {
    center: [f64; 3],
    cell: PeriodicCell,
}

impl CenteredCell {
    /// `None` for a cell without volume, and for one that does not repeat.
    pub fn new(center: [f64; 3], cell: Cell) -> Option<CenteredCell> {
        Some(CenteredCell { center, cell: PeriodicCell::new(cell)? })
    }

    /// The shift of a point into the cell, world units.
    #[inline]
    pub fn shift(&self, point: [f64; 3]) -> [f64; 3] {
        let cells = self.cell.fractions(each_axis(|k| point[k] - self.center[k])).map(f64::round);
        match cells == [0.0; 3] {
            true => [0.0; 3],
            false => self.cell.vector(cells).map(|v| -v),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{FOV_DEG, spherical_camera};

    #[test]
    fn what_is_fitted_is_inside_and_touches_an_edge() {
        let bounds = Bounds { min: [1.0, 2.0, 3.0], max: [5.0, 4.0, 9.0] };
        let (corners, center) = (bounds.corners(), bounds.center());
        assert_eq!(center, [3.0, 3.0, 6.0]);
        let slope = libm::tan(0.5 * FOV_DEG.to_radians());
        for [azimuth, elevation] in [[0.0, 0.0], [30.0, 20.0], [200.0, -70.0]] {
            let frames = [spherical_camera([0.0; 3], azimuth, elevation, 1.0).frame().unwrap()];
            let content = WindowContent { points: &corners, center, frames: &frames };
            let d = content.distance([2.0 * slope, slope]);
            let most = content.most(|[x, y, z]| (x.abs() / (d - z) / (2.0 * slope)).max(y.abs() / (d - z) / slope));
            assert!((0.9..=FILLED + 1e-9).contains(&most), "{most}");
            let seen_from_front = content.width(Size { width: 100, height: 100 });
            assert!(azimuth != 0.0 || (seen_from_front - 4.0).abs() < 1e-8);
        }
    }
}
