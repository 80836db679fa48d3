// Tiles of 8 x 8 pixels: four in each tile of bound.wgsl, one behind the other.

// Pixels of a tile along a side.
const SIDE: u32 = 8u;

// The number of a tile of a plane.
fn tile_number(plane: Level, x: u32, y: u32) -> u32 {
    return 4u * (plane.first_tile + (y / 2u) * plane.tiles + x / 2u) + 2u * (y % 2u) + x % 2u;
}

// The plane of a tile, and its place there in tiles from the left and the top: the inverse.
fn tile_place(tile: u32) -> vec3u {
    let four = tile / 4u;
    var level = 0u;
    while level + 1u < frame.level_count && frame.levels[level + 1u].first_tile <= four {
        level += 1u;
    }
    let plane = frame.levels[level];
    let at = four - plane.first_tile;
    return vec3u(level, 2u * (at % plane.tiles) + tile % 2u, 2u * (at / plane.tiles) + tile / 2u % 2u);
}

// The tiles that a stroke's box touches, from the left and the top: the first, and those beyond the last.
fn tiles_of(s: RasterSplat, level: u32) -> vec4u {
    let rows = rows_of(s, level);
    // The farthest that a row reaches, and what rounding may have made of it.
    let reach = sqrt(s.end / s.along + s.slope * s.slope * (s.end / s.down));
    let half = select(1e30, reach, reach < 1e30);
    let room = 1e-3 + 4e-6 * (abs(s.x) + half);
    let left = max(ceil(s.x - half - room), 0.0);
    let right = min(floor(s.x + half + room), f32(frame.levels[level].width) - 1.0);
    if rows.y == 0u || right < left {
        return vec4u(0u);
    }
    return vec4u(u32(left), rows.x, u32(right) + SIDE, rows.x + rows.y - 1u + SIDE) / SIDE;
}
