// Walks each tile's list front to back once more, and sums what its pixels want of every footprint: particlegs-train's
// alpha::raster. A workgroup a tile, a thread four pixels of a row. What lies behind a footprint is the picture less what
// came before it, so that nothing has to be kept from drawing but brightness.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(3) var<storage, read> entries: array<u32>;
@group(0) @binding(4) var<storage, read> splats: array<Splat>;
@group(0) @binding(5) var<storage, read> places: array<vec2u>;
// The change of the loss with each pixel's brightness, and brightness as it was blended.
@group(0) @binding(6) var<storage, read> by_pixel: array<f32>;
@group(0) @binding(7) var<storage, read> drawn: array<f32>;
// Brightness and transmittance of each pixel where the walk is.
@group(0) @binding(8) var<storage, read_write> walked: array<vec2f>;
@group(0) @binding(9) var<storage, read_write> slots: array<f32>;

// Footprints that are loaded together, and those that are summed together.
const LOADED: u32 = 64u;
const TOGETHER: u32 = 8u;
// Parts that the sums of a footprint are added up in, of two rows each.
const PARTS: u32 = 8u;

var<workgroup> splats_here: array<Splat, 64>;
var<workgroup> slots_here: array<u32, 64>;
// What each thread's pixels want of each footprint; then each part's sums.
var<workgroup> pixels_here: array<vec4f, 512>;
var<workgroup> parts_here: array<f32, 448>;
var<workgroup> range_here: vec2u;
// 1 where a pixel of the tile is not done.
var<workgroup> going_on: atomic<u32>;
var<workgroup> go_on: u32;

// Four pixels of a row of the tile from `first` on, and what they have come to.
struct PixelStates {
    first: vec2f,
    sum: vec4f,
    left: vec4f,
    wanted: vec4f,
    drawn: vec4f,
}

// Where a walk begins: pixels outside the picture, and those that want nothing, are done.
fn start_states(pixel: vec2u, first: vec2f) -> PixelStates {
    var p: PixelStates;
    p.first = first;
    for (var k = 0u; k < 4u; k++) {
        if pixel.x + k < frame.size.x && pixel.y < frame.size.y {
            let at = pixel.y * frame.size.x + pixel.x + k;
            p.wanted[k] = by_pixel[at];
            p.drawn[k] = drawn[at];
            p.left[k] = select(1.0, 0.0, p.wanted[k] == 0.0);
            if slab.is_first == 0u {
                p.sum[k] = walked[at].x;
                p.left[k] = walked[at].y;
            }
        }
    }
    return p;
}

// Where the next slab goes on.
fn store_states(pixel: vec2u, p: PixelStates) {
    for (var k = 0u; k < 4u; k++) {
        if pixel.x + k < frame.size.x && pixel.y < frame.size.y {
            walked[pixel.y * frame.size.x + pixel.x + k] = vec2f(p.sum[k], p.left[k]);
        }
    }
}

// Blends a footprint onto four pixels as raster_main.wgsl does. With h the change of the loss with the logarithm of alpha,
// and dx the distance from the centre: their sums of h, h dx, h dx^2, and the change with the grey level.
fn blend_sums(p: ptr<function, PixelStates>, s: Splat, corner: vec2f) -> vec4f {
    let x = (*p).first.x + vec4f(0.0, 1.0, 2.0, 3.0);
    let dy = (*p).first.y + (corner.y - s.at.y);
    let d = x + ((corner.x - s.at.x) - s.lean * dy);
    let power = d * d * s.along + s.down * (dy * dy);
    let left = (*p).left;
    let reached = power >= vec4f(s.end);
    let raw = exp2(power) * s.peak;
    let alpha = select(vec4f(0.0), min(raw, vec4f(frame.most_alpha)), reached);
    let through = 1.0 - alpha;
    let next = left * through;
    let live = next >= vec4f(frame.least_transmittance);
    let weight = select(vec4f(0.0), left * alpha, live);
    (*p).sum += weight * s.grey;
    (*p).left = select(vec4f(0.0), next, live);
    let behind = (*p).drawn - (*p).sum;
    // An alpha that was cut moves no more.
    let moves = live & reached & (raw <= vec4f(frame.most_alpha));
    let h = select(vec4f(0.0), alpha * (*p).wanted * (left * s.grey - behind / through), moves);
    let grey = select(vec4f(0.0), (*p).wanted * weight, live & reached);
    let dx = x + (corner.x - s.at.x);
    let one = vec4f(1.0);
    return vec4f(dot(h, one), dot(h, dx), dot(h * dx, dx), dot(grey, one));
}

