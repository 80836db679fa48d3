// Gaussians of the world to footprints on the picture plane: core's render::project in f32. What is a difference of large
// numbers there is written here without one.

// A Gaussian in the camera's axes, relative to the eye.
struct CameraGaussian {
    mean: vec3f,
    // Variance of depth.
    depth: f32,
    // Change of x and y with depth.
    slope: vec2f,
    // Variance of y at a given depth; change of x with y there; variance of x at a given depth and y.
    down: f32,
    lean: f32,
    across: f32,
    // What it adds to the sum over pixels, times depth squared in perspective.
    weight: f32,
}

// A Gaussian, or a piece of one, on the picture plane.
struct Footprint {
    // Pixels from the left and the top; pixel centres have whole coordinates.
    mean: vec2f,
    // Variance of y; change of x with y; variance of x at a given y.
    down: f32,
    lean: f32,
    across: f32,
    // Its sum over pixels.
    sum: f32,
}

// Moments of the inverse depth s over (a part of) a Gaussian, weighted by s^2 in perspective; of the depth without it.
struct DepthMoments {
    weight: f32,
    mean: f32,
    square: f32,
    variance: f32,
    // 1 - (mean depth) mean in perspective, mean depth - mean without: small, and found without a difference where it is.
    behind: f32,
}

const PIXEL_VARIANCE: f32 = 1.0 / 12.0;
// A Gaussian whose depth spread is a larger share of its depth is cut.
const LARGEST_SPREAD: f32 = 0.03;
// Standard deviations of depth that are looked at.
const REACH: f32 = 5.0;
// A spread below this share of the others is rounding noise.
const NOISE: f32 = 1e-14;

const WHOLE: u32 = 0u;
const CUT: u32 = 1u;
const OUTSIDE: u32 = 2u;

fn inverse_or_0(v: f32, others: f32) -> f32 {
    return select(0.0, 1.0 / v, v > NOISE * others);
}

// The camera's axes in a Gaussian's own frame, where it is round and of radius 1: what depth depends on, and what is left
// of right and down without it.
struct OwnFrameAxes {
    forward: vec3f,
    right: vec3f,
    down: vec3f,
    // Variance of depth, and its inverse where it is no rounding noise.
    depth: f32,
    inverse_depth: f32,
    // Change of x and y with depth.
    slope: vec2f,
}

// Rows of the covariance's factor in the camera's axes, orthogonalised, depth first, which squares nothing that is a
// difference.
fn own_frame_axes(lens: Lens, i: u32, n: u32) -> OwnFrameAxes {
    let a = vec3f(gaussians[i + 6u * n], gaussians[i + 7u * n], gaussians[i + 9u * n]);
    let b = vec3f(0.0, gaussians[i + 8u * n], gaussians[i + 10u * n]);
    let c = vec3f(0.0, 0.0, gaussians[i + 11u * n]);
    let x = vec3f(dot(lens.right.xyz, a), dot(lens.right.xyz, b), dot(lens.right.xyz, c));
    let y = vec3f(dot(lens.down.xyz, a), dot(lens.down.xyz, b), dot(lens.down.xyz, c));
    let z = vec3f(dot(lens.forward.xyz, a), dot(lens.forward.xyz, b), dot(lens.forward.xyz, c));
    let zz = dot(z, z);
    let inverse = inverse_or_0(zz, dot(x, x) + dot(y, y));
    let slope = vec2f(dot(x, z), dot(y, z)) * inverse;
    return OwnFrameAxes(z, x - slope.x * z, y - slope.y * z, zz, inverse, slope);
}

// A Gaussian of the columns: three of means, three of what float32 leaves of them, six of the factor of the covariance
// (xx, yx, yy, zx, zy, zz; lower triangle), one of counts.
fn camera_gaussian(lens: Lens, i: u32, n: u32) -> CameraGaussian {
    return camera_gaussian_with_axes(lens, own_frame_axes(lens, i, n), i, n);
}

fn camera_gaussian_with_axes(lens: Lens, axes: OwnFrameAxes, i: u32, n: u32) -> CameraGaussian {
    let high = vec3f(gaussians[i], gaussians[i + n], gaussians[i + 2u * n]);
    let low = vec3f(gaussians[i + 3u * n], gaussians[i + 4u * n], gaussians[i + 5u * n]);
    let from_eye = (high - lens.eye.xyz) + (low - lens.eye_low.xyz);
    let yy = dot(axes.down, axes.down);
    let lean = dot(axes.right, axes.down) * inverse_or_0(yy, dot(axes.right, axes.right));
    let left = axes.right - lean * axes.down;
    var g: CameraGaussian;
    g.mean = vec3f(dot(lens.right.xyz, from_eye), dot(lens.down.xyz, from_eye), dot(lens.forward.xyz, from_eye));
    g.depth = axes.depth;
    g.slope = axes.slope;
    g.down = yy;
    g.lean = lean;
    g.across = dot(left, left);
    g.weight = lens.unit * gaussians[i + 12u * n];
    return g;
}

