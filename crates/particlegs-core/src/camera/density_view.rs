//! Views of surface density: perspective, or an orthographic window into a box that may repeat.

use super::extent::{CenteredCell, Extent, ROOM, across, across_and_up};
use super::view::{Camera, Frame, Projection, View};
use super::{clipping_range, spherical_camera};
use crate::math::{dot, each_axis, norm};
use crate::picture::{Plane, Size};
use crate::space::{Bounds, Cell};
use crate::{Error, Result};

/// Room over tails: those of wide Gaussians are interpolated, with ripples beyond.
const RIPPLES: f64 = 1.5;
/// No more room than this, over the edge.
const MOST_ROOM: f64 = 3.0;
/// More copies of a box than this are refused.
const MOST_COPIES: f64 = 4096.0;

/// A picture of surface density to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityView {
    /// File name without ending.
    pub name: String,
    /// Perspective or orthographic. Its own clipping range is not looked at.
    pub camera: Camera,
    /// Nearest and farthest depth that count, world units from the eye.
    pub range: [f64; 2],
    /// The images of a periodic cell that are drawn.
    pub images: Images,
}

/// Images of particles in a periodic cell that are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Images {
    /// The particles where they are.
    Own,
    /// Each particle once, in the cell about the point looked at. Orthographic views only.
    Nearest(Cell),
    /// All that lie in the window, along the cell's periodic vectors. Orthographic views only.
    All(Cell),
}

/// The window of an orthographic picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Its middle, world units.
    pub center: [f64; 3],
    /// Azimuth and elevation of the line of sight, degrees.
    pub angles_deg: [f64; 2],
    /// World units across.
    pub width: f64,
    /// World units along the line of sight; `None` = every particle once.
    pub depth: Option<f64>,
}

impl DensityView {
    /// A perspective (or orthographic) view as pictures have it, of particles where they are.
    pub fn of_view(view: &View, bounds: &Bounds) -> DensityView {
        let range = view.camera.clipping_range.unwrap_or_else(|| match view.camera.projection {
            Projection::Perspective { .. } => clipping_range(bounds, &view.camera),
            // No Gaussian is cut by a picture that asks for no depth.
            Projection::Orthographic { .. } => {
                [0.0, view.camera.distance() + everything(bounds, view.camera.focal_point)]
            }
        });
        DensityView { name: view.name.clone(), camera: view.camera, range, images: Images::Own }
    }

    /// The same of particles in a cell: where an orthographic window holds the periodic cell whole, or looks at it
    /// obliquely, every particle is drawn once; a window onto a part of it is continued by copies.
    pub fn of_cell(view: &View, size: Size, bounds: &Bounds, cell: Option<Cell>) -> DensityView {
        let density_view = DensityView::of_view(view, bounds);
        let cell = cell.filter(|c| c.periodic.contains(&true) && c.inverse().is_some());
        let (Some(cell), Projection::Orthographic { height_world }) = (cell, view.camera.projection) else {
            return density_view;
        };
        let Ok(frame) = view.camera.frame() else { return density_view };
        let half = [0.5 * height_world * size.width as f64 / size.height as f64, 0.5 * height_world];
        let images = match across(&cell, &frame) {
            Some(copies) if !Extent::new(bounds, Some(&cell)).is_in(&frame, half) => {
                // Without a range, copies along the line of sight would count a particle more than once.
                Images::All(if view.camera.clipping_range.is_some() { cell } else { copies })
            }
            _ => Images::Nearest(cell),
        };
        DensityView { images, ..density_view }
    }

