// The picture after FXAA, four pixels a thread.

@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let word = (group.y * groups.x + group.x) * 64u + me;
    let pixels = view.size.x * view.size.y;
    if 4u * word >= pixels {
        return;
    }
    var four = 0u;
    for (var k = 0u; k < 4u && 4u * word + k < pixels; k++) {
        let at = 4u * word + k;
        four |= filtered(vec2i(vec2u(at % view.size.x, at / view.size.x))) << (8u * k);
    }
    picture[word] = four;
}