// Is a Gaussian drawn whole, cut, or not at all?
fn clip_class(lens: Lens, depth: f32, variance: f32) -> u32 {
    let reach = REACH * sqrt(max(variance, 0.0));
    if depth + reach < lens.range.x || depth - reach > lens.range.y {
        return OUTSIDE;
    }
    let wide = lens.perspective == 1u && variance > LARGEST_SPREAD * LARGEST_SPREAD * depth * depth;
    if depth - reach < lens.range.x || depth + reach > lens.range.y || wide {
        return CUT;
    }
    return WHOLE;
}

// Moments of 1/d for d normal with mean `d` and (variance / mean^2) `e`, by their series in e.
fn inverse_moments(d: f32, e: f32) -> DepthMoments {
    let s = 1.0 / d;
    let m2 = 1.0 + e * (3.0 + 15.0 * e);
    let m3 = 1.0 + e * (6.0 + 45.0 * e);
    let m4 = 1.0 + e * (10.0 + 105.0 * e);
    let inverse = 1.0 / m2;
    // m4 m2 - m3^2 and m2 - m3 written out, as the differences cancel.
    let spread = e * (1.0 + e * (24.0 - e * (75.0 + 450.0 * e)));
    let behind = -e * (3.0 + 30.0 * e);
    return DepthMoments(
        m2 * s * s,
        m3 * inverse * s,
        m4 * inverse * s * s,
        max(spread, 0.0) * inverse * inverse * s * s,
        behind * inverse,
    );
}

// The moments of a Gaussian in one piece.
fn whole(lens: Lens, depth: f32, variance: f32) -> DepthMoments {
    if lens.perspective == 1u {
        return inverse_moments(depth, variance / (depth * depth));
    }
    return DepthMoments(1.0, depth, 0.0, variance, 0.0);
}

// The footprint of the part that `m` describes.
fn footprint(lens: Lens, g: CameraGaussian, m: DepthMoments) -> Footprint {
    let flat = lens.perspective == 0u;
    let carried = g.mean.xy - g.slope * g.mean.z;
    let slope = select(carried, g.slope, flat);
    // slope + (x - slope d) s = x s + slope (1 - d s), and without perspective x - slope (d - s).
    let t = select(g.mean.xy * m.mean + g.slope * m.behind, g.mean.xy - g.slope * m.behind, flat);
    let scale2 = select(m.square, 1.0, flat);
    let f2 = lens.focal * lens.focal;
    let tilt = select(vec3f(t.x * t.x, t.x * t.y, t.y * t.y), vec3f(0.0), flat);
    let round = scale2 * lens.radius2;
    let rest = vec3f(g.across + g.lean * g.lean * g.down, g.lean * g.down, g.down);
    let xx = f2 * (rest.x * scale2 + slope.x * slope.x * m.variance + round * (1.0 + tilt.x)) + PIXEL_VARIANCE;
    let xy = f2 * (rest.y * scale2 + slope.x * slope.y * m.variance + round * tilt.y);
    let yy = f2 * (rest.z * scale2 + slope.y * slope.y * m.variance + round * (1.0 + tilt.z)) + PIXEL_VARIANCE;
    let lean = xy / yy;
    // What a long footprint leaves of its width is a difference of large numbers: as the sum of the determinants of its
    // parts, each of which is a square or a product of squares, it is none.
    let q = slope * sqrt(m.variance) * lens.focal;
    let d = lens.focal * sqrt(scale2);
    let across2 = d * d * g.across;
    let down2 = d * d * g.down;
    let lean_q = q.x - g.lean * q.y;
    let r = f2 * round;
    let u = vec3f(r * (1.0 + tilt.x) + PIXEL_VARIANCE, r * tilt.y, r * (1.0 + tilt.z) + PIXEL_VARIANCE);
    let det_u = r * r * (1.0 + tilt.x + tilt.z) + r * PIXEL_VARIANCE * (2.0 + tilt.x + tilt.z)
        + PIXEL_VARIANCE * PIXEL_VARIANCE;
    let det = across2 * down2 + down2 * lean_q * lean_q + across2 * q.y * q.y + det_u
        + across2 * u.z + down2 * (g.lean * g.lean * u.z - 2.0 * g.lean * u.y + u.x)
        + q.x * q.x * u.z - 2.0 * q.x * q.y * u.y + q.y * q.y * u.x;
    var f: Footprint;
    f.mean = lens.center + lens.focal * t;
    f.down = yy;
    f.lean = lean;
    f.across = det / yy;
    f.sum = g.weight * m.weight;
    return f;
}
