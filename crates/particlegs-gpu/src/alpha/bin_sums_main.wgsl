// How many tiles the footprints of each block of 64 touch, in the order of their depth: what lists will hold.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> touched_by: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> sums: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let block = group.y * groups.x + group.x;
    let rank = block * THREADS + me;
    var own = 0u;
    if rank < slab.gaussians {
        own = number(touched_by[order[rank]]);
    }
    running_sum(0u, me, own);
    if me == 0u && rank < slab.gaussians {
        sums[block] = ends[THREADS - 1u];
    }
}
