// Adds strokes of a field to rows of a plane, a tile a workgroup and a pixel a thread, in their order: core's render::field_strokes.

@group(0) @binding(0) var<uniform> strip: Strip;
@group(0) @binding(1) var<storage, read> strokes: array<FieldSplat>;
// Where the list of each tile begins, and the end of all.
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> lists: array<u32>;
@group(0) @binding(4) var<storage, read_write> sums: array<f32>;

// Rows of a plane.
struct Strip {
    // Pixels across with the pads; the number of the first row, and how many there are.
    width: u32,
    first: u32,
    rows: u32,
    // Floats from row to row of one sum, and the number of sums, of which each row has one behind the other.
    stride: u32,
    number: u32,
    // Of core's SumKind: 0 values, 1 exponentials, 2 values and their squares.
    kind: u32,
    pad0: u32,
    pad1: u32,
}

// As core has it.
struct FieldSplat {
    raster: RasterSplat,
    value: f32,
    tilt_x: f32,
    tilt_y: f32,
    variance: f32,
    least: f32,
    largest: f32,
    is_cut: u32,
    near: f32,
    far: f32,
    slab_tilt_x: f32,
    slab_tilt_y: f32,
    slope: f32,
}

const EXPONENTIAL: u32 = 1u;
// Ends of a slab that are closer are taken by series; beyond the farthest deviation nothing is left.
const THIN: f32 = 0.1;
const FARTHEST: f32 = 12.0;

// What a pixel gets: the weight, and that times the value and times its square.
fn terms(stroke: u32, pixel: vec2f) -> vec3f {
    let raster = strokes[stroke].raster;
    let dy = pixel.y - raster.y;
    let dx = pixel.x - (raster.x + raster.slope * dy);
    let power = dx * dx * raster.along + raster.down * (dy * dy);
    if !(power >= raster.end) {
        return vec3f(0.0);
    }
    // Read by those that it touches alone.
    let s = strokes[stroke];
    let weight = exp2(power) * raster.peak;
    let x = dx + raster.slope * dy;
    let value = x * s.tilt_x + (dy * s.tilt_y + s.value);
    if s.is_cut == 0u {
        if strip.kind == EXPONENTIAL {
            return weight * vec3f(1.0, exp2(clamp(value, s.least, s.largest)), 0.0);
        }
        return weight * vec3f(1.0, value, value * value + s.variance);
    }
    let moved = x * s.slab_tilt_x + dy * s.slab_tilt_y;
    let m = moments(s, moved);
    if strip.kind == EXPONENTIAL {
        let mean = moments(s, moved - s.slope).x * exp2(clamp(value, -120.0, 120.0));
        return weight * vec3f(m.x, clamp(mean, m.x * exp2(s.least), m.x * exp2(s.largest)), 0.0);
    }
    let changed = value * m.y * 2.0 * s.slope + m.z * s.slope * s.slope;
    return weight * vec3f(m.x, value * m.x + m.y * s.slope, (value * value + s.variance) * m.x + changed);
}

// A standard normal distribution between the slab's ends, moved by so much: its mass, and the mass times the mean and times
// what the mean square is more than 1.
fn moments(s: FieldSplat, moved: f32) -> vec3f {
    let width = s.far - s.near;
    if width < THIN {
        let z = clamp(moved + (s.near + 0.5 * width), -FARTHEST, FARTHEST);
        let mass = density(z) * width;
        let curve = width * width / 24.0;
        let square = z * z;
        return mass * vec3f(
            (square - 1.0) * curve + 1.0,
            z * ((square - 3.0) * curve + 1.0),
            (square - 1.0) + ((square - 6.0) * square + 3.0) * curve,
        );
    }
    let low = clamp(moved + s.near, -FARTHEST, FARTHEST);
    let high = clamp(moved + s.far, -FARTHEST, FARTHEST);
    let at_low = density(low);
    let at_high = density(high);
    let low_tail = at_low * mills(abs(low));
    let high_tail = at_high * mills(abs(high));
    // The share below an end is a step from 0 to 1 and a tail, which keeps its digits.
    let steps = select(0.0, 1.0, high > 0.0) - select(0.0, 1.0, low > 0.0);
    let share = steps + (select(high_tail, -high_tail, high > 0.0) - select(low_tail, -low_tail, low > 0.0));
    return vec3f(share, at_low - at_high, low * at_low - high * at_high);
}

// The density of a standard normal distribution.
fn density(z: f32) -> f32 {
    return exp2(z * z * -0.7213475) * 0.3989423;
}

// The share of a standard normal distribution beyond z >= 0 over its density there.
fn mills(z: f32) -> f32 {
    let t = 1.0 / (z * 0.36 + 1.0);
    var p = t * 0.12017296 - 0.4581986;
    p = p * t + 0.46392937;
    p = p * t + 0.05940802;
    p = p * t + 0.35284453;
    p = p * t + 0.3548889;
    return (p * t + 0.36026976) * t;
}

@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) me: vec3u,
) {
    let pixel = 8u * group.xy + me.xy;
    if pixel.x >= strip.width || pixel.y >= strip.rows {
        return;
    }
    let tile = group.y * groups.x + group.x;
    let at = pixel.y * strip.number * strip.stride + pixel.x;
    // Strokes come in several dispatches: each goes on from the sums of the last.
    var all = vec3f(0.0);
    for (var k = 0u; k < strip.number; k++) {
        all[k] = sums[at + k * strip.stride];
    }
    for (var entry = starts[tile]; entry < starts[tile + 1u]; entry++) {
        all += terms(lists[entry], vec2f(f32(pixel.x), f32(pixel.y + strip.first)));
    }
    for (var k = 0u; k < strip.number; k++) {
        sums[at + k * strip.stride] = all[k];
    }
}
