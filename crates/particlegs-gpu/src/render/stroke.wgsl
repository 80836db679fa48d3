// Footprints as the raster wants them: core's render::bin::RasterSplat.

// What is drawn of a footprint, in the pixels of its plane (pad included).
struct RasterSplat {
    // Centre; pixel centres have whole coordinates.
    x: f32,
    y: f32,
    // Shift of the row's centre from row to row.
    slope: f32,
    // -log2(e) / (2 sigma^2) along a row; the same down the rows.
    along: f32,
    down: f32,
    // The exponent (power of two) at which it ends.
    end: f32,
    // Optical depth at the centre.
    peak: f32,
    // Half of its height in rows.
    half: f32,
}

struct PlacedFootprint {
    // The plane, or NOWHERE.
    level: u32,
    stroke: RasterSplat,
    // Half of its width in pixels of its plane.
    half_width: f32,
    // 1 where the sum over the pixel grid is made exact, as that of small footprints is.
    small: u32,
}
