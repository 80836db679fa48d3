// The window's transpose, which is itself: changes of 1 - SSIM with its means to those with every pixel. Both ways at once,
// 16 x 16 pixels a workgroup.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> picture: array<f32>;
@group(0) @binding(2) var<storage, read> wanted: array<f32>;
@group(0) @binding(3) var<storage, read> by_mean: array<f32>;
@group(0) @binding(4) var<storage, read> by_square: array<f32>;
@group(0) @binding(5) var<storage, read> by_product: array<f32>;
@group(0) @binding(6) var<storage, read_write> by_structure: array<f32>;

var<workgroup> around: array<vec3f, 676>;
var<workgroup> lines: array<vec3f, 416>;

@compute @workgroup_size(16, 16)
fn main(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) me: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let corner = vec2i(16u * group.xy) - HALF;
    for (var q = index; q < 676u; q += 256u) {
        let at = corner + vec2i(i32(q % 26u), i32(q / 26u));
        var value = vec3f(0.0);
        if all(at >= vec2i(0)) && all(at < vec2i(frame.size)) {
            let p = u32(at.y) * frame.size.x + u32(at.x);
            value = vec3f(by_mean[p], by_square[p], by_product[p]);
        }
        around[q] = value;
    }
    workgroupBarrier();
    // 26 rows, 16 columns.
    for (var q = index; q < 416u; q += 256u) {
        var line = vec3f(0.0);
        for (var k = -HALF; k <= HALF; k++) {
            line += window(k) * around[q / 16u * 26u + u32(i32(q % 16u) + HALF + k)];
        }
        lines[q] = line;
    }
    workgroupBarrier();
    if any(id.xy >= frame.size) {
        return;
    }
    var by = vec3f(0.0);
    for (var k = -HALF; k <= HALF; k++) {
        by += window(k) * lines[u32(i32(me.y) + HALF + k) * 16u + me.x];
    }
    let p = id.y * frame.size.x + id.x;
    by_structure[p] = -(by.x + 2.0 * picture[p] * by.y + wanted[p] * by.z) / f32(frame.size.x * frame.size.y);
}
