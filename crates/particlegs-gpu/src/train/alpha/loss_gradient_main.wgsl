// The gradient with the brightness of every pixel; beyond white nothing moves it.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> blended: array<f32>;
@group(0) @binding(2) var<storage, read> wanted: array<f32>;
@group(0) @binding(3) var<uniform> loss: Loss;
@group(0) @binding(4) var<storage, read_write> faults: Faults;
// That of 1 - SSIM, where it has a share.
@group(0) @binding(5) var<storage, read> by_structure: array<f32>;
@group(0) @binding(6) var<storage, read_write> by_pixel: array<f32>;

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= frame.size) {
        return;
    }
    let p = id.y * frame.size.x + id.x;
    let drawn = clamp(blended[p], 0.0, 1.0);
    var by = 0.0;
    if !is_dark(drawn, wanted[p]) {
        by = faults.scale * difference(loss, drawn - wanted[p]).y;
    }
    if loss.dssim > 0.0 {
        by += faults.share * by_structure[p];
    }
    by_pixel[p] = select(by, 0.0, blended[p] > 1.0);
}
