// The projection backwards: particlegs-train's depth::adjoint and depth::steps::turned in one. Everything on the picture is
// told in coordinates (x - lean y, y), in which a footprint is upright, and everything in the world in the Gaussian's own
// frame, in which it is round: so no large numbers cancel, and float32 suffices.

// How moments change: weight, mean, square, variance.
struct DepthSlopes {
    by_depth: vec4f,
    by_variance: vec4f,
}

// Gradient with a footprint: with its mean; with its covariance, as the symmetric matrix (uu, uv, vv); with its sum.
struct FootprintGradient {
    mean: vec2f,
    cov: vec3f,
    sum: f32,
}

// Gradient with a Gaussian in its own frame: with its mean, with the lower triangle (00, 10, 11, 20, 21, 22) of its factor,
// with the logarithm of its count.
struct OwnFrameGradient {
    place: vec3f,
    shape: LowerTriangle,
    count: f32,
}

// A symmetric matrix: 00, 10, 11, and 20, 21, 22.
struct LowerTriangle {
    high: vec3f,
    low: vec3f,
}

// (a b^T + b a^T) / 2.
fn symmetric(a: vec3f, b: vec3f) -> LowerTriangle {
    let high = vec3f(a.x * b.x, 0.5 * (a.x * b.y + a.y * b.x), a.y * b.y);
    return LowerTriangle(high, vec3f(0.5 * (a.x * b.z + a.z * b.x), 0.5 * (a.y * b.z + a.z * b.y), a.z * b.z));
}

fn add(a: OwnFrameGradient, b: OwnFrameGradient) -> OwnFrameGradient {
    let shape = LowerTriangle(a.shape.high + b.shape.high, a.shape.low + b.shape.low);
    return OwnFrameGradient(a.place + b.place, shape, a.count + b.count);
}

// M v.
fn times(m: vec3f, v: vec2f) -> vec2f {
    return vec2f(m.x * v.x + m.y * v.y, m.y * v.x + m.z * v.y);
}

// The change of the logarithm of lattice_sum with the mean (x, y), and with the covariance (xx, xy, yy).
struct LatticeSlope {
    mean: vec2f,
    cov: vec3f,
}

fn lattice_slope(at: vec2f, xx: f32, xy: f32, yy: f32) -> LatticeSlope {
    let place = fract(at);
    var sum = 1.0;
    var slope: LatticeSlope;
    for (var a = 0; a <= 2; a++) {
        for (var b = -2; b <= 2; b++) {
            let i = f32(a);
            let j = f32(b);
            let power = -0.5 * TWO_PI * TWO_PI * (i * i * xx + 2.0 * i * j * xy + j * j * yy);
            // Half of the plane of frequencies.
            if (a == 0 && b <= 0) || power <= -14.0 {
                continue;
            }
            let phase = TWO_PI * fract(i * place.x + j * place.y);
            let size = 2.0 * exp(power);
            sum += size * cos(phase);
            slope.cov -= 0.5 * TWO_PI * TWO_PI * size * cos(phase) * vec3f(i * i, 2.0 * i * j, j * j);
            slope.mean -= size * sin(phase) * TWO_PI * vec2f(i, j);
        }
    }
    return LatticeSlope(slope.mean / sum, slope.cov / sum);
}

// From what was gathered to the gradient with the footprint.
fn footprint_gradient(f: Footprint, placed: PlacedFootprint, g: GradientMoments) -> FootprintGradient {
    // Offsets were gathered in the plane's pixels.
    let unscale = f32(1u << placed.level);
    let peak = placed.stroke.peak;
    let first = unscale * vec2f(g.u, g.v);
    let second = unscale * unscale * vec3f(g.uu, g.uv, g.vv);
    var by: FootprintGradient;
    by.mean = peak * vec2f(first.x / f.across, first.y / f.down);
    by.cov = 0.5 * peak * vec3f(
        (second.x / f.across - g.one) / f.across,
        second.y / f.across / f.down,
        (second.z / f.down - g.one) / f.down,
    );
    by.sum = g.one * peak / f.sum;
    if placed.small == 1u {
        let lattice = lattice_slope(f.mean, f.across + f.lean * f.lean * f.down, f.lean * f.down, f.down);
        let c = lattice.cov;
        let uv = 0.5 * c.y + f.lean * c.x;
        let upright = vec3f(c.x, uv, c.z - f.lean * f.lean * c.x + 2.0 * f.lean * uv);
        by.mean -= g.one * peak * vec2f(lattice.mean.x, lattice.mean.y + f.lean * lattice.mean.x);
        by.cov -= g.one * peak * upright;
    }
    return by;
}

