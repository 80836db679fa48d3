// Counts the pixels that splats reach: how much work they are, so that no dispatch takes long.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> positions: array<f32>;
// Thousands of pixels, in two words.
@group(0) @binding(2) var<storage, read_write> work: array<atomic<u32>>;

var<workgroup> here: atomic<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + me;
    if i < view.count {
        let n = view.count;
        let s = splat_of(view, vec3f(positions[i], positions[i + n], positions[i + 2u * n]));
        if reach(s).x > 0.0 && !is_small(s) {
            let sides = min(2.0 * reach(s) + 1.0, vec2f(view.size));
            atomicAdd(&here, u32(ceil(sides.x * sides.y / 1024.0)));
        }
    }
    workgroupBarrier();
    if me == 0u {
        let all = atomicLoad(&here);
        if all > 0u {
            let before = atomicAdd(&work[0], all);
            if before > 0xffffffffu - all {
                atomicAdd(&work[1], 1u);
            }
        }
    }
}
