// Which footprints touch which tile: core's render::alpha::TileRange. First and last column in the halves of one word,
// first and last row in those of another.

// No tile at all: the last column comes before the first.
const NO_TILES: vec2u = vec2u(1u, 1u);

// The tiles that a footprint reaches.
fn touched_tiles(at: vec2f, reach: vec2f) -> vec2u {
    let first = max(ceil(at - reach), vec2f(0.0));
    let last = min(floor(at + reach), vec2f(frame.size) - 1.0);
    if !all(first <= last) {
        return NO_TILES;
    }
    return (vec2u(first) / TILE) | ((vec2u(last) / TILE) << vec2u(16u));
}

// Tiles across and down.
fn extent(t: vec2u) -> vec2u {
    return (t >> vec2u(16u)) + 1u - (t & vec2u(0xffffu));
}

// How many.
fn number(t: vec2u) -> u32 {
    return extent(t).x * extent(t).y;
}

// The one at a place among them, row by row, by its number on the picture.
fn tile_at(t: vec2u, place: u32, across: u32) -> u32 {
    let columns = extent(t).x;
    let corner = t & vec2u(0xffffu);
    return (corner.y + place / columns) * across + corner.x + place % columns;
}