// A vector of the picture in the footprint's upright coordinates.
fn upright(f: Footprint, v: vec2f) -> vec2f {
    return vec2f(v.x - f.lean * v.y, v.y);
}

// A piece of a Gaussian: how it came to be drawn.
struct FootprintPiece {
    axes: OwnFrameAxes,
    g: CameraGaussian,
    moments: DepthMoments,
    slopes: DepthSlopes,
    footprint: Footprint,
}

// The reverse of `footprint` in perspective, for one piece.
fn piece_gradient(lens: Lens, p: FootprintPiece, by: FootprintGradient) -> OwnFrameGradient {
    let g = p.g;
    let f = p.footprint;
    let m = p.moments;
    let f2 = lens.focal * lens.focal;
    let round = f2 * lens.radius2;
    // Where the picture has it, t = slope + carried (inverse depth).
    let carried = upright(f, g.mean.xy - g.slope * g.mean.z);
    let t = upright(f, g.mean.xy * m.mean + g.slope * m.behind);
    let by_t = lens.focal * by.mean + 2.0 * round * m.square * times(by.cov, t);
    let turned = times(by.cov, carried);
    let w = vec2f(g.lean - f.lean, 1.0);
    let of_rest = g.across * by.cov.x + g.down * dot(w, times(by.cov, w));
    let across_pixel = vec2f(-f.lean, 1.0);
    let of_round = by.cov.x + dot(across_pixel, times(by.cov, across_pixel)) + dot(t, times(by.cov, t));
    // Gradients with weight, mean, square and variance of the inverse depths.
    let by_moments =
        vec4f(g.weight * by.sum, dot(by_t, carried), f2 * of_rest + round * of_round, f2 * dot(carried, turned));
    let by_carried = by_t * m.mean + 2.0 * f2 * m.variance * turned;
    let by_slope = by_t * m.behind - 2.0 * g.mean.z * f2 * m.variance * turned;
    let right = p.axes.right - f.lean * p.axes.down;
    let down = p.axes.down;
    let forward = p.axes.forward;
    var own: OwnFrameGradient;
    own.place = by_carried.x * right + by_carried.y * down + dot(by_moments, p.slopes.by_depth) * forward;
    let rest = f2 * m.square * by.cov;
    let xx = symmetric(right, right);
    let xy = symmetric(right, down);
    let yy = symmetric(down, down);
    let lean = symmetric((by_slope.x * right + by_slope.y * down) * p.axes.inverse_depth, forward);
    let zz = symmetric(forward, forward);
    let by_variance = dot(by_moments, p.slopes.by_variance);
    own.shape.high =
        2.0 * (rest.x * xx.high + 2.0 * rest.y * xy.high + rest.z * yy.high + lean.high + by_variance * zz.high);
    own.shape.low =
        2.0 * (rest.x * xx.low + 2.0 * rest.y * xy.low + rest.z * yy.low + lean.low + by_variance * zz.low);
    own.count = g.weight * m.weight * by.sum;
    return own;
}

// Writes the gradient of a Gaussian; what is not a number counts as zero, and is told.
fn write_gradient(i: u32, n: u32, own: OwnFrameGradient) {
    let p = own.place;
    let s = own.shape;
    var all = array<f32, 10>(
        p.x, p.y, p.z, s.high.x, s.high.y, s.high.z, s.low.x, s.low.y, s.low.z, own.count,
    );
    var bad = 10u;
    for (var k = 0u; k < 10u; k++) {
        if bad == 10u && !is_number(all[k]) {
            bad = k;
        }
    }
    if bad < 10u {
        atomicAdd(&faults.count, 1u);
        let group = select(select(2u, 1u, bad < 9u), 0u, bad < 3u);
        atomicMin(&faults.first, 4u * i + group);
    }
    for (var k = 0u; k < 10u; k++) {
        gradient[k * n + i] = select(0.0, all[k], bad == 10u);
    }
}
