// Along rows: the window's means of both pictures, of their squares' sum, and of their product.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> picture: array<f32>;
@group(0) @binding(2) var<storage, read> wanted: array<f32>;
@group(0) @binding(3) var<storage, read_write> drawn_mean: array<f32>;
@group(0) @binding(4) var<storage, read_write> wanted_mean: array<f32>;
@group(0) @binding(5) var<storage, read_write> squares: array<f32>;
@group(0) @binding(6) var<storage, read_write> product: array<f32>;

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= frame.size) {
        return;
    }
    let p = id.y * frame.size.x + id.x;
    var sums = vec4f(0.0);
    for (var k = -HALF; k <= HALF; k++) {
        let x = i32(id.x) + k;
        if x >= 0 && x < i32(frame.size.x) {
            let a = picture[i32(p) + k];
            let b = wanted[i32(p) + k];
            sums += window(k) * vec4f(a, b, a * a + b * b, a * b);
        }
    }
    drawn_mean[p] = sums.x;
    wanted_mean[p] = sums.y;
    squares[p] = sums.z;
    product[p] = sums.w;
}
