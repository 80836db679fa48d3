// Draws Gaussians that are in one piece.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> strokes: array<RasterSplat>;
@group(0) @binding(2) var<storage, read> planes_of: array<u32>;
@group(0) @binding(3) var<storage, read> scales: array<Scale>;
@group(0) @binding(4) var<storage, read_write> finest: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> coarser: array<atomic<u32>>;
// The first Gaussian of the dispatch.
@group(0) @binding(6) var<uniform> some: vec4u;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) me: u32) {
    var plane = NOWHERE;
    var stroke: RasterSplat;
    let i = some.x + id.x;
    if i < frame.count {
        plane = planes_of[i];
        if plane != NOWHERE {
            stroke = strokes[i];
        }
    }
    draw(me, stroke, plane);
}
