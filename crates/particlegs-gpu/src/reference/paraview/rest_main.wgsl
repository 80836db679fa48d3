// Blends fragments that the peels left, sorted by pixel and in the order of their particles: the thread of a pixel's first
// one goes through all of them.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> keys: array<u32>;
@group(0) @binding(2) var<storage, read_write> layers: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let first = (group.y * groups.x + group.x) * 64u + me;
    if first >= view.count {
        return;
    }
    let pixel = keys[first] >> 8u;
    if first > 0u && (keys[first - 1u] >> 8u) == pixel {
        return;
    }
    let at = (view.first - view.strip.x) * view.size.x + pixel;
    var back = layers[at] >> 8u;
    for (var k = first; k < view.count && (keys[k] >> 8u) == pixel; k++) {
        back = over_back(back, keys[k] & 255u);
    }
    layers[at] = (layers[at] & 255u) | (back << 8u);
}
