// A pixel's layers to its level, four pixels a thread; rows of the picture go down.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> layers: array<u32>;
@group(0) @binding(2) var<storage, read_write> levels: array<u32>;

fn level_of(layer: u32) -> u32 {
    let front = to_float(layer & 255u);
    let back = to_float(layer >> 8u);
    return to_byte(plus(front, times(back, minus(1.0, front))));
}

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
        let row = view.size.y - 1u - (4u * word + k) / view.size.x;
        let column = (4u * word + k) % view.size.x;
        four |= level_of(layers[row * view.size.x + column]) << (8u * k);
    }
    levels[word] = four;
}
