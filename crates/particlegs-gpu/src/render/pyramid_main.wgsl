// One plane, 16 x 16 pixels a workgroup: the coarser plane's pixels around them, down first, then across.

var<workgroup> coarse: array<f32, 256>;
var<workgroup> lines: array<f32, 256>;

@compute @workgroup_size(16, 16)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) me: vec3u) {
    let fine = frame.levels[target_plane.x];
    // A workgroup's place is a multiple of 16: of 8 in the coarser plane.
    let corner = group.xy * 8u;
    coarse[me.y * 16u + me.x] = depth_at(target_plane.x + 1u, corner.x + me.x, corner.y + me.y, target_plane.y == 1u);
    workgroupBarrier();
    // Fine row me.y, coarse column me.x.
    var line = 0.0;
    for (var k = 0u; k < 8u; k++) {
        line += weight(me.y % 2u == 0u, k) * coarse[(first_sample(me.y) + k) * 16u + me.x];
    }
    lines[me.y * 16u + me.x] = line;
    workgroupBarrier();
    let at = group.xy * 16u + me.xy;
    if at.x >= fine.width || at.y >= fine.rows {
        return;
    }
    var own = depth_at(target_plane.x, at.x, at.y, true);
    for (var k = 0u; k < 8u; k++) {
        own += weight(me.x % 2u == 0u, k) * lines[me.y * 16u + first_sample(me.x) + k];
    }
    set_depth(fine, at.y * fine.width + at.x, own);
}
