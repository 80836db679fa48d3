// Gaussians cut along depth into pieces: core's render::project::slices. A piece is the Gaussian times one cubic B-spline
// of depth (of its logarithm in perspective); a thread finds the moments of one.

// Distance of the splines in the logarithm of depth.
const STEP: f32 = 0.05;
// Grid points for a step.
const POINTS: u32 = 8u;
// More pieces than this are never made; they grow coarser instead.
const MOST: f32 = 1024.0;

// Where the splines of a Gaussian lie.
struct SplineGrid {
    // The start of the axis, and the distance of the splines along it.
    start: f32,
    step: f32,
    // Number of steps; there are three more splines. 0 = a Gaussian without depth, in one piece if at all.
    steps: u32,
    // Number of pieces.
    pieces: u32,
    mean: f32,
    sigma: f32,
}

// Does a Gaussian lie outside the four side planes of what the picture sees?
fn misses(lens: Lens, g: CameraGaussian) -> bool {
    let rest = vec2f(g.across + g.lean * g.lean * g.down, g.down);
    for (var k = 0u; k < 2u; k++) {
        let edge = (1.25 * lens.center[k] + 64.0) / lens.focal;
        for (var side = -1.0; side <= 1.0; side += 2.0) {
            let t = side * edge;
            let flat = lens.perspective == 0u;
            let beyond = side * select(g.mean[k] - t * g.mean.z, g.mean[k] - t, flat);
            let lean = select(g.slope[k] - t, g.slope[k], flat);
            let round = select(1.0 + t * t, 1.0, flat);
            let spread = rest[k] + lean * lean * g.depth;
            if beyond > 0.0 && beyond * beyond > 49.0 * (spread + lens.radius2 * round) {
                return true;
            }
        }
    }
    return false;
}

fn spline_grid(lens: Lens, g: CameraGaussian) -> SplineGrid {
    var s: SplineGrid;
    s.mean = g.mean.z;
    s.sigma = sqrt(max(g.depth, 0.0));
    let lo = max(s.mean - REACH * s.sigma, lens.range.x);
    let hi = min(s.mean + REACH * s.sigma, lens.range.y);
    if misses(lens, g) {
        return s;
    }
    if lo >= hi {
        s.pieces = select(0u, 1u, s.mean >= lens.range.x && s.mean <= lens.range.y);
        return s;
    }
    let flat = lens.perspective == 0u;
    let length = select(log(hi / lo), hi - lo, flat);
    let own = 0.35 * s.sigma / select(min(hi, max(s.mean, lo)), 1.0, flat);
    let step = select(min(STEP, own), own, flat);
    s.steps = u32(clamp(ceil(length / step), 1.0, MOST));
    s.step = length / f32(s.steps);
    s.start = select(log(lo), lo, flat);
    s.pieces = s.steps + 3u;
    return s;
}

fn spline(k: u32, t: f32) -> f32 {
    let s = 1.0 - t;
    switch k {
        case 0u: { return s * s * s / 6.0; }
        case 1u: { return (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0; }
        case 2u: { return (-3.0 * t * t * t + 3.0 * t * t + 3.0 * t + 1.0) / 6.0; }
        default: { return t * t * t / 6.0; }
    }
}

// Sums over a piece of weights, times q, times q^2: q is the inverse depth over that of the piece's middle, less 1; without
// perspective the depth less the middle's. So its variance is no difference of large numbers. And what they change with.
struct PieceSums {
    here: vec3f,
    by_depth: vec3f,
    by_variance: vec3f,
}

fn piece_sums(lens: Lens, s: SplineGrid, k: u32) -> PieceSums {
    let flat = lens.perspective == 0u;
    let middle = f32(k) - 1.0;
    var sums: PieceSums;
    let share = s.step / (f32(POINTS) * s.sigma * 2.5066283);
    for (var b = 0u; b < 4u; b++) {
        // Step `first` gives its spline `b` to piece first + b.
        if k < b || k - b >= s.steps {
            continue;
        }
        let first = k - b;
        for (var i = 0u; i < POINTS; i++) {
            let t = (f32(i) + 0.5) / f32(POINTS);
            let u = f32(first) + t;
            let axis = s.start + s.step * u;
            let depth = select(exp(axis), axis, flat);
            let z = (depth - s.mean) / s.sigma;
            let density = spline(b, t) * exp(-0.5 * z * z) * share / select(depth, 1.0, flat);
            let away = s.step * (u - middle);
            let q = select(-away * (1.0 - 0.5 * away * (1.0 - away / 3.0 * (1.0 - 0.25 * away))), away, flat);
            let powers = density * vec3f(1.0, q, q * q);
            sums.here += powers;
            sums.by_depth += powers * (z / s.sigma);
            sums.by_variance += powers * (0.5 * (z * z - 1.0) / (s.sigma * s.sigma));
        }
    }
    return sums;
}

// The axis at a piece's middle.
fn middle_of(s: SplineGrid, k: u32) -> f32 {
    return s.start + s.step * (f32(k) - 1.0);
}

// The moments of one piece; a weight of 0 where there is nothing of it.
fn piece(lens: Lens, s: SplineGrid, k: u32) -> DepthMoments {
    if s.steps == 0u {
        let flat = lens.perspective == 0u;
        let q = select(1.0 / s.mean, s.mean, flat);
        return DepthMoments(select(q * q, 1.0, flat), q, select(q * q, 0.0, flat), 0.0, 0.0);
    }
    return moments(lens, s, k, piece_sums(lens, s, k).here);
}

fn moments(lens: Lens, s: SplineGrid, k: u32, sums: vec3f) -> DepthMoments {
    if !(sums.x > 0.0) {
        return DepthMoments(0.0, 0.0, 0.0, 0.0, 0.0);
    }
    let mean = sums.y / sums.x;
    let variance = max(sums.z / sums.x - mean * mean, 0.0);
    let center = middle_of(s, k);
    let flat = lens.perspective == 0u;
    if flat {
        let q = center + mean;
        return DepthMoments(sums.x, q, 0.0, variance, s.mean - q);
    }
    let q0 = exp(-center);
    let q = q0 * (1.0 + mean);
    return DepthMoments(sums.x, q, q * q + q0 * q0 * variance, q0 * q0 * variance, 1.0 - s.mean * q);
}
