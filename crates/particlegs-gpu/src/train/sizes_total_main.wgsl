// What is added to the root in Adam's division: place, shape, count.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> parts: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> epsilon: vec4f;

const LEAST_EPSILON: f32 = 1e-15;

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) me: u32) {
    if me > 0u {
        return;
    }
    var sum = vec4f(0.0);
    for (var part = 0u; part < PARTS; part++) {
        sum += parts[part];
    }
    epsilon = max(step.epsilon * sum / (f32(step.count) * vec4f(3.0, 6.0, 1.0, 1.0)), vec4f(LEAST_EPSILON));
}