// Sums of h, h dx, h dy, h dx^2, h dx dy, h dy^2, and the change with the grey level, over two rows of the tile.
fn add_part(me: u32, s: Splat, corner: vec2f) {
    let part = me % PARTS;
    var sums: array<f32, 7>;
    for (var t = 0u; t < 8u; t++) {
        let v = pixels_here[8u * me + t];
        let dy = f32(2u * part + t / 4u) + (corner.y - s.at.y);
        sums[0] += v.x;
        sums[1] += v.y;
        sums[2] += v.x * dy;
        sums[3] += v.z;
        sums[4] += v.y * dy;
        sums[5] += v.x * dy * dy;
        sums[6] += v.w;
    }
    for (var k = 0u; k < NUMBERS; k++) {
        parts_here[NUMBERS * me + k] = sums[k];
    }
}

// Writes one number of one footprint's slot: that of a thread's own.
fn write_sum(me: u32, base: u32, count: u32) {
    let own = me / NUMBERS;
    if own >= TOGETHER || base + own >= count {
        return;
    }
    let number = me % NUMBERS;
    var sum = 0.0;
    for (var part = 0u; part < PARTS; part++) {
        sum += parts_here[NUMBERS * (PARTS * own + part) + number];
    }
    slots[NUMBERS * slots_here[base + own] + number] = sum;
}

// Is a pixel of the tile not done?
fn is_unfinished(me: u32, left: vec4f) -> bool {
    if me == 0u {
        atomicStore(&going_on, 0u);
    }
    workgroupBarrier();
    if any(left > vec4f(0.0)) {
        atomicStore(&going_on, 1u);
    }
    workgroupBarrier();
    if me == 0u {
        go_on = atomicLoad(&going_on);
    }
    return workgroupUniformLoad(&go_on) == 1u;
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) me: u32) {
    let corner = tile.xy * TILE;
    let in_tile = vec2u(4u * (me % 4u), me / 4u);
    var p = start_states(corner + in_tile, vec2f(in_tile));
    if me == 0u {
        range_here = ranges[tile.y * frame.across + tile.x];
    }
    let range = workgroupUniformLoad(&range_here);
    var base = range.x;
    for (; base < range.y; base += LOADED) {
        if !is_unfinished(me, p.left) {
            break;
        }
        let count = min(range.y - base, LOADED);
        if me < count {
            let entry = entries[base + me];
            splats_here[me] = splats[entry];
            slots_here[me] = slot_of(places[entry], tile.xy);
        }
        workgroupBarrier();
        for (var k = 0u; k < count; k += TOGETHER) {
            // Behind the last of the list is nothing that is written.
            for (var j = 0u; j < min(TOGETHER, count - k); j++) {
                pixels_here[64u * j + me] = blend_sums(&p, splats_here[k + j], vec2f(corner));
            }
            workgroupBarrier();
            add_part(me, splats_here[min(k + me / PARTS, count - 1u)], vec2f(corner));
            workgroupBarrier();
            write_sum(me, k, count);
        }
    }
    // What is hidden wants nothing.
    for (var i = base + me; i < range.y; i += 64u) {
        let slot = slot_of(places[entries[i]], tile.xy);
        for (var k = 0u; k < NUMBERS; k++) {
            slots[NUMBERS * slot + k] = 0.0;
        }
    }
    store_states(corner + in_tile, p);
}