    /// An orthographic window.
    pub fn orthographic(
        name: &str,
        window: &Window,
        size: Size,
        bounds: &Bounds,
        cell: Option<Cell>,
    ) -> Result<DensityView> {
        let Window { center, angles_deg, width, depth } = *window;
        for (name, value) in [("width", width), ("depth", depth.unwrap_or(1.0))] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::argument(format!("the {name} must be positive, not {value}")));
            }
        }
        if center.iter().chain(&angles_deg).any(|v| !v.is_finite()) {
            return Err(Error::argument("the centre or an angle is not finite"));
        }
        let half = depth.map_or(everything(bounds, center), |d| 0.5 * d);
        let mut camera = spherical_camera(center, angles_deg[0], angles_deg[1], half);
        camera.projection = Projection::Orthographic { height_world: width * size.height as f64 / size.width as f64 };
        camera.clipping_range = depth.map(|d| [0.0, d]);
        let view = View { name: name.to_string(), camera, radius: 1.0, opacity: 1.0 };
        Ok(DensityView::of_cell(&view, size, bounds, cell))
    }

    /// The cell into which every particle is moved.
    pub fn centered_cell(&self) -> Option<CenteredCell> {
        match self.images {
            Images::Nearest(cell) => CenteredCell::new(self.camera.focal_point, cell),
            Images::Own | Images::All(_) => None,
        }
    }

    /// A map by `draw`. Where it shows a cell whole that repeats along the picture's sides, it is drawn with room for
    /// tails, which then come in on the other side; `tails` is how much longer they make each edge, over the edge.
    pub fn wrapped(
        &self,
        size: Size,
        tails: impl FnOnce(&Cell) -> [f64; 3],
        draw: impl FnOnce(&DensityView, Size) -> Result<Plane>,
    ) -> Result<Plane> {
        let mut planes = self.wrapped_planes(size, tails, |view, size| Ok(vec![draw(view, size)?]))?;
        Ok(planes.swap_remove(0))
    }

    /// The same of several planes that `draw` gives together.
    pub fn wrapped_planes(
        &self,
        size: Size,
        tails: impl FnOnce(&Cell) -> [f64; 3],
        draw: impl FnOnce(&DensityView, Size) -> Result<Vec<Plane>>,
    ) -> Result<Vec<Plane>> {
        let (Images::Nearest(cell), Projection::Orthographic { height_world }) = (self.images, self.camera.projection)
        else {
            return draw(self, size);
        };
        let (sides, pixel) = ([size.width, size.height], height_world / size.height as f64);
        let edges = across_and_up(&cell.vectors, cell.periodic, &self.camera.frame()?);
        // Edges and their lengths in pixels.
        let repeats = [0, 1].map(|d| {
            let edge = edges[d].map(|a| (a, norm(cell.vectors[a]) / pixel));
            // A cell wider than the picture is not shown whole, and one of less than a pixel has no sides to fold.
            edge.filter(|(_, period)| (1.0..=sides[d] as f64 * (1.0 + 0.1 * ROOM)).contains(period))
        });
        if repeats == [None; 2] {
            return draw(self, size);
        }
        let tails = tails(&cell);
        let room = |d: usize| {
            let Some((a, period)) = repeats[d] else { return sides[d] };
            // Both sides get as many pixels, so that the picture's middle stays where it is.
            let half = 0.5 * (period * (1.0 + (RIPPLES * tails[a]).min(MOST_ROOM)) - sides[d] as f64);
            (sides[d] as i64 + 2 * half.ceil() as i64) as usize
        };
        let larger = Size { width: room(0), height: room(1) };
        let mut view = self.clone();
        view.camera.projection = Projection::Orthographic { height_world: pixel * larger.height as f64 };
        let drawn = draw(&view, larger)?;
        let columns = shares(larger.width, size.width, repeats[0].map(|r| r.1));
        let rows = shares(larger.height, size.height, repeats[1].map(|r| r.1));
        let folded = |drawn: Plane| {
            let mut plane = Plane::zeros(size);
            for &(from, to, down) in &rows {
                let (from, to) = (&drawn.data[from * larger.width..], &mut plane.data[to * size.width..]);
                columns.iter().for_each(|&(i, j, across)| to[j] += down * across * from[i]);
            }
            plane
        };
        Ok(drawn.into_iter().map(folded).collect())
    }

    /// Shifts of the particles (bounds `bounds`, reaching `margin` beyond their centres) that can
    /// bring some of them into the window; only the zero shift where no copies are drawn.
    pub fn copies(&self, size: Size, bounds: &Bounds, margin: f64) -> Result<Vec<[f64; 3]>> {
        let (Images::All(cell), Projection::Orthographic { height_world }) = (self.images, self.camera.projection)
        else {
            return Ok(vec![[0.0; 3]]);
        };
        let inverse = cell.inverse().ok_or_else(|| Error::argument("the periodic cell has no volume"))?;
        let frame = self.camera.frame()?;
        let window = window_corners(&frame, height_world, size, self.range);
        let data = bounds.corners();
        let mut ranges = [[0i64; 2]; 3];
        let mut copies = 1.0;
        for axis in 0..3 {
            if !cell.periodic[axis] {
                continue;
            }
            // Cells along this axis: a point's coordinate is p . row.
            let row: [f64; 3] = each_axis(|k| inverse[k][axis]);
            let ends = |points: &[[f64; 3]; 8]| {
                let along = points.map(|p| dot(p, row));
                [along.into_iter().fold(f64::INFINITY, f64::min), along.into_iter().fold(f64::NEG_INFINITY, f64::max)]
            };
            let (window, data) = (ends(&window), ends(&data));
            let reach = margin * norm(row);
            let (first, last) = ((window[0] - data[1] - reach).ceil(), (window[1] - data[0] + reach).floor());
            copies *= (last - first + 1.0).max(0.0);
            // Checked before the shifts are listed: a window far larger than the box would take any amount of memory.
            if copies.is_nan() || copies > MOST_COPIES {
                return Err(Error::argument(format!("the window shows more than {MOST_COPIES} copies of the box")));
            }
            ranges[axis] = [first as i64, last as i64];
        }
        Ok(cell.shifts(ranges))
    }
}

