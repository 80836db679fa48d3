// A slice of the pixels of the quads of 64 particles: particlegs' reference::paraview shares work out by bands of rows, a
// GPU by slices of so many pixels.

// Particles are 64 times the first word and on; of the pixels of their boxes, those from the second word on.
@group(0) @binding(1) var<storage, read> positions: array<f32>;
@group(0) @binding(2) var<storage, read> slices: array<vec2u>;

const SLICE: u32 = 4096u;
var<workgroup> quads: array<Quad, 64>;

fn quad_at(i: u32) -> Quad {
    var quad: Quad;
    if i < view.count {
        let n = view.count;
        quad = quad_of(splat_of(vec3f(positions[i], positions[i + n], positions[i + 2u * n])));
    }
    return quad;
}

// The quads of a slice; how far its pixels go.
fn load(slice: vec2u, me: u32) -> u32 {
    let quad = quad_at(slice.x * THREADS + me);
    quads[me] = quad;
    running_sum(0u, me, quad.extent.x * quad.extent.y);
    return min(slice.y + SLICE, workgroupUniformLoad(&ends[63]));
}

// The pixel `at` of the boxes of all, and whose it is; outside the picture where it is not covered.
struct QuadPixel {
    pixel: vec2u,
    own: u32,
    is_covered: bool,
}

fn quad_pixel(at: u32) -> QuadPixel {
    let own = owner(0u, at);
    let along = within(0u, own, at);
    let columns = quads[own].extent.x;
    let pixel = quads[own].low + vec2u(along % columns, along / columns);
    return QuadPixel(pixel, own, quads[own].aligned == 1u || covers(quads[own].corners, pixel));
}

// Among the pixels of the strip.
fn index_of(pixel: vec2u) -> u32 {
    return (pixel.y - view.strip.x) * view.size.x + pixel.x;
}
