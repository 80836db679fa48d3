// Rounded levels, four pixels a thread.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) me: u32) {
    let word = (group.y * groups.x + group.x) * 64u + me;
    let pixels = frame.size.x * frame.size.y;
    if 4u * word >= pixels {
        return;
    }
    var four = 0u;
    for (var k = 0u; k < 4u && 4u * word + k < pixels; k++) {
        let x = (4u * word + k) % frame.size.x;
        let y = (4u * word + k) / frame.size.x;
        var level = 0.0;
        if look.kind == 2u {
            level = blurred(x, y);
        } else {
            level = level_of(x, y);
        }
        four |= u32(clamp(round(level), 0.0, 255.0)) << (8u * k);
    }
    picture[word] = four;
}
