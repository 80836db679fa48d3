// The gradient with every Gaussian that is drawn whole; those that are cut come after.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;
@group(0) @binding(2) var<storage, read> by_depth: array<f32>;
@group(0) @binding(3) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(4) var<storage, read_write> faults: Faults;
// The first Gaussian of the dispatch.
@group(0) @binding(5) var<uniform> some: vec4u;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) me: u32) {
    var placed: PlacedFootprint;
    placed.level = NOWHERE;
    var p: FootprintPiece;
    let i = some.x + id.x;
    if i < frame.count {
        p.axes = own_frame_axes(frame.lens, i, frame.count);
        p.g = camera_gaussian_with_axes(frame.lens, p.axes, i, frame.count);
        let depth = p.g.mean.z;
        if p.g.weight > 0.0 && clip_class(frame.lens, depth, p.g.depth) == WHOLE {
            p.moments = whole(frame.lens, depth, p.g.depth);
            p.slopes = inverse_slopes(depth, p.g.depth);
            p.footprint = footprint(frame.lens, p.g, p.moments);
            placed = place(p.footprint);
        }
    }
    let gathered = gather(me, placed.stroke, placed.level);
    if i >= frame.count {
        return;
    }
    var own: OwnFrameGradient;
    if placed.level != NOWHERE {
        own = piece_gradient(frame.lens, p, footprint_gradient(p.footprint, placed, gathered));
    }
    write_gradient(i, frame.count, own);
}
