// Sums of the roots of Adam's mean squares: place, shape, count.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> averages: array<f32>;
@group(0) @binding(2) var<storage, read_write> parts: array<vec4f>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    var own = vec3f(0.0);
    for (var i = 256u * group.x + me; i < step.count; i += 256u * PARTS) {
        for (var k = 0u; k < 10u; k++) {
            own[kind_of(k)] += sqrt(averages[(10u + k) * step.count + i]);
        }
    }
    let one = sum_of(me, own.xy);
    let other = sum_of(me, vec2f(own.z, 0.0));
    if me == 0u {
        parts[group.x] = vec4f(one, other);
    }
}
