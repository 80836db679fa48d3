// Draws Gaussians that are cut, a Gaussian a workgroup at a time and a piece a thread.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;
@group(0) @binding(2) var<storage, read> cuts: array<u32>;
@group(0) @binding(3) var<storage, read> cut_count: u32;
@group(0) @binding(4) var<storage, read> scales: array<Scale>;
@group(0) @binding(5) var<storage, read_write> finest: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> coarser: array<atomic<u32>>;
// The first cut Gaussian of the dispatch, and the one after its last.
@group(0) @binding(7) var<uniform> some: vec4u;

var<workgroup> cut_here: u32;
var<workgroup> pieces_here: u32;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    if me == 0u {
        cut_here = min(cut_count, some.y);
    }
    let count = workgroupUniformLoad(&cut_here);
    for (var c = some.x + group.x; c < count; c += groups.x) {
        let g = camera_gaussian(frame.lens, cuts[c], frame.count);
        let s = spline_grid(frame.lens, g);
        if me == 0u {
            pieces_here = s.pieces;
        }
        let pieces = workgroupUniformLoad(&pieces_here);
        for (var base = 0u; base < pieces; base += THREADS) {
            var placed: PlacedFootprint;
            placed.level = NOWHERE;
            if base + me < pieces {
                let m = piece(frame.lens, s, base + me);
                if m.weight > 0.0 {
                    placed = place(footprint(frame.lens, g, m));
                }
            }
            draw(me, placed.stroke, placed.level);
        }
    }
}
