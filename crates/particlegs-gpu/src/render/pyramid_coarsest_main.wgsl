// The coarsest planes, which are too small to be worth a pass each, by one workgroup: down to the plane that is the target.

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) me: u32) {
    for (var l = frame.level_count - 1u; l > target_plane.x; l--) {
        let fine = frame.levels[l - 1u];
        let is_sum = l == frame.level_count - 1u;
        for (var p = me; p < fine.width * fine.rows; p += 256u) {
            let at = vec2u(p % fine.width, p / fine.width);
            var own = depth_at(l - 1u, at.x, at.y, true);
            for (var j = 0u; j < 8u; j++) {
                var line = 0.0;
                for (var k = 0u; k < 8u; k++) {
                    line += weight(at.x % 2u == 0u, k)
                        * depth_at(l, first_sample(at.x) + k, first_sample(at.y) + j, is_sum);
                }
                own += weight(at.y % 2u == 0u, j) * line;
            }
            set_depth(fine, p, own);
        }
        storageBarrier();
        workgroupBarrier();
    }
}
