// Where each tile's entries begin and end among those that are sorted by tile; nothing is written of tiles without.

@group(0) @binding(0) var<uniform> slab: Slab;
@group(0) @binding(1) var<storage, read> tiles: array<u32>;
@group(0) @binding(2) var<storage, read_write> ranges: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + me;
    if i >= slab.entries {
        return;
    }
    let tile = tiles[i];
    if i == 0u || tiles[max(i, 1u) - 1u] != tile {
        ranges[2u * tile] = i;
    }
    if i + 1u == slab.entries || tiles[min(i + 1u, slab.entries - 1u)] != tile {
        ranges[2u * tile + 1u] = i + 1u;
    }
}
