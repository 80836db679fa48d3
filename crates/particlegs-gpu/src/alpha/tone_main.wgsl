// Brightness to grey levels, four pixels a thread: what core's tone makes of the depth that looks as bright.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> sums: array<f32>;
// Four levels a word, row after row.
@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let word = (group.y * groups.x + group.x) * 64u + me;
    let pixels = frame.size.x * frame.size.y;
    if 4u * word >= pixels {
        return;
    }
    var four = 0u;
    for (var k = 0u; k < 4u && 4u * word + k < pixels; k++) {
        let level = round(255.0 * clamp(sums[4u * word + k], 0.0, frame.brightest));
        four |= u32(level) << (8u * k);
    }
    picture[word] = four;
}
