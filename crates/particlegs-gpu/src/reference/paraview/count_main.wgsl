// How many pixels the boxes of the quads of every 64 particles have.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

var<workgroup> here: atomic<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let own = group.y * groups.x + group.x;
    let quad = quad_at(own * THREADS + me);
    atomicAdd(&here, quad.extent.x * quad.extent.y);
    workgroupBarrier();
    if me == 0u && own * THREADS < view.count {
        counts[own] = atomicLoad(&here);
    }
}
