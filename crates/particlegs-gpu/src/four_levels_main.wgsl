// A word of a picture a thread: the grey levels of four pixels. `pixel_count` and `level_at` are of the kernel that this ends,
// and so is `picture`: four levels a word, row after row.

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let word = (group.y * groups.x + group.x) * 64u + me;
    let pixels = pixel_count();
    if 4u * word >= pixels {
        return;
    }
    var four = 0u;
    for (var k = 0u; k < 4u && 4u * word + k < pixels; k++) {
        four |= level_at(4u * word + k) << (8u * k);
    }
    picture[word] = four;
}
