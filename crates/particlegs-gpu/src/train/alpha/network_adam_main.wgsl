// Adam's step of the network, its gradient cut to the largest norm: particlegs-train's alpha::steps. One workgroup.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> by_network: array<f32>;
@group(0) @binding(2) var<storage, read_write> network: array<f32>;
// Means of gradients, then of their squares.
@group(0) @binding(3) var<storage, read_write> averages: array<f32>;
@group(0) @binding(4) var<storage, read_write> faults: Faults;

// PyTorch's default.
const EPSILON: f32 = 1e-8;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) me: u32) {
    var own = 0.0;
    for (var k = me; k < PARAMETERS; k += 256u) {
        own += by_network[k] * by_network[k];
    }
    let norm = sqrt(sum_of(me, vec2f(own, 0.0)).x);
    if !is_finite(norm) {
        if me == 0u {
            faults.network = 1u;
        }
        return;
    }
    let factor = select(1.0, step.clip / norm, step.clip > 0.0 && norm > step.clip);
    for (var k = me; k < PARAMETERS; k += 256u) {
        let g = factor * by_network[k];
        let first = step.beta.x * averages[k] + (1.0 - step.beta.x) * g;
        let second = step.beta.y * averages[PARAMETERS + k] + (1.0 - step.beta.y) * g * g;
        averages[k] = first;
        averages[PARAMETERS + k] = second;
        network[k] -= step.rate_more.y * first / (sqrt(second * step.unroot_more.y) + EPSILON);
    }
}
