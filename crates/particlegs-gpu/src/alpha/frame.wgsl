// What all stages of a picture know (frame.rs has the same records).

// A camera in the training frame (core's render::alpha::Eye), and what is left out of a picture.
struct Frame {
    // Rows right, down, forward.
    right: vec4f,
    down: vec4f,
    forward: vec4f,
    // From the eye to the frame's middle, see fixed.wgsl; parts of right, of down, of forward: magnitudes and signs.
    to_middle: array<vec4u, 3>,
    axes: array<vec4u, 9>,
    // Pixel coordinates of the axis; pixel centres have whole coordinates.
    center: vec2f,
    // Largest |x/depth| and |y/depth| at which shapes are taken.
    guard: vec2f,
    // Depths at or below the first and above the second are not drawn.
    range: vec2f,
    // Pixels for a unit of x/depth.
    focal: f32,
    // Variance added to every footprint, and the least ratio of determinants that is compensated for.
    low_pass: f32,
    least_ratio: f32,
    // Smaller alphas are not drawn, larger ones become this, and a pixel is done below this transmittance.
    least_alpha: f32,
    most_alpha: f32,
    least_transmittance: f32,
    // Largest brightness.
    brightest: f32,
    // Tiles in a row.
    across: u32,
    // Pixels of the picture across and down.
    size: vec2u,
    // Gaussians of this part, and how many come before.
    count: u32,
    first: u32,
}

// Footprints that are listed and blended together: those of some blocks of 64, in the order of their depth.
struct Slab {
    // All Gaussians of the picture.
    gaussians: u32,
    // The first block, and how many.
    first: u32,
    blocks: u32,
    // Entries in the lists of all tiles.
    entries: u32,
    // 1 where nothing was blended before.
    is_first: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// A footprint as tiles are drawn with it: the alpha of a pixel is peak 2^p with p = along d^2 + down dy^2, where d is its
// distance in x from the crest of its row.
struct Splat {
    at: vec2f,
    // How far the crest moves with a row.
    lean: f32,
    // Fall along a row, and of the crest from row to row, 1/pixels^2; negative.
    along: f32,
    down: f32,
    // Alpha at the centre, and the power below which it is too small to be drawn.
    peak: f32,
    end: f32,
    grey: f32,
}

// Pixels of a tile along a side.
const TILE: u32 = 16u;
// The depth of what is not drawn, behind all that is.
const NO_DEPTH: u32 = 0xffffffffu;
