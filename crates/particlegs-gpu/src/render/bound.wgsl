// The scale of the fixed-point sums: per plane, what may come together on a pixel is bounded by the peaks of all strokes
// that touch its tile; those are summed exactly, so that the scale, and with it every bit, is the same in whatever order.

// Peaks are rounded up to these units.
const PEAK_UNIT: f32 = 65536.0;

// Adds a stroke's peak to the tiles that it touches: the low words of sums of two, and the high ones where those wrap.
fn add_to_tiles(p: PlacedFootprint) {
    let plane = frame.levels[p.level];
    let at = vec2f(p.stroke.x, p.stroke.y);
    let half = vec2f(p.half_width, p.stroke.half);
    let last = vec2f(f32(plane.width - 1u), f32(plane.rows - 1u));
    let low = vec2u(clamp(floor(at - half), vec2f(0.0), last)) / TILE;
    let high = vec2u(clamp(ceil(at + half), vec2f(0.0), last)) / TILE;
    let units = u32(ceil(min(p.stroke.peak, DEEPEST - 1.0) * PEAK_UNIT));
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let tile = 2u * (plane.first_tile + y * plane.tiles + x);
            let before = atomicAdd(&tiles[tile], units);
            if before > 0xffffffffu - units {
                atomicAdd(&tiles[tile + 1u], 1u);
            }
        }
    }
}
