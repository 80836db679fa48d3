// From what is moved to what pictures are drawn of (alpha/gaussians.rs has the same columns): particlegs-train's
// alpha::parameters::GaussianParameters::gaussian.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> trained: array<f32>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<u32>;

// Beyond it places do not fit (alpha/fixed.rs).
const FARTHEST: f32 = 2097152.0;
// Odds against an opacity that is never seen.
const NEVER: f32 = 3e38;

// A place as a whole number of 2^-40.
fn place(v: f32) -> vec2u {
    let bits = bitcast<u32>(abs(v));
    let power = bits >> 23u;
    let digits = (bits & 0x7fffffu) | 0x800000u;
    var size = vec2u(0u);
    if power >= 142u {
        size = vec2u(0u, digits << (power - 142u));
    } else if power > 110u {
        size = vec2u(digits << (power - 110u), digits >> (142u - power));
    } else if power == 110u {
        size = vec2u(digits, 0u);
    } else if power >= 86u {
        size = vec2u((digits + (1u << (109u - power))) >> (110u - power), 0u);
    }
    return negate_if(size, v < 0.0);
}

// The lower triangle L of which L L^T is the covariance (xx, yx, yy, zx, zy, zz): rows of the axes times their scales, one
// after the other made upright to those before, so that nothing is squared.
fn triangle(m: mat3x3f) -> array<f32, 6> {
    let rows = transpose(m);
    let xx = length(rows[0]);
    let x = rows[0] / max(xx, 1e-38);
    let yx = dot(rows[1], x);
    let rest_y = rows[1] - yx * x;
    let yy = length(rest_y);
    let y = rest_y / max(yy, 1e-38);
    let zx = dot(rows[2], x);
    let rest_z = rows[2] - zx * x;
    let zy = dot(rest_z, y);
    return array<f32, 6>(xx, yx, yy, zx, zy, length(rest_z - zy * y));
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
    var own: array<f32, 12>;
    var all_finite = true;
    for (var k = 0u; k < NUMBERS; k++) {
        own[k] = trained[k * n + i];
        all_finite = all_finite && is_finite(own[k]);
    }
    let q = vec4f(own[6], own[7], own[8], own[9]);
    let scales = exp(vec3f(own[3], own[4], own[5]));
    let axes = axes_of(q / length(q));
    let l = triangle(mat3x3f(axes[0] * scales.x, axes[1] * scales.y, axes[2] * scales.z));
    var drawn = all_finite;
    for (var k = 0u; k < 6u; k++) {
        drawn = drawn && is_finite(l[k]);
    }
    for (var k = 0u; k < 3u; k++) {
        drawn = drawn && abs(own[k]) < FARTHEST;
    }
    for (var k = 0u; k < 3u; k++) {
        let at = select(vec2u(0u), place(own[k]), drawn);
        gaussians[2u * k * n + i] = at.x;
        gaussians[(2u * k + 1u) * n + i] = at.y;
    }
    for (var k = 0u; k < 6u; k++) {
        gaussians[(6u + k) * n + i] = bitcast<u32>(select(0.0, l[k], drawn));
    }
    let odds = select(NEVER, min(exp(-own[LOGIT]), NEVER), drawn);
    gaussians[12u * n + i] = bitcast<u32>(odds);
    gaussians[13u * n + i] = bitcast<u32>(select(0.0, max(0.5 + SH0 * own[FEATURE], 0.0), drawn));
    let scale = ((own[3] + own[4] + own[5]) / 3.0 - OWN_SCALE.x) / OWN_SCALE.y;
    let logit = (own[LOGIT] - OWN_LOGIT.x) / OWN_LOGIT.y;
    gaussians[14u * n + i] = bitcast<u32>(select(0.0, scale, all_finite));
    gaussians[15u * n + i] = bitcast<u32>(select(0.0, logit, all_finite));
}
