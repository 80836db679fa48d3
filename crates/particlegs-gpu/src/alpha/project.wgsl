// One Gaussian on the picture: core's render::alpha::project in f32. What is a difference of large numbers there is
// written here without one.

// A Gaussian in the camera's axes, relative to the eye.
struct GreyCameraGaussian {
    mean: vec3f,
    // Variance of depth.
    depth: f32,
    // Change of x and y with depth.
    slope: vec2f,
    // Variance of y at a given depth; change of x with y there; variance of x at a given depth and y.
    down: f32,
    lean: f32,
    across: f32,
    opacity: f32,
    grey: f32,
}

// A footprint, and whether it is drawn.
struct ProjectedSplat {
    seen: bool,
    splat: Splat,
    depth: f32,
    // How far from its centre it is drawn in x and y.
    reach: vec2f,
}

// A spread below this share of the others is rounding noise.
const NOISE: f32 = 1e-14;
const HALF_LOG2_E: f32 = 0.7213475;

fn inverse_or_0(v: f32, others: f32) -> f32 {
    return select(0.0, 1.0 / v, v > NOISE * others);
}

fn is_number(v: f32) -> bool {
    return abs(v) < 3e38;
}

// A number of a Gaussian, by its column.
fn number_of(i: u32, n: u32, column: u32) -> f32 {
    return bitcast<f32>(gaussians[i + column * n]);
}

// From the eye to a Gaussian, in the camera's axes: rounded once, from what it is to 2^-40.
fn from_eye(i: u32, n: u32) -> vec3f {
    var away: array<vec2u, 3>;
    for (var k = 0u; k < 3u; k++) {
        let mean = vec2u(gaussians[i + 2u * k * n], gaussians[i + (2u * k + 1u) * n]);
        away[k] = plus(mean, frame.to_middle[k].xy);
    }
    var mean: vec3f;
    for (var row = 0u; row < 3u; row++) {
        var sum = vec2u(0u);
        for (var k = 0u; k < 3u; k++) {
            let axis = frame.axes[3u * row + k];
            let part = axis_product(magnitude(away[k]), axis.xy);
            sum = plus(sum, negate_if(part, is_negative(away[k]) != (axis.z == 1u)));
        }
        mean[row] = to_float(sum);
    }
    return mean;
}

// A Gaussian of the columns: two words of each coordinate, six of the factor of the covariance (xx, yx, yy, zx, zy, zz;
// lower triangle), the odds against its opacity, its grey level; then what the network reads.
fn camera_gaussian(i: u32, n: u32) -> GreyCameraGaussian {
    // Columns of the factor; those of its rows in the camera's axes are orthogonalised, depth first, which squares nothing
    // that is a difference.
    let factors = bent[i];
    let a = factors.x * vec3f(number_of(i, n, 6u), number_of(i, n, 7u), number_of(i, n, 9u));
    let b = factors.x * vec3f(0.0, number_of(i, n, 8u), number_of(i, n, 10u));
    let c = factors.x * vec3f(0.0, 0.0, number_of(i, n, 11u));
    let x = vec3f(dot(frame.right.xyz, a), dot(frame.right.xyz, b), dot(frame.right.xyz, c));
    let y = vec3f(dot(frame.down.xyz, a), dot(frame.down.xyz, b), dot(frame.down.xyz, c));
    let z = vec3f(dot(frame.forward.xyz, a), dot(frame.forward.xyz, b), dot(frame.forward.xyz, c));
    let zz = dot(z, z);
    let slope = vec2f(dot(x, z), dot(y, z)) * inverse_or_0(zz, dot(x, x) + dot(y, y));
    let rest_x = x - slope.x * z;
    let rest_y = y - slope.y * z;
    let yy = dot(rest_y, rest_y);
    let lean = dot(rest_x, rest_y) * inverse_or_0(yy, dot(rest_x, rest_x));
    let left = rest_x - lean * rest_y;
    var g: GreyCameraGaussian;
    g.mean = from_eye(i, n);
    g.depth = zz;
    g.slope = slope;
    g.down = yy;
    g.lean = lean;
    g.across = dot(left, left);
    g.opacity = 1.0 / (1.0 + number_of(i, n, 12u) / factors.y);
    g.grey = number_of(i, n, 13u);
    return g;
}

// The footprint; it is not seen outside the range of depths, where it is too faint, and where a number is not one.
fn project(g: GreyCameraGaussian) -> ProjectedSplat {
    var p: ProjectedSplat;
    p.seen = false;
    let depth = g.mean.z;
    if !(depth > frame.range.x && depth <= frame.range.y) {
        return p;
    }
    let toward = g.mean.xy / depth;
    // What a step in depth moves on the picture, beside what is left at a given depth.
    let s = g.slope - clamp(toward, -frame.guard, frame.guard);
    let unit = frame.focal / depth;
    let unit2 = unit * unit;
    let zz = g.depth;
    let xx = unit2 * (g.across + g.lean * g.lean * g.down + s.x * s.x * zz);
    let xy = unit2 * (g.lean * g.down + s.x * s.y * zz);
    let yy = unit2 * (g.down + s.y * s.y * zz);
    let skew = s.x - g.lean * s.y;
    let across = unit2 * g.across;
    let sharp_det = across * (unit2 * g.down) + (unit2 * zz) * (across * s.y * s.y + unit2 * g.down * skew * skew);
    // Of what is widened along both axes: no difference, as wide xx times wide yy less xy^2 would be.
    let wide_det = sharp_det + frame.low_pass * (xx + yy) + frame.low_pass * frame.low_pass;
    let wide = vec2f(xx, yy) + frame.low_pass;
    let at = frame.center + frame.focal * toward;
    let peak = g.opacity * sqrt(max(sharp_det / wide_det, frame.least_ratio));
    if !(peak >= frame.least_alpha && is_number(at.x) && is_number(at.y) && is_number(wide_det)) {
        return p;
    }
    let end = log2(frame.least_alpha / peak);
    p.seen = true;
    p.splat = Splat(
        at,
        xy / wide.y,
        -HALF_LOG2_E * wide.y / wide_det,
        -HALF_LOG2_E / wide.y,
        peak,
        end,
        g.grey,
    );
    p.depth = depth;
    p.reach = sqrt(wide * max(-end, 0.0) / HALF_LOG2_E);
    return p;
}
