// What a drawn picture loses against its target: particlegs-train's loss.

struct Loss {
    // 0: absolute differences, 1: squared.
    norm: u32,
    // 1: the logarithm of the loss.
    logarithm: u32,
    // Absolute differences are rounded off below this one.
    rounded: f32,
    // Share of 1 - SSIM.
    dssim: f32,
}

// Workgroups of 256 threads that pixels are shared out among; fixed, so that sums do not depend on the device.
const PARTS: u32 = 256u;
// Pixels that are as dark in both pictures do not count: core's picture::MASK_LEVEL.
const LIT: f32 = 2.5 / 255.0;

// The value of a difference, and its slope.
fn difference(loss: Loss, d: f32) -> vec2f {
    if loss.norm == 1u {
        return vec2f(d * d, 2.0 * d);
    }
    if loss.rounded > 0.0 {
        let root = sqrt(d * d + loss.rounded * loss.rounded);
        return vec2f(root - loss.rounded, d / root);
    }
    return vec2f(abs(d), sign(d));
}

fn is_dark(a: f32, b: f32) -> bool {
    return a <= LIT && b <= LIT;
}
