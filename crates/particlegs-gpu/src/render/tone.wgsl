// Depth to grey levels: core's render::tone.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> scales: array<Scale>;
@group(0) @binding(2) var<storage, read_write> planes: array<u32>;
@group(0) @binding(3) var<uniform> style: ToneStyle;
// The response at 2^e (1 + k/64), e from -14 to 3, and at 16; and what FXAA makes of means, at the same depths.
@group(0) @binding(4) var<storage, read> curve: array<f32>;
// Four levels a word, row after row.
@group(0) @binding(5) var<storage, read_write> picture: array<u32>;

struct ToneStyle {
    // 0: 255 (1 - exp(-tau)); 1: by the curve; 2: levels are in the plane already, blurred by `tap`.
    kind: u32,
    // What either neighbour has of a blurred level.
    tap: f32,
    // 1 where the only plane holds sums yet.
    is_sum: u32,
    pad0: u32,
}

const FIRST: u32 = 113u << 23u;
const SHIFT: u32 = 17u;
const ENTRIES: u32 = 1152u;

// The optical depth of a pixel; splats widen towards the edges as VTK's do.
fn depth(x: u32, y: u32) -> f32 {
    let level = frame.levels[0];
    let word = planes[(y + PAD) * level.width + x + PAD];
    var tau = bitcast<f32>(word);
    if style.is_sum == 1u {
        tau = f32(word) * scales[0].down;
    }
    return max(tau, 0.0) * growth(x, y);
}

// How much splats widen at a pixel.
fn growth(x: u32, y: u32) -> f32 {
    if frame.lens.perspective == 0u {
        return 1.0;
    }
    let t = (vec2f(f32(x), f32(y)) - frame.lens.center) / frame.lens.focal;
    return sqrt(1.0 + t.x * t.x) * sqrt(1.0 + t.y * t.y);
}

fn on_curve(tau: f32) -> f32 {
    let bits = bitcast<u32>(tau);
    if bits <= FIRST {
        return tau / bitcast<f32>(FIRST) * curve[0];
    }
    let offset = bits - FIRST;
    let index = offset >> SHIFT;
    if index >= ENTRIES {
        return curve[ENTRIES];
    }
    let t = f32(offset & 0x1ffffu) / 131072.0;
    return mix(curve[index], curve[index + 1u], t);
}

// The level of a pixel before rounding.
fn level_of(x: u32, y: u32) -> f32 {
    let tau = depth(x, y);
    if style.kind == 0u {
        // 1 - exp(-tau) without a difference where tau is small.
        let series = tau * (1.0 - tau * (0.5 - tau * (1.0 / 6.0 - tau / 24.0)));
        return 255.0 * select(1.0 - exp(-tau), series, tau < 0.02);
    }
    return on_curve(tau);
}

fn blurred(x: u32, y: u32) -> f32 {
    var sum = 0.0;
    let weights = vec2f(1.0 - 2.0 * style.tap, style.tap);
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let at = vec2u(clamp(vec2i(vec2u(x, y)) + vec2i(i, j), vec2i(0), vec2i(frame.size) - 1));
            let word = planes[(at.y + PAD) * frame.levels[0].width + at.x + PAD];
            sum += weights[abs(i)] * weights[abs(j)] * bitcast<f32>(word);
        }
    }
    return sum;
}
