// Where the slots of each footprint of a slab lie: in the order of entries before they are sorted by tile (bin_fill_main.wgsl).

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> touched_by: array<vec2u>;
// The first entry of each block among those of its slab.
@group(0) @binding(4) var<storage, read> starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> places: array<vec2u>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let place = group.y * groups.x + group.x;
    let block = slab.first + place;
    let rank = block * THREADS + me;
    let inside = place < slab.blocks && rank < slab.gaussians;
    var touched = NO_TILES;
    if inside {
        touched = touched_by[order[rank]];
    }
    running_sum(0u, me, number(touched));
    if inside {
        let first = starts[block] + ends[me] - number(touched);
        let columns = extent(touched).x;
        let corner = touched & vec2u(0xffffu);
        places[order[rank]] = vec2u(first - corner.y * columns - corner.x, columns);
    }
}
