// From what a footprint's pixels want to what its Gaussian's numbers want, and what the network is to give for it:
// particlegs-train's alpha::chain and alpha::pass.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> step: Step;
@group(0) @binding(2) var<storage, read> gaussians: array<u32>;
@group(0) @binding(3) var<storage, read> bent: array<vec2f>;
@group(0) @binding(4) var<storage, read> trained: array<f32>;
@group(0) @binding(5) var<storage, read> touched_by: array<vec2u>;
@group(0) @binding(6) var<storage, read> sums: array<f32>;
@group(0) @binding(7) var<storage, read_write> gradient: array<f32>;
// The change with the network's outputs.
@group(0) @binding(8) var<storage, read_write> by_output: array<vec2f>;
// Sizes of changes with the centre on the picture, in half pictures, and in how many pictures it was seen.
@group(0) @binding(9) var<storage, read_write> screen: array<vec2f>;

// Changes with a Gaussian's numbers, and with the factors of the network.
struct Slopes {
    place: vec3f,
    scales: vec3f,
    rotation: vec4f,
    logit: f32,
    feature: f32,
    by_factors: vec2f,
    on_screen: f32,
}

// The footprint's shape: covariance xx, xy, yy before it is widened, and the inverse of the widened.
struct FootprintShape {
    sharp: vec3f,
    inverse: vec3f,
    // What a step in depth moves on the picture: the slopes at which shapes are taken, and whether they were cut off.
    slope: vec2f,
    cut: vec2<bool>,
    sharp_det: f32,
    wide_det: f32,
}

fn footprint_shape(g: GreyCameraGaussian) -> FootprintShape {
    let toward = g.mean.xy / g.mean.z;
    var p: FootprintShape;
    p.slope = clamp(toward, -frame.guard, frame.guard);
    p.cut = abs(toward) > frame.guard;
    let s = g.slope - p.slope;
    let unit = frame.focal / g.mean.z;
    let unit2 = unit * unit;
    let xx = unit2 * (g.across + g.lean * g.lean * g.down + s.x * s.x * g.depth);
    let xy = unit2 * (g.lean * g.down + s.x * s.y * g.depth);
    let yy = unit2 * (g.down + s.y * s.y * g.depth);
    let skew = s.x - g.lean * s.y;
    let across = unit2 * g.across;
    p.sharp = vec3f(xx, xy, yy);
    p.sharp_det = across * (unit2 * g.down) + (unit2 * g.depth) * (across * s.y * s.y + unit2 * g.down * skew * skew);
    p.wide_det = p.sharp_det + frame.low_pass * (xx + yy) + frame.low_pass * frame.low_pass;
    p.inverse = vec3f(yy + frame.low_pass, -xy, xx + frame.low_pass) / p.wide_det;
    return p;
}

// Changes with the covariance before widening: xx, xy (both of the pair) and yy. `second` are the sums of h times dx^2,
// dx dy, dy^2.
fn shape_gradient(p: FootprintShape, second: vec3f, sum: f32) -> vec3f {
    let k = p.inverse;
    let g = -0.5 * second;
    let r = vec4f(k.x * g.x + k.y * g.y, k.x * g.y + k.y * g.z, k.y * g.x + k.z * g.y, k.y * g.y + k.z * g.z);
    var by = -vec3f(r.x * k.x + r.y * k.y, 2.0 * (r.x * k.y + r.y * k.z), r.z * k.y + r.w * k.z);
    if p.sharp_det > frame.least_ratio * p.wide_det {
        // The logarithm of the compensation is half of the difference of those of the determinants.
        let before = vec3f(p.sharp.z, -2.0 * p.sharp.y, p.sharp.x) / p.sharp_det;
        by += 0.5 * sum * (before - vec3f(k.x, 2.0 * k.y, k.z));
    }
    return by;
}

// Changes with a quaternion's numbers, from those with its matrix's columns.
fn quaternion_gradient(q: vec4f, d: mat3x3f) -> vec4f {
    let w = q.x;
    let v = q.yzw;
    let plus = vec3f(d[1][0] + d[0][1], d[2][0] + d[0][2], d[2][1] + d[1][2]);
    let minus = vec3f(d[0][1] - d[1][0], d[0][2] - d[2][0], d[1][2] - d[2][1]);
    return 2.0 * vec4f(
        v.z * minus.x - v.y * minus.y + v.x * minus.z,
        v.y * plus.x + v.z * plus.y + w * minus.z - 2.0 * v.x * (d[1][1] + d[2][2]),
        v.x * plus.x + v.z * plus.z - w * minus.y - 2.0 * v.y * (d[0][0] + d[2][2]),
        v.x * plus.y + v.y * plus.z + w * minus.x - 2.0 * v.z * (d[0][0] + d[1][1]),
    );
}

