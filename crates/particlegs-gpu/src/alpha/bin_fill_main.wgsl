// The entries of a slab's lists, in the order of depth: the tile, and the footprint.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> touched_by: array<vec2u>;
// The first entry of each block among those of its slab.
@group(0) @binding(4) var<storage, read> starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> tiles: array<u32>;
@group(0) @binding(6) var<storage, read_write> entries: array<u32>;

var<workgroup> touched_here: array<vec2u, 64>;
var<workgroup> footprints_here: array<u32, 64>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let place = group.y * groups.x + group.x;
    let block = slab.first + place;
    let rank = block * THREADS + me;
    var own = 0u;
    if place < slab.blocks && rank < slab.gaussians {
        footprints_here[me] = order[rank];
        touched_here[me] = touched_by[order[rank]];
        own = number(touched_here[me]);
    }
    running_sum(0u, me, own);
    let all = workgroupUniformLoad(&ends[THREADS - 1u]);
    for (var p = me; p < all; p += THREADS) {
        let who = owner(0u, p);
        let at = starts[block] + p;
        tiles[at] = tile_at(touched_here[who], within(0u, who, p), frame.across);
        entries[at] = footprints_here[who];
    }
}
