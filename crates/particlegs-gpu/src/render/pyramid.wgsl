// Planes summed from coarse to fine: core's render::raster::pyramid. Sums become depth (float32, in the same words) on the
// way.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> scale: Scale;
@group(0) @binding(2) var<storage, read_write> planes: array<u32>;
// The finer plane of a pass; its coarser one is the next.
@group(0) @binding(3) var<uniform> target_plane: vec4u;

// Interpolation a quarter of a pixel past the fourth sample.
const W = array<f32, 8>(
    -0.0078614, 0.0397912, -0.1338106, 0.8789731, 0.2922763, -0.0948323, 0.0321284, -0.0066647,
);

// The weight of sample `k` for a pixel, by whether its place is even.
fn weight(even: bool, k: u32) -> f32 {
    return W[select(k, 7u - k, even)];
}

// The first of the eight samples around a pixel.
fn first_sample(place: u32) -> u32 {
    return place / 2u + place % 2u;
}

fn depth_at(level: Level, x: u32, y: u32, is_sum: bool) -> f32 {
    if x >= level.width {
        return 0.0;
    }
    let word = planes[level.first + min(y, level.rows - 1u) * level.width + x];
    if is_sum {
        return f32(word) * scale.down;
    }
    return bitcast<f32>(word);
}
