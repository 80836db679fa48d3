// What a step knows (mod.rs has the same record), and what is moved: a column a number of 3 of the place, 3 logarithms
// of scales, 4 of the quaternion, the logit of the opacity, and the grey level as (grey - 0.5) / SH0.

struct Step {
    // Adam's rates over what corrects them, and what corrects its squares: place, scales, quaternion, opacity.
    rate: vec4f,
    unroot: vec4f,
    // The same of the grey level and the network.
    rate_more: vec2f,
    unroot_more: vec2f,
    // Decays of Adam's means.
    beta: vec2f,
    // Half the whole picture's pixels across and down.
    half: vec2f,
    // Radius and opacity over the defaults, and the largest shares by which the network changes scales and odds.
    wanted: vec2f,
    shares: vec2f,
    // The least factor on odds.
    floor: f32,
    // Twice the weight of what holds the network to the identity, over the Gaussians.
    hold: f32,
    // Largest norm of the network's gradient; 0 = any.
    clip: f32,
    // Gaussians.
    count: u32,
}

// Columns.
const SCALE: u32 = 3u;
const ROTATION: u32 = 6u;
const LOGIT: u32 = 10u;
const FEATURE: u32 = 11u;
const NUMBERS: u32 = 12u;
// 1 / (2 sqrt pi).
const SH0: f32 = 0.2820947917738781;
// What the network reads: mean logarithm of scales, and logit, each less the first over the second.
const OWN_SCALE: vec2f = vec2f(-8.0, 2.0);
const OWN_LOGIT: vec2f = vec2f(-3.0, 4.0);

fn is_finite(v: f32) -> bool {
    return abs(v) < 3e38;
}

// The axes of a quaternion of length 1, as columns.
fn axes_of(q: vec4f) -> mat3x3f {
    let w = q.x;
    let v = q.yzw;
    return mat3x3f(
        vec3f(1.0 - 2.0 * (v.y * v.y + v.z * v.z), 2.0 * (v.x * v.y + w * v.z), 2.0 * (v.x * v.z - w * v.y)),
        vec3f(2.0 * (v.x * v.y - w * v.z), 1.0 - 2.0 * (v.x * v.x + v.z * v.z), 2.0 * (v.y * v.z + w * v.x)),
        vec3f(2.0 * (v.x * v.z + w * v.y), 2.0 * (v.y * v.z - w * v.x), 1.0 - 2.0 * (v.x * v.x + v.y * v.y)),
    );
}
