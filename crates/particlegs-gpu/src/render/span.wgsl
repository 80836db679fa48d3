// What a row of a stroke adds to its pixels, in whole numbers. Whoever sums them, by whatever kernel, has the same bits.

// The way from the centre to a row's first pixel `x`, and the row's own fall.
fn row_start(s: RasterSplat, x: u32, y: u32) -> vec2f {
    let dy = f32(y) - s.y;
    return vec2f(f32(x) - (s.x + s.slope * dy), s.down * (dy * dy));
}

// What is added to the pixel so many along a row that starts so.
fn addition(s: RasterSplat, start: vec2f, along: u32, scale: f32) -> u32 {
    let dx = start.x + f32(along);
    let power = dx * dx * s.along + start.y;
    return select(0u, u32(exp2(power) * s.peak * scale + 0.5), power >= s.end);
}