/// Pixels of a line, those of another about the same middle that they go to, and shares, so that all lie in the cell of
/// `period` pixels there.
fn shares(from: usize, to: usize, period: Option<f64>) -> Vec<(usize, usize, f32)> {
    let Some(period) = period else { return (0..to).map(|i| (i, i, 1.0)).collect() };
    let mut shares = Vec::with_capacity(2 * from);
    for i in 0..from {
        let (mut start, end) = (i as f64 - 0.5 * from as f64, (i + 1) as f64 - 0.5 * from as f64);
        while start < end {
            let cell = (start / period + 0.5).floor();
            let at = start - cell * period + 0.5 * to as f64;
            // At least a millionth of a pixel, so that rounding at an edge cannot stop the loop.
            let piece = ((cell + 0.5) * period - start).min(at.floor() + 1.0 - at).max(1e-6).min(end - start);
            shares.push((i, (at.max(0.0) as usize).min(to - 1), piece as f32));
            start += piece;
        }
    }
    shares
}

/// A depth beyond all there is, from a point, world units.
fn everything(bounds: &Bounds, from: [f64; 3]) -> f64 {
    4.0 * norm(bounds.extent_nonzero()) + norm(each_axis(|k| from[k] - bounds.center()[k]))
}

fn window_corners(frame: &Frame, height: f64, size: Size, range: [f64; 2]) -> [[f64; 3]; 8] {
    let [x, y] = [0.5 * height * size.width as f64 / size.height as f64, 0.5 * height];
    // The frame's third axis points backwards, so depths are negative in it.
    let window = Bounds { min: [-x, -y, -range[1]], max: [x, y, -range[0]] };
    let [right, up, back] = frame.axes;
    window.corners().map(|[x, y, z]| each_axis(|k| frame.position[k] + x * right[k] + y * up[k] + z * back[k]))
}
