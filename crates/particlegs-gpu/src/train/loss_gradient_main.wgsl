// The gradient with the sum of every pixel of the finest plane; 0 in its pads.

@group(0) @binding(6) var<storage, read> wanted: array<f32>;
@group(0) @binding(7) var<uniform> loss: Loss;
@group(0) @binding(8) var<storage, read_write> faults: Faults;
// That of 1 - SSIM with the brightness of every pixel, where it has a share.
@group(0) @binding(9) var<storage, read> by_structure: array<f32>;
@group(0) @binding(10) var<storage, read_write> by_depth: array<f32>;

// The change of brightness with depth. The response is a table: its slope is taken over a few of its steps.
fn slope(tau: f32) -> f32 {
    if style.kind == 0u {
        return exp(-tau);
    }
    let step = max(0.02 * tau, 1e-5);
    return (on_curve(tau + step) - on_curve(max(tau - step, 0.0))) / (step + min(step, tau)) / 255.0;
}

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let level = frame.levels[0];
    if id.x >= level.width || id.y >= level.rows {
        return;
    }
    var by = 0.0;
    let at = id.xy - PAD;
    if all(id.xy >= vec2u(PAD)) && all(at < frame.size) {
        let tau = depth(at.x, at.y);
        let p = at.y * frame.size.x + at.x;
        let drawn = bitcast<f32>(picture[p]);
        if !is_dark(drawn, wanted[p]) {
            by = faults.scale * difference(loss, drawn - wanted[p]).y;
        }
        if loss.dssim > 0.0 {
            by += faults.share * by_structure[p];
        }
        // The drawn depth is never negative; where the planes' sum was, nothing changes it.
        by *= select(0.0, slope(tau) * growth(at.x, at.y), tau > 0.0);
    }
    by_depth[id.y * level.width + id.x] = by;
}