fn chain(i: u32, n: u32) -> Slopes {
    let g = camera_gaussian(i, n);
    let p = footprint_shape(g);
    let factors = bent[i];
    let sum = sums[i];
    let first = vec2f(sums[n + i], sums[2u * n + i]);
    let second = vec3f(sums[3u * n + i], sums[4u * n + i], sums[5u * n + i]);
    let at = vec2f(dot(p.inverse.xy, first), dot(p.inverse.yz, first));
    let h = shape_gradient(p, second, sum);
    // What a step of the place does to the centre in pixels.
    let unit = frame.focal / g.mean.z;
    let rows = array<vec3f, 2>(
        unit * (frame.right.xyz - p.slope.x * frame.forward.xyz),
        unit * (frame.down.xyz - p.slope.y * frame.forward.xyz),
    );
    let q = vec4f(trained[6u * n + i], trained[7u * n + i], trained[8u * n + i], trained[9u * n + i]);
    let norm = length(q);
    let axes = axes_of(q / norm);
    var out: Slopes;
    // Along each axis: its ends on the picture, and what moves them.
    var by_slope = vec2f(0.0);
    var by_axes: mat3x3f;
    for (var k = 0u; k < 3u; k++) {
        let scale = factors.x * exp(trained[(SCALE + k) * n + i]);
        let axis = scale * axes[k];
        let end = vec2f(dot(rows[0], axis), dot(rows[1], axis));
        let by_end = vec2f(h.x * end.x + 0.5 * h.y * end.y, 0.5 * h.y * end.x + h.z * end.y);
        out.scales[k] = 2.0 * dot(end, by_end);
        by_slope -= 2.0 * dot(axis, frame.forward.xyz) * by_end;
        by_axes[k] = 2.0 * scale * (by_end.x * rows[0] + by_end.y * rows[1]);
    }
    by_slope = select(by_slope * (unit / g.mean.z), vec2f(0.0), p.cut);
    let by_depth = -(out.scales.x + out.scales.y + out.scales.z) / g.mean.z
        - unit * dot(at, g.mean.xy) / g.mean.z - dot(by_slope, p.slope);
    let by_place = vec3f(unit * at + by_slope, by_depth);
    out.place = frame.right.xyz * by_place.x + frame.down.xyz * by_place.y + frame.forward.xyz * by_place.z;
    let by_q = quaternion_gradient(q / norm, by_axes);
    // Length does not matter: what points along it goes.
    out.rotation = (by_q - dot(by_q, q / norm) * (q / norm)) / norm;
    let odds = number_of(i, n, 12u) / factors.y;
    out.logit = sum * (odds / (1.0 + odds));
    out.feature = select(0.0, SH0 * sums[6u * n + i], 0.5 + SH0 * trained[FEATURE * n + i] > 0.0);
    out.by_factors = vec2f((out.scales.x + out.scales.y + out.scales.z) / factors.x, out.logit / factors.y);
    out.on_screen = length(at * step.half);
    return out;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + me;
    let n = step.count;
    if i >= n {
        return;
    }
    var s: Slopes;
    if number(touched_by[i]) > 0u {
        s = chain(i, n);
        if is_finite(s.on_screen) {
            screen[i] += vec2f(s.on_screen, 1.0);
        }
    }
    for (var k = 0u; k < 3u; k++) {
        gradient[k * n + i] = s.place[k];
        gradient[(SCALE + k) * n + i] = s.scales[k];
    }
    for (var k = 0u; k < 4u; k++) {
        gradient[(ROTATION + k) * n + i] = s.rotation[k];
    }
    gradient[LOGIT * n + i] = s.logit;
    gradient[FEATURE * n + i] = s.feature;
    let factors = bent[i];
    var by = s.by_factors + step.hold * (factors - step.wanted);
    if factors.y <= step.floor {
        by.y = 0.0;
    }
    by *= step.wanted * step.shares;
    by_output[i] = select(vec2f(0.0), by, is_finite(by.x) && is_finite(by.y));
}
