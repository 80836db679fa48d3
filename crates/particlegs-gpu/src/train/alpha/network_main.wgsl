// The gradient of the network, and what it adds to that of scales and opacities: particlegs-train's alpha::network. A
// thread a unit of the hidden layers, four Gaussians at a time; sums over a workgroup's Gaussians in their order.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> network: array<f32>;
@group(0) @binding(2) var<storage, read> gaussians: array<f32>;
@group(0) @binding(3) var<storage, read> by_output: array<vec2f>;
@group(0) @binding(4) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(5) var<storage, read_write> parts: array<f32>;

var<workgroup> first_here: array<vec4f, 64>;
var<workgroup> second_here: array<vec4f, 64>;
var<workgroup> back_here: array<vec4f, 64>;
var<workgroup> last_here: array<vec4f, 2>;

// x sigmoid(x), and its slope.
fn silu(x: vec4f) -> array<vec4f, 2> {
    let s = 1.0 / (1.0 + exp(min(-x, vec4f(80.0))));
    return array<vec4f, 2>(x * s, s * (1.0 + x * (1.0 - s)));
}

// Without a quotient of infinities.
fn squared_tanh(x: vec4f) -> vec4f {
    let e = exp(-2.0 * abs(x));
    let t = (1.0 - e) / (1.0 + e);
    return t * t;
}

fn sum_of(v: vec4f) -> f32 {
    return dot(v, vec4f(1.0));
}

// Four Gaussians' input or change; 0 behind the last.
fn inputs(column: u32, base: u32) -> vec4f {
    var v = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        if base + k < step.count {
            v[k] = gaussians[column * step.count + base + k];
        }
    }
    return v;
}

fn wants(output: u32, base: u32) -> vec4f {
    var v = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        if base + k < step.count {
            v[k] = by_output[base + k][output];
        }
    }
    return v;
}

// What the network's last two inputs add to a Gaussian's numbers.
fn add_inputs(input: u32, base: u32) {
    var by = vec4f(0.0);
    for (var j = 0u; j < HIDDEN; j++) {
        by += network[4u * j + 2u + input] * back_here[j];
    }
    let n = step.count;
    for (var k = 0u; k < 4u && base + k < n; k++) {
        if input == 1u {
            gradient[LOGIT * n + base + k] += by[k] / OWN_LOGIT.y;
        } else {
            for (var axis = 0u; axis < 3u; axis++) {
                gradient[(SCALE + axis) * n + base + k] += by[k] / (3.0 * OWN_SCALE.y);
            }
        }
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    // Sums of this unit's weights and biases; of the last bias, that of output `me`.
    var first = vec4f(0.0);
    var second: array<f32, 64>;
    var last = vec2f(0.0);
    var bias = vec3f(0.0);
    let asked = step.wanted - 1.0;
    let own_last = vec2f(network[LAST + me], network[LAST + HIDDEN + me]);
    for (var base = 4u * group.x; base < step.count; base += 4u * groups.x) {
        let scales = inputs(14u, base);
        let logits = inputs(15u, base);
        let w = vec4f(network[4u * me], network[4u * me + 1u], network[4u * me + 2u], network[4u * me + 3u]);
        let a = silu(network[FIRST_BIAS + me] + dot(w.xy, asked) + w.z * scales + w.w * logits);
        first_here[me] = a[0];
        workgroupBarrier();
        var sum = vec4f(network[SECOND_BIAS + me]);
        for (var k = 0u; k < HIDDEN; k++) {
            sum += network[SECOND + HIDDEN * me + k] * first_here[k];
        }
        let b = silu(sum);
        second_here[me] = b[0];
        workgroupBarrier();
        if me < 2u {
            var out = vec4f(network[LAST_BIAS + me]);
            for (var k = 0u; k < HIDDEN; k++) {
                out += network[LAST + HIDDEN * me + k] * second_here[k];
            }
            let by = wants(me, base) * (1.0 - squared_tanh(out));
            last_here[me] = by;
            bias.z += sum_of(by);
        }
        workgroupBarrier();
        last += vec2f(dot(last_here[0], b[0]), dot(last_here[1], b[0]));
        let by_second = (own_last.x * last_here[0] + own_last.y * last_here[1]) * b[1];
        bias.y += sum_of(by_second);
        for (var k = 0u; k < HIDDEN; k++) {
            second[k] += dot(by_second, first_here[k]);
        }
        second_here[me] = by_second;
        workgroupBarrier();
        var by_first = vec4f(0.0);
        for (var k = 0u; k < HIDDEN; k++) {
            by_first += network[SECOND + HIDDEN * k + me] * second_here[k];
        }
        by_first *= a[1];
        bias.x += sum_of(by_first);
        first += vec4f(asked * sum_of(by_first), dot(by_first, scales), dot(by_first, logits));
        back_here[me] = by_first;
        workgroupBarrier();
        if me < 2u {
            add_inputs(me, base);
        }
    }
    let at = PARAMETERS * group.x;
    for (var k = 0u; k < 4u; k++) {
        parts[at + 4u * me + k] = first[k];
    }
    for (var k = 0u; k < HIDDEN; k++) {
        parts[at + SECOND + HIDDEN * me + k] = second[k];
    }
    parts[at + FIRST_BIAS + me] = bias.x;
    parts[at + SECOND_BIAS + me] = bias.y;
    parts[at + LAST + me] = last.x;
    parts[at + LAST + HIDDEN + me] = last.y;
    if me < 2u {
        parts[at + LAST_BIAS + me] = bias.z;
    }
}
