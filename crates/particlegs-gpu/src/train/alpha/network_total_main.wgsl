// Adds up the parts of the network's gradient, in their order.

@group(0) @binding(0) var<storage, read> parts: array<f32>;
@group(0) @binding(1) var<storage, read_write> by_network: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= PARAMETERS {
        return;
    }
    var sum = 0.0;
    let count = arrayLength(&parts) / PARAMETERS;
    for (var part = 0u; part < count; part++) {
        sum += parts[PARAMETERS * part + id.x];
    }
    by_network[id.x] = sum;
}
