// Fragments that the peels left: a key each, its pixel of the band of rows 256 times, and its alpha in 8 bits.

@group(0) @binding(3) var<storage, read> ranges: array<u32>;

// 0 where there is none, or one that changes nothing.
fn key_of(at: u32) -> u32 {
    let p = quad_pixel(at);
    if !p.is_covered || p.pixel.y < view.first || p.pixel.y >= view.last {
        return 0u;
    }
    let pixel = index_of(p.pixel);
    let z = quads[p.own].depth;
    if ranges[2u * pixel] == 0u || z < least(ranges[2u * pixel]) || z > greatest(ranges[2u * pixel + 1u]) {
        return 0u;
    }
    let level = to_byte(alpha_of(p.own, p.pixel));
    let in_band = pixel - (view.first - view.strip.x) * view.size.x;
    return select((in_band << 8u) | level, 0u, level == 0u);
}
