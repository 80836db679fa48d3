// Particles to splats in device coordinates, y up: particlegs' reference::project.

struct NdcSplat {
    at: vec2f,
    // Window depth, from 0 to 1.
    depth: f32,
    // Is there something to draw?
    seen: bool,
    // One deviation of u moves by axes.xz, of v by axes.yw.
    axes: vec4f,
}

// Centres farther outside the picture than this share of its half are dropped with their splat.
const FRUSTUM_MARGIN: f32 = 1.3;
// Off-diagonal covariances up to this are ignored: the splat stays axis-aligned.
const DIAGONAL_LIMIT: f32 = 1e-6;

fn row_of(m: vec4f, p: vec3f) -> f32 {
    return plus(plus(plus(times(m.x, p.x), times(m.y, p.y)), times(m.z, p.z)), m.w);
}

fn sum_of_squares(a: f32, b: f32) -> f32 {
    return plus(times(a, a), times(b, b));
}

fn splat_of(p: vec3f) -> NdcSplat {
    var s: NdcSplat;
    if !(is_finite(p.x) && is_finite(p.y) && is_finite(p.z)) {
        return s;
    }
    let x = row_of(view.rows[0], p);
    let y = row_of(view.rows[1], p);
    let z = row_of(view.rows[2], p);
    let cx = times(view.projection.x, x);
    let cy = times(view.projection.y, y);
    let cz = plus(times(view.projection.z, z), view.projection.w);
    let cw = -z;
    let limit = times(FRUSTUM_MARGIN, cw);
    // Behind the eye the limit is negative.
    if !(abs(cx) <= limit && abs(cy) <= limit && cw > 0.0) {
        return s;
    }
    let depth = over(cz, cw);
    if !(abs(depth) <= 1.0) {
        return s;
    }
    let iz = over(1.0, z);
    let iz2 = times(iz, iz);
    let jx = times(view.projection.x, iz);
    let jy = times(view.projection.y, iz);
    let kx = times(-cx, iz2);
    let ky = times(-cy, iz2);
    let r2 = times(view.radius, view.radius);
    s.at = vec2f(over(cx, cw), over(cy, cw));
    s.depth = plus(times(depth, 0.5), 0.5);
    return with_axes(s, times(r2, sum_of_squares(jx, kx)), times(r2, sum_of_squares(jy, ky)), times(r2, times(kx, ky)));
}

// With the half-axes of a covariance; where VTK's root is not a number nothing is drawn.
fn with_axes(splat: NdcSplat, c00: f32, c11: f32, c01: f32) -> NdcSplat {
    var s = splat;
    if abs(c01) <= DIAGONAL_LIMIT {
        s.axes = vec4f(root(c00), 0.0, 0.0, root(c11));
    } else {
        let half_trace = times(0.5, plus(c00, c11));
        let determinant = minus(times(c00, c11), times(c01, c01));
        let square = minus(times(half_trace, half_trace), determinant);
        if square < 0.0 {
            return s;
        }
        let term = root(square);
        let e1 = plus(half_trace, term);
        let e2 = minus(half_trace, term);
        let x = minus(e1, c11);
        let length = over(1.0, root(sum_of_squares(x, c01)));
        if e2 < 0.0 {
            return s;
        }
        let ux = times(x, length);
        let uy = times(c01, length);
        let s1 = root(e1);
        let s2 = root(e2);
        s.axes = vec4f(times(s1, ux), times(s2, uy), times(s1, uy), times(-s2, ux));
    }
    s.seen = is_finite(s.axes.x) && is_finite(s.axes.y) && is_finite(s.axes.z) && is_finite(s.axes.w);
    return s;
}
