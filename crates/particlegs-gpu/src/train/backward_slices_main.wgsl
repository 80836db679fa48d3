// The gradient with Gaussians that are cut: a Gaussian a workgroup at a time and a piece a thread.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;
@group(0) @binding(2) var<storage, read> by_depth: array<f32>;
@group(0) @binding(3) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(4) var<storage, read_write> faults: Faults;
@group(0) @binding(5) var<storage, read> cuts: array<u32>;
@group(0) @binding(6) var<storage, read> cut_count: u32;
// The first cut Gaussian of the dispatch, and the one after its last.
@group(0) @binding(7) var<uniform> some: vec4u;

var<workgroup> cut_here: u32;
var<workgroup> pieces_here: u32;
var<workgroup> own_here: array<OwnFrameGradient, 64>;

// The sum over the workgroup, in a fixed order; for the first thread.
fn sum_of(me: u32, own: OwnFrameGradient) -> OwnFrameGradient {
    own_here[me] = own;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if me < half {
            own_here[me] = add(own_here[me], own_here[me + half]);
        }
        workgroupBarrier();
    }
    let sum = own_here[0];
    workgroupBarrier();
    return sum;
}

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
        var p: FootprintPiece;
        p.axes = own_frame_axes(frame.lens, cuts[c], frame.count);
        p.g = camera_gaussian_with_axes(frame.lens, p.axes, cuts[c], frame.count);
        let s = spline_grid(frame.lens, p.g);
        if me == 0u {
            pieces_here = s.pieces;
        }
        let pieces = workgroupUniformLoad(&pieces_here);
        var total: OwnFrameGradient;
        for (var base = 0u; base < pieces; base += THREADS) {
            var placed: PlacedFootprint;
            placed.level = NOWHERE;
            if base + me < pieces {
                if s.steps == 0u {
                    p.moments = piece(frame.lens, s, 0u);
                } else {
                    let sums = piece_sums(frame.lens, s, base + me);
                    p.moments = moments(frame.lens, s, base + me, sums.here);
                    p.slopes = piece_slopes(frame.lens, s, base + me, sums);
                }
                if p.moments.weight > 0.0 {
                    p.footprint = footprint(frame.lens, p.g, p.moments);
                    placed = place(p.footprint);
                }
            }
            let gathered = gather(me, placed.stroke, placed.level);
            var own: OwnFrameGradient;
            if placed.level != NOWHERE {
                own = piece_gradient(frame.lens, p, footprint_gradient(p.footprint, placed, gathered));
            }
            total = add(total, sum_of(me, own));
        }
        if me == 0u {
            write_gradient(cuts[c], frame.count, total);
        }
    }
}
