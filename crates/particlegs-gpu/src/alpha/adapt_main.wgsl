// What the network makes of each Gaussian for a radius and an opacity: core's render::alpha::adapt and render::alpha::network.
// A thread a Gaussian; weights are summed in their order.

// What is asked of the network, and its ranges.
struct Setting {
    // Radius and opacity over the defaults.
    wanted: vec2f,
    // The largest shares by which scales and odds are changed.
    shares: vec2f,
    // The least factor on odds.
    floor: f32,
    count: u32,
}

@group(0) @binding(0) var<uniform> setting: Setting;
// Of each layer the weights, a row an output, then the biases.
@group(0) @binding(1) var<storage, read> network: array<vec4f>;
@group(0) @binding(2) var<storage, read> gaussians: array<f32>;
// Factors on scales and on the odds of opacities.
@group(0) @binding(3) var<storage, read_write> bent: array<vec2f>;

// Where they lie, in fours.
const FIRST_BIAS: u32 = 64u;
const SECOND: u32 = 80u;
const SECOND_BIAS: u32 = 1104u;
const LAST: u32 = 1120u;
const LAST_BIAS: u32 = 1152u;

// Fours of a hidden layer.
const FOURS: u32 = 16u;

// x sigmoid(x); the power is bounded, as infinities need not be kept.
fn silu(x: vec4f) -> vec4f {
    return x / (1.0 + exp(min(-x, vec4f(80.0))));
}

// Without a quotient of infinities.
fn tanh2(x: vec2f) -> vec2f {
    let e = exp(-2.0 * abs(x));
    return sign(x) * (1.0 - e) / (1.0 + e);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + me;
    let n = setting.count;
    if i >= n {
        return;
    }
    let inputs = vec4f(setting.wanted - 1.0, gaussians[i + 14u * n], gaussians[i + 15u * n]);
    var hidden: array<vec4f, 16>;
    for (var k = 0u; k < FOURS; k++) {
        let w = 4u * k;
        let sums = vec4f(
            dot(network[w], inputs),
            dot(network[w + 1u], inputs),
            dot(network[w + 2u], inputs),
            dot(network[w + 3u], inputs),
        );
        hidden[k] = silu(sums + network[FIRST_BIAS + k]);
    }
    var out = network[LAST_BIAS].xy;
    for (var k = 0u; k < FOURS; k++) {
        var sums = network[SECOND_BIAS + k];
        for (var j = 0u; j < FOURS; j++) {
            let w = SECOND + 4u * FOURS * k + j;
            sums += vec4f(
                dot(network[w], hidden[j]),
                dot(network[w + FOURS], hidden[j]),
                dot(network[w + 2u * FOURS], hidden[j]),
                dot(network[w + 3u * FOURS], hidden[j]),
            );
        }
        let value = silu(sums);
        out += vec2f(dot(network[LAST + k], value), dot(network[LAST + FOURS + k], value));
    }
    let factors = setting.wanted * (1.0 + setting.shares * tanh2(out));
    bent[i] = vec2f(factors.x, max(factors.y, setting.floor));
}
