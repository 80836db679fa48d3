// Down columns, then 1 - SSIM of every pixel and its changes with the window's means.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> drawn_mean: array<f32>;
@group(0) @binding(2) var<storage, read> wanted_mean: array<f32>;
@group(0) @binding(3) var<storage, read> squares: array<f32>;
@group(0) @binding(4) var<storage, read> product: array<f32>;
@group(0) @binding(5) var<storage, read_write> by_mean: array<f32>;
@group(0) @binding(6) var<storage, read_write> by_square: array<f32>;
@group(0) @binding(7) var<storage, read_write> by_product: array<f32>;
@group(0) @binding(8) var<storage, read_write> unlike: array<vec2f>;

// 1 - SSIM.
fn structure(p: u32) -> f32 {
    var m = vec4f(0.0);
    for (var k = -HALF; k <= HALF; k++) {
        let y = i32(p / frame.size.x) + k;
        if y >= 0 && y < i32(frame.size.y) {
            let at = u32(i32(p) + k * i32(frame.size.x));
            m += window(k) * vec4f(drawn_mean[at], wanted_mean[at], squares[at], product[at]);
        }
    }
    let x = m.x;
    let y = m.y;
    let l = 2.0 * x * y + C1;
    let s = 2.0 * (m.w - x * y) + C2;
    let dl = x * x + y * y + C1;
    let ds = m.z - x * x - y * y + C2;
    let ssim = l * s / (dl * ds);
    by_product[p] = 2.0 * l / (dl * ds);
    by_square[p] = -ssim / ds;
    by_mean[p] = 2.0 * y * (s - l) / (dl * ds) - 2.0 * x * ssim * (1.0 / dl - 1.0 / ds);
    return 1.0 - ssim;
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let pixels = frame.size.x * frame.size.y;
    var own = 0.0;
    for (var p = 256u * group.x + me; p < pixels; p += 256u * PARTS) {
        own += structure(p);
    }
    let sum = sum_of(me, vec2f(own, 0.0));
    if me == 0u {
        unlike[group.x] = sum;
    }
}
