// What a splat adds to the depth of a pixel, -ln(1 - m) with m its opacity averaged over the pixel: particlegs'
// reference::deposit.

// Below this opacity -ln(1 - m) is a short series.
const SERIES_OPACITY: f32 = 0.1;
const LARGEST_MEAN_ALPHA: f32 = 0.999999;
// From this deviation on the mean over a pixel is its centre's value and a curvature term.
const SMOOTH_SIGMA: f32 = 4.0;
// Lines of a pixel that a rotated splat is summed on, at most.
const CUT_LINES: f32 = 16.0;
const STEPS: f32 = 4096.0;

fn depth_of(v: View, m: f32) -> f32 {
    // log(1 - m) loses the digits of a small m.
    if v.opacity <= SERIES_OPACITY || m < 0.02 {
        return m * (1.0 + m * (0.5 + m * (1.0 / 3.0 + m * (0.25 + m * 0.2))));
    }
    return -log(1.0 - min(m, LARGEST_MEAN_ALPHA));
}

// The integral of exp(-t^2/2) from -3 to `e`, clamped to the cut, by its table.
fn integral(e: f32) -> f32 {
    let t = (clamp(e, -CUT, CUT) + CUT) * (STEPS / (2.0 * CUT));
    let k = u32(t);
    return integrals[k] + (t - f32(k)) * (integrals[k + 1u] - integrals[k]);
}

// The mean of exp(-u^2/2) over a pixel along an axis, cut at three deviations.
fn profile(center: f32, sigma: f32, pixel: f32) -> f32 {
    let inverse = 1.0 / sigma;
    if sigma < SMOOTH_SIGMA {
        return sigma * (integral((pixel + 1.0 - center) * inverse) - integral((pixel - center) * inverse));
    }
    let low = max(pixel, center - CUT * sigma);
    let high = min(pixel + 1.0, center + CUT * sigma);
    let u = (0.5 * (low + high) - center) * inverse;
    return max(high - low, 0.0) * exp(-0.5 * u * u) * (1.0 + inverse * inverse / 24.0 * (u * u - 1.0));
}

// The inverse covariance of a rotated splat and its edges: |dx - x slope dy| <= half for the steep pair, then the flat
// one; |dy - slope dx| <= half for the flat pair.
struct RotatedForm {
    xx: f32,
    xy: f32,
    yy: f32,
    steep: vec2f,
    flat: vec2f,
    flat_down: vec2f,
}

fn nonzero(p: f32) -> f32 {
    return select(p, 1e-12, abs(p) < 1e-12);
}

fn rotated_form(s: PixelSplat) -> RotatedForm {
    let inverse = 1.0 / (s.axes.x * s.axes.w - s.axes.y * s.axes.z);
    let u = vec2f(s.axes.w, -s.axes.y) * inverse;
    let v = vec2f(-s.axes.z, s.axes.x) * inverse;
    let first = abs(u.x * v.y) >= abs(u.y * v.x);
    let steep = select(v, u, first);
    let flat = select(u, v, first);
    var f: RotatedForm;
    f.xx = u.x * u.x + v.x * v.x;
    f.xy = u.x * u.y + v.x * v.y;
    f.yy = u.y * u.y + v.y * v.y;
    f.steep = vec2f(-steep.y / nonzero(steep.x), CUT / abs(nonzero(steep.x)));
    f.flat = vec2f(-flat.y / nonzero(flat.x), CUT / abs(nonzero(flat.x)));
    f.flat_down = vec2f(-flat.x / nonzero(flat.y), CUT / abs(nonzero(flat.y)));
    return f;
}

// A rotated splat: exact along x on a few lines of the pixel.
fn rotated(v: View, s: PixelSplat, f: RotatedForm, pixel: vec2f) -> f32 {
    var lines = CUT_LINES;
    if v.opacity <= SERIES_OPACITY {
        lines = clamp(ceil(12.0 / length(s.axes.zw)), 2.0, CUT_LINES);
    }
    let sigma = 1.0 / sqrt(f.xx);
    var sum = 0.0;
    for (var line = 0.0; line < lines; line += 1.0) {
        let dy = pixel.y + (line + 0.5) / lines - s.at.y;
        let low = max(f.steep.x * dy - f.steep.y, f.flat.x * dy - f.flat.y);
        let high = min(f.steep.x * dy + f.steep.y, f.flat.x * dy + f.flat.y);
        if low < high {
            let middle = -f.xy * dy / f.xx;
            let height = exp(-0.5 * max((f.yy - f.xy * f.xy / f.xx) * dy * dy, 0.0)) * sigma / lines;
            let left = clamp(pixel.x - s.at.x, low, high);
            let right = clamp(pixel.x + 1.0 - s.at.x, low, high);
            sum += height * (integral((right - middle) / sigma) - integral((left - middle) / sigma));
        }
    }
    return sum;
}

// A large rotated splat: the covered part's centre and a curvature term.
fn rotated_smooth(s: PixelSplat, f: RotatedForm, pixel: vec2f) -> f32 {
    let corner = pixel - s.at;
    let middle = corner + 0.5;
    let x0 = max(corner.x, f.steep.x * middle.y - f.steep.y);
    let x1 = min(corner.x + 1.0, f.steep.x * middle.y + f.steep.y);
    let y0 = max(corner.y, f.flat_down.x * middle.x - f.flat_down.y);
    let y1 = min(corner.y + 1.0, f.flat_down.x * middle.x + f.flat_down.y);
    let d = 0.5 * vec2f(x0 + x1, y0 + y1);
    let g = vec2f(f.xx * d.x + f.xy * d.y, f.xy * d.x + f.yy * d.y);
    let bend = 1.0 + (dot(g, g) - (f.xx + f.yy)) / 24.0;
    return max(x1 - x0, 0.0) * max(y1 - y0, 0.0) * exp(-0.5 * max(dot(d, g), 0.0)) * bend;
}

// The splat's opacity averaged over a pixel.
fn mean_opacity(v: View, s: PixelSplat, pixel: vec2f) -> f32 {
    if is_aligned(s) {
        return v.opacity * profile(s.at.x, s.axes.x, pixel.x) * profile(s.at.y, s.axes.w, pixel.y);
    }
    let f = rotated_form(s);
    if min(length(s.axes.xy), length(s.axes.zw)) >= SMOOTH_SIGMA {
        return v.opacity * rotated_smooth(s, f, pixel);
    }
    return v.opacity * rotated(v, s, f, pixel);
}

// Adds to a pixel's depth: whole numbers in two words, so that no order of adding shows and nothing wraps. Low words and
// high ones lie apart, so that those of a picture of 8K are seen at once.
fn add(v: View, at: u32, depth: f32) {
    let units = u32(depth * v.scale + 0.5);
    if units == 0u {
        return;
    }
    let before = atomicAdd(&low[at], units);
    if before > 0xffffffffu - units {
        atomicAdd(&high[at], 1u);
    }
}
