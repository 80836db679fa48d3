// Planes summed from coarse to fine: core's render::raster::pyramid. Sums become depth (float32, in the same words) on the
// way.

// Interpolation a quarter of a pixel past the fourth sample.
const TAPS = array<f32, 8>(
    -0.0078614, 0.0397912, -0.1338106, 0.8789731, 0.2922763, -0.0948323, 0.0321284, -0.0066647,
);

// The weight of sample `k` for a pixel, by whether its place is even.
fn weight(even: bool, k: u32) -> f32 {
    return TAPS[select(k, 7u - k, even)];
}

// The first of the eight samples around a pixel.
fn first_sample(place: u32) -> u32 {
    return place / 2u + place % 2u;
}
