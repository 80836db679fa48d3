// What the gradient of a plane means for the next coarser one: the transpose of summing (core's
// render::raster::pyramid::gather_down), 8 x 8 of its pixels a workgroup. The target is the coarser plane.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read_write> by_depth: array<f32>;
@group(0) @binding(2) var<uniform> target_plane: vec4u;

var<workgroup> fine: array<f32, 900>;
var<workgroup> lines: array<f32, 240>;

// The weight of the finer pixel 2 k - 15 + t for the coarser pixel k.
fn tap(t: u32) -> f32 {
    return TAPS[select(7u - t / 2u, (t - 1u) / 2u, t % 2u == 1u)];
}

@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) me: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let finer = frame.levels[target_plane.x - 1u];
    let coarser = frame.levels[target_plane.x];
    let corner = vec2i(16u * group.xy) - 15;
    for (var p = index; p < 900u; p += 64u) {
        let at = corner + vec2i(i32(p % 30u), i32(p / 30u));
        var value = 0.0;
        if all(at >= vec2i(0)) && at.x < i32(finer.width) && at.y < i32(finer.rows) {
            value = by_depth[finer.first + u32(at.y) * finer.width + u32(at.x)];
        }
        fine[p] = value;
    }
    workgroupBarrier();
    for (var p = index; p < 240u; p += 64u) {
        var line = 0.0;
        for (var t = 0u; t < 16u; t++) {
            line += tap(t) * fine[p / 8u * 30u + 2u * (p % 8u) + t];
        }
        lines[p] = line;
    }
    workgroupBarrier();
    let at = 8u * group.xy + me.xy;
    if at.x >= coarser.width || at.y >= coarser.rows {
        return;
    }
    var sum = 0.0;
    for (var t = 0u; t < 16u; t++) {
        sum += tap(t) * lines[(2u * me.y + t) * 8u + me.x];
    }
    by_depth[coarser.first + at.y * coarser.width + at.x] = sum;
}
