// The brightness of every pixel, and sums of differences and lit pixels.

@group(0) @binding(6) var<storage, read> wanted: array<f32>;
@group(0) @binding(7) var<uniform> loss: Loss;
@group(0) @binding(8) var<storage, read_write> parts: array<vec2f>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let pixels = frame.size.x * frame.size.y;
    var own = vec2f(0.0);
    for (var p = 256u * group.x + me; p < pixels; p += 256u * PARTS) {
        let drawn = level_of(p % frame.size.x, p / frame.size.x) / 255.0;
        picture[p] = bitcast<u32>(drawn);
        if !is_dark(drawn, wanted[p]) {
            own += vec2f(difference(loss, drawn - wanted[p]).x, 1.0);
        }
    }
    let sum = sum_of(me, own);
    if me == 0u {
        parts[group.x] = sum;
    }
}
