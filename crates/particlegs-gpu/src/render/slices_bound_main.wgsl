// Bounds the sums of Gaussians that are cut, as project_main.wgsl does of the others.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;
@group(0) @binding(2) var<storage, read> cuts: array<u32>;
@group(0) @binding(3) var<storage, read> cut_count: u32;
@group(0) @binding(4) var<storage, read_write> tiles: array<atomic<u32>>;
// The first cut Gaussian of the dispatch, and the one after its last.
@group(0) @binding(5) var<uniform> some: vec4u;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    for (var c = some.x + group.x; c < min(cut_count, some.y); c += groups.x) {
        let g = camera_gaussian(frame.lens, cuts[c], frame.count);
        let s = spline_grid(frame.lens, g);
        for (var k = me; k < s.pieces; k += 64u) {
            let m = piece(frame.lens, s, k);
            if m.weight > 0.0 {
                let placed = place(footprint(frame.lens, g, m));
                if placed.level != NOWHERE {
                    add_to_tiles(placed);
                }
            }
        }
    }
}
