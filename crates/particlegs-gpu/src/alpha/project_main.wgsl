// Gaussians to footprints, the tiles that they touch, and their depths, which they are sorted by.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> gaussians: array<u32>;
@group(0) @binding(2) var<storage, read> bent: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(4) var<storage, read_write> touched_by: array<vec2u>;
@group(0) @binding(5) var<storage, read_write> depths: array<u32>;
@group(0) @binding(6) var<storage, read_write> order: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + me;
    if i >= frame.count {
        return;
    }
    let at = frame.first + i;
    var touched = NO_TILES;
    var depth = NO_DEPTH;
    let p = project(camera_gaussian(i, frame.count));
    if p.seen {
        touched = touched_tiles(p.splat.at, p.reach);
        if number(touched) > 0u {
            splats[at] = p.splat;
            // Depths are positive: their bits stand in their order.
            depth = bitcast<u32>(p.depth);
        }
    }
    touched_by[at] = touched;
    depths[at] = depth;
    order[at] = at;
}
