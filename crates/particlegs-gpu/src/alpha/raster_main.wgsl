// Blends footprints front to back: core's render::alpha::raster. A workgroup a tile, a thread a pixel: each pixel adds in
// the order of its list, and goes on from slab to slab where it was.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(3) var<storage, read> entries: array<u32>;
@group(0) @binding(4) var<storage, read> splats: array<Splat>;
// Brightness of each pixel, and its transmittance: 0 once it is done.
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;
@group(0) @binding(6) var<storage, read_write> lefts: array<f32>;

// Footprints that are loaded together.
const LOADED: u32 = 64u;
var<workgroup> splats_here: array<Splat, 64>;
var<workgroup> range_here: vec2u;
// 1 where a pixel of the tile is not done.
var<workgroup> going_on: atomic<u32>;
var<workgroup> go_on: u32;

// What a pixel has come to.
struct PixelState {
    sum: f32,
    left: f32,
}

// A footprint on a pixel of the tile: `corner` is the tile's first, `at` the pixel from there.
fn blend(p: PixelState, s: Splat, corner: vec2f, at: vec2f) -> PixelState {
    let dy = at.y + (corner.y - s.at.y);
    let d = at.x + ((corner.x - s.at.x) - s.lean * dy);
    let power = d * d * s.along + s.down * (dy * dy);
    if power < s.end {
        return p;
    }
    let alpha = min(exp2(power) * s.peak, frame.most_alpha);
    let next = p.left * (1.0 - alpha);
    if next < frame.least_transmittance {
        return PixelState(p.sum, 0.0);
    }
    return PixelState(p.sum + p.left * alpha * s.grey, next);
}

@compute @workgroup_size(16, 16)
fn main(
    @builtin(workgroup_id) tile: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let corner = tile.xy * TILE;
    let pixel = corner + local.xy;
    let inside = all(pixel < frame.size);
    let at = pixel.y * frame.size.x + pixel.x;
    var p = PixelState(0.0, 0.0);
    if inside {
        p.left = 1.0;
        if slab.is_first == 0u {
            p = PixelState(sums[at], lefts[at]);
        }
    }
    if me == 0u {
        range_here = ranges[tile.y * frame.across + tile.x];
    }
    let range = workgroupUniformLoad(&range_here);
    for (var base = range.x; base < range.y; base += LOADED) {
        let count = min(range.y - base, LOADED);
        if me < count {
            splats_here[me] = splats[entries[base + me]];
        }
        if me == 0u {
            atomicStore(&going_on, 0u);
        }
        workgroupBarrier();
        for (var k = 0u; k < count && p.left > 0.0; k++) {
            p = blend(p, splats_here[k], vec2f(corner), vec2f(local.xy));
        }
        if p.left > 0.0 {
            atomicStore(&going_on, 1u);
        }
        workgroupBarrier();
        if me == 0u {
            go_on = atomicLoad(&going_on);
        }
        if workgroupUniformLoad(&go_on) == 0u {
            break;
        }
    }
    if inside {
        sums[at] = p.sum;
        lefts[at] = p.left;
    }
}
