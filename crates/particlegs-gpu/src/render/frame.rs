//! The records that kernels read, as frame.wgsl has them.

use bytemuck::{Pod, Zeroable};
use particlegs_core::math::each_axis;
use particlegs_core::picture::Size;
use particlegs_core::render::bin::FAINTEST;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::raster::pyramid;

/// Planes of a picture at most: the largest picture has fewer.
pub(super) const MOST_LEVELS: usize = 16;
/// Pixels of a tile along a side.
const TILE: usize = 16;

#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct LensRecord {
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
    eye: [f32; 4],
    eye_low: [f32; 4],
    center: [f32; 2],
    range: [f32; 2],
    focal: f32,
    unit: f32,
    radius2: f32,
    perspective: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LevelRecord {
    pub first: u32,
    pub width: u32,
    pub rows: u32,
    pub first_tile: u32,
    pub tiles: u32,
    pad: [u32; 3],
}

#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameRecord {
    lens: LensRecord,
    levels: [LevelRecord; MOST_LEVELS],
    size: [u32; 2],
    level_count: u32,
    count: u32,
    faintest: f32,
    pad: [u32; 3],
}

/// The planes of a picture, and how many words they and their tiles have.
#[derive(Clone, Debug)]
pub(crate) struct PlaneLayout {
    pub size: Size,
    pub levels: Vec<LevelRecord>,
    pub sums: u64,
    pub tiles: u64,
}

impl PlaneLayout {
    /// Words of the finest one, and of all others.
    pub fn words(&self) -> [u64; 2] {
        let finest = self.levels.get(1).map_or(self.sums, |l| u64::from(l.first));
        [finest, self.sums - finest]
    }

    /// Of a picture: core's pyramid without the room that vectors take.
    pub fn new(size: Size) -> PlaneLayout {
        let (mut sums, mut tiles) = (0u64, 0u64);
        let level = |l: &pyramid::Level| {
            let (width, rows) = (l.size.width + 2 * pyramid::PAD, l.rows);
            let across = width.div_ceil(TILE);
            let record = LevelRecord {
                first: sums as u32,
                width: width as u32,
                rows: rows as u32,
                first_tile: tiles as u32,
                tiles: across as u32,
                pad: [0; 3],
            };
            sums += (width * rows) as u64;
            tiles += (across * rows.div_ceil(TILE)) as u64;
            record
        };
        let levels = pyramid::levels(size).iter().map(level).collect();
        PlaneLayout { size, levels, sums, tiles }
    }
}

/// The float32 next to a number, and what it leaves of it.
pub(crate) fn two_floats(v: f64) -> [f32; 2] {
    let high = v as f32;
    [high, (v - f64::from(high)) as f32]
}

impl FrameRecord {
    /// Of planes alone, whose depth is as it is to be seen.
    pub fn of_planes(planes: &PlaneLayout) -> FrameRecord {
        let mut levels = [LevelRecord::default(); MOST_LEVELS];
        levels[..planes.levels.len()].copy_from_slice(&planes.levels);
        FrameRecord {
            levels,
            size: [planes.size.width as u32, planes.size.height as u32],
            level_count: planes.levels.len() as u32,
            ..FrameRecord::default()
        }
    }

    /// Of a camera, for `count` Gaussians about `origin`, in whose `exposure` depth is so many times as large.
    pub fn new(lens: &Lens, origin: [f64; 3], planes: &PlaneLayout, count: u32, exposure: f64) -> FrameRecord {
        // Two floats a coordinate, so that a kernel can subtract a near place without losing digits.
        let eye = each_axis(|k| two_floats(lens.position[k] - origin[k]));
        let four = |v: [f32; 3]| [v[0], v[1], v[2], 0.0];
        let [right, down, forward] = lens.axes.map(|a| four(a.map(|v| v as f32)));
        FrameRecord {
            lens: LensRecord {
                right,
                down,
                forward,
                eye: four(eye.map(|v| v[0])),
                eye_low: four(eye.map(|v| v[1])),
                center: lens.center.map(|v| v as f32),
                range: lens.range.map(|v| v as f32),
                focal: lens.focal as f32,
                unit: (lens.unit * exposure) as f32,
                radius2: lens.radius2 as f32,
                perspective: u32::from(lens.perspective),
            },
            count,
            // Beyond these limits every cut is the nearest or the farthest, and float32 ends.
            faintest: (FAINTEST * exposure).clamp(1e-30, 1e30) as f32,
            ..FrameRecord::of_planes(planes)
        }
    }
}
