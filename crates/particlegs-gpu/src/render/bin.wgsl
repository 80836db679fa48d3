// Footprints to strokes on the plane that suits them: core's render::bin.

// A footprint ends between these many sigma (squared); the mass outside is put back.
const NEAREST_CUT: f32 = 9.0;
const FARTHEST_CUT: f32 = 22.0;
// exp(-9 / 2).
const NEAREST_SHARE: f32 = 0.011108997;
// The cut of footprints that are so small that the pixel grid shows, and what small is (variance).
const SMALL_CUT: f32 = 20.0;
const SMALL: f32 = 0.45;
// 4 SHARPEST^2, SHARPEST = 1.3: the variance from which on the next coarser plane still shows it.
const COARSER: f32 = 6.76;
const HALF_LOG2_E: f32 = 0.7213475;
const TWO_PI: f32 = 6.2831853;
// Deeper is white far beyond its edge.
const DEEPEST: f32 = 65535.0;

fn cut_of(peak: f32, smaller: f32) -> f32 {
    if smaller < SMALL {
        return SMALL_CUT;
    }
    if peak < frame.faintest * 90.0 {
        return NEAREST_CUT;
    }
    return clamp(2.0 * log(peak / frame.faintest), NEAREST_CUT, FARTHEST_CUT);
}

fn lattice_term(i: f32, j: f32, at: vec2f, xx: f32, xy: f32, yy: f32) -> f32 {
    let power = -0.5 * TWO_PI * TWO_PI * (i * i * xx + 2.0 * i * j * xy + j * j * yy);
    if power <= -14.0 {
        return 0.0;
    }
    return 2.0 * exp(power) * cos(TWO_PI * fract(i * at.x + j * at.y));
}

// The sum over all pixels of the normalised footprint sampled at their centres, by Poisson's summation.
fn lattice_sum(mean: vec2f, xx: f32, xy: f32, yy: f32) -> f32 {
    let at = fract(mean);
    var sum = 1.0;
    for (var i = 0; i <= 2; i++) {
        for (var j = -2; j <= 2; j++) {
            // Half of the plane of frequencies.
            if i > 0 || j > 0 {
                sum += lattice_term(f32(i), f32(j), at, xx, xy, yy);
            }
        }
    }
    return sum;
}

fn is_number(v: f32) -> bool {
    return abs(v) < 3e38;
}

fn place(f: Footprint) -> PlacedFootprint {
    var placed: PlacedFootprint;
    placed.level = NOWHERE;
    let xx = f.across + f.lean * f.lean * f.down;
    let yy = f.down;
    // The plane of the picture itself decides what is far away.
    let reach = 7.690416;
    let beyond = max(-f.mean, f.mean - vec2f(frame.size)) - f32(2u * PAD);
    if any(beyond > vec2f(0.0)) && any((beyond > vec2f(0.0)) & (beyond * beyond > reach * reach * vec2f(xx, yy))) {
        return placed;
    }
    let det = f.across * yy;
    if !(det > 0.0 && f.sum > 0.0) || !is_number(det) {
        return placed;
    }
    var peak = f.sum / (TWO_PI * sqrt(det));
    let half_sum = 0.5 * (xx + yy);
    let smaller = det / (half_sum + sqrt(max(half_sum * half_sum - det, 0.0)));
    let cut2 = cut_of(peak, smaller);
    // The coarsest plane that still shows it.
    var level = 0u;
    var scale = 1.0;
    var least = COARSER;
    while level + 1u < frame.level_count && smaller >= least {
        level += 1u;
        scale *= 0.5;
        least *= 4.0;
    }
    let plane = frame.levels[level];
    let at = (f.mean + 0.5) * scale - 0.5 + f32(PAD);
    let half = sqrt(cut2 * vec2f(xx, yy)) * scale;
    let last = vec2f(f32(plane.width - 1u), f32(plane.rows - 1u));
    // Not the negation: what is not a number stays out.
    if !(all(at + half >= vec2f(0.0)) && all(at - half <= last)) || !is_number(peak) {
        return placed;
    }
    peak /= 1.0 - select(exp(-0.5 * cut2), NEAREST_SHARE, cut2 == NEAREST_CUT);
    placed.small = select(0u, 1u, smaller < SMALL);
    if placed.small == 1u {
        peak /= lattice_sum(f.mean, xx, f.lean * f.down, yy);
    }
    let unscale2 = 1.0 / (scale * scale);
    placed.level = level;
    placed.half_width = half.x;
    placed.stroke = RasterSplat(
        at.x,
        at.y,
        f.lean,
        -HALF_LOG2_E / f.across * unscale2,
        -HALF_LOG2_E / yy * unscale2,
        -HALF_LOG2_E * cut2,
        min(peak, DEEPEST),
        half.y,
    );
    return placed;
}
