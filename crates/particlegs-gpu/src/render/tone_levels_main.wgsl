// Levels of all pixels into the plane, for those that are blurred.
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) me: u32) {
    let pixel = (group.y * groups.x + group.x) * 64u + me;
    if pixel >= frame.size.x * frame.size.y {
        return;
    }
    let x = pixel % frame.size.x;
    let y = pixel / frame.size.x;
    planes[(y + PAD) * frame.levels[0].width + x + PAD] = bitcast<u32>(level_of(x, y));
}
