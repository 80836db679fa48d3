// The loss, and what gradients of pixels are multiplied by.

@group(0) @binding(0) var<uniform> loss: Loss;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> parts: array<vec2f>;
// Sums of 1 - SSIM, where that has a share.
@group(0) @binding(3) var<storage, read> unlike: array<vec2f>;
@group(0) @binding(4) var<storage, read_write> faults: Faults;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) me: u32) {
    let sum = sum_of(me, parts[me]);
    var structure = 0.0;
    if loss.dssim > 0.0 {
        structure = sum_of(me, unlike[me]).x / f32(frame.size.x * frame.size.y);
    }
    if me > 0u {
        return;
    }
    let lit = max(sum.y, 1.0);
    let value = sum.x / lit * (1.0 - loss.dssim) + loss.dssim * structure;
    var factor = 1.0;
    if loss.logarithm == 1u && value > 0.0 {
        factor = 1.0 / value;
    }
    faults.value = select(log(value), value, loss.logarithm == 0u || value <= 0.0);
    faults.scale = (1.0 - loss.dssim) / lit * factor;
    faults.share = loss.dssim * factor;
    faults.lit = sum.y;
    atomicStore(&faults.count, 0u);
    atomicStore(&faults.first, 0xffffffffu);
    faults.network = 0u;
}
