// The brightness of every pixel as it is shown, and sums of differences and lit pixels.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> blended: array<f32>;
@group(0) @binding(2) var<storage, read> wanted: array<f32>;
@group(0) @binding(3) var<uniform> loss: Loss;
@group(0) @binding(4) var<storage, read_write> picture: array<f32>;
@group(0) @binding(5) var<storage, read_write> parts: array<vec2f>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let pixels = frame.size.x * frame.size.y;
    var own = vec2f(0.0);
    for (var p = 256u * group.x + me; p < pixels; p += 256u * PARTS) {
        let drawn = clamp(blended[p], 0.0, 1.0);
        picture[p] = drawn;
        if !is_dark(drawn, wanted[p]) {
            own += vec2f(difference(loss, drawn - wanted[p]).x, 1.0);
        }
    }
    let sum = sum_of(me, own);
    if me == 0u {
        parts[group.x] = sum;
    }
}
