// What all stages of a picture know (frame.rs has the same records).

// A camera (core's render::lens), relative to the origin of the Gaussians.
struct Lens {
    // Rows right, down, forward, over the lens' unit of length.
    right: vec4f,
    down: vec4f,
    forward: vec4f,
    // The eye, as the sum of two floats.
    eye: vec4f,
    eye_low: vec4f,
    // Pixel coordinates of the axis; pixel centres have whole coordinates.
    center: vec2f,
    // Nearest and farthest depth of what is drawn.
    range: vec2f,
    // Pixels for a unit of x / depth (perspective) or a unit.
    focal: f32,
    // What one particle adds to the sum over pixels, times depth squared in perspective.
    unit: f32,
    // Variance added to every Gaussian.
    radius2: f32,
    // 1 where size falls with depth.
    perspective: u32,
}

// One plane of the pyramid. Planes of sums and of tiles lie one behind the other.
struct Level {
    // Its first sum among those of all planes.
    first: u32,
    // Sums from row to row, which are those of its pixels with the pads.
    width: u32,
    // Rows with the pads.
    rows: u32,
    // Its first tile among those of all planes.
    first_tile: u32,
    // Tiles across.
    tiles: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct Frame {
    lens: Lens,
    levels: array<Level, 16>,
    // Pixels of the picture across and down.
    size: vec2u,
    // Number of levels.
    level_count: u32,
    // Gaussians in the columns.
    count: u32,
    // Depth that a cut may drop at its edge.
    faintest: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// Pixels drawn beyond each edge of a plane.
const PAD: u32 = 8u;
// Pixels of a tile along a side.
const TILE: u32 = 16u;
// Where a Gaussian touches no plane.
const NOWHERE: u32 = 0xffffffffu;
