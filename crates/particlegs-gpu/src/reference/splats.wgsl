// Particles to splats in pixels, rows downward: particlegs' reference::project and ::depth, in float32 as VTK's shaders
// compute them.

// Centre, and how far one deviation of u and of v moves: u by (a, c), v by (b, d). No reach = nothing to draw.
struct PixelSplat {
    at: vec2f,
    axes: vec4f,
}

// Centres farther outside the picture than this share of its half are dropped with their splat.
const FRUSTUM_MARGIN: f32 = 1.3;
// Off-diagonal covariances up to this are ignored: the splat stays axis-aligned.
const DIAGONAL_LIMIT: f32 = 1e-6;
const CUT: f32 = 3.0;
// Splats up to this deviation reach two pixels along an axis at most.
const SMALL_SIGMA: f32 = 1.0 / 6.0;

fn is_aligned(s: PixelSplat) -> bool {
    return s.axes.y == 0.0 && s.axes.z == 0.0;
}

// How far the square of three deviations reaches along x and y.
fn reach(s: PixelSplat) -> vec2f {
    return CUT * vec2f(abs(s.axes.x) + abs(s.axes.y), abs(s.axes.z) + abs(s.axes.w));
}

fn is_small(s: PixelSplat) -> bool {
    return is_aligned(s) && s.axes.x <= SMALL_SIGMA && s.axes.w <= SMALL_SIGMA;
}

fn splat_of(v: View, p: vec3f) -> PixelSplat {
    var none: PixelSplat;
    let camera = vec3f(
        ((v.rows[0].x * p.x + v.rows[0].y * p.y) + v.rows[0].z * p.z) + v.rows[0].w,
        ((v.rows[1].x * p.x + v.rows[1].y * p.y) + v.rows[1].z * p.z) + v.rows[1].w,
        ((v.rows[2].x * p.x + v.rows[2].y * p.y) + v.rows[2].z * p.z) + v.rows[2].w,
    );
    let clip = vec4f(v.projection.xy * camera.xy, v.projection.z * camera.z + v.projection.w, -camera.z);
    let limit = FRUSTUM_MARGIN * clip.w;
    if !(all(abs(clip.xy) <= vec2f(limit)) && abs(clip.z / clip.w) <= 1.0) {
        return none;
    }
    let iz = 1.0 / camera.z;
    let j = v.projection.xy * iz;
    let k = -(v.projection.xy * camera.xy) * (iz * iz);
    let r2 = v.radius * v.radius;
    let c00 = r2 * (j.x * j.x + k.x * k.x);
    let c11 = r2 * (j.y * j.y + k.y * k.y);
    let c01 = r2 * (k.x * k.y);
    let half = 0.5 * vec2f(v.size);
    var s: PixelSplat;
    // Rows go down: y, and with it how both axes move along it, is turned round.
    s.at = vec2f((clip.x / clip.w + 1.0) * half.x, (1.0 - clip.y / clip.w) * half.y);
    if abs(c01) <= DIAGONAL_LIMIT {
        s.axes = vec4f(sqrt(c00) * half.x, 0.0, 0.0, sqrt(c11) * half.y);
    } else {
        let half_trace = 0.5 * (c00 + c11);
        let term = sqrt(half_trace * half_trace - (c00 * c11 - c01 * c01));
        let e = vec2f(half_trace + term, half_trace - term);
        let u = normalize(vec2f(e.x - c11, c01));
        let sides = sqrt(e);
        s.axes = vec4f(sides.x * u.x, sides.y * u.y, -sides.x * u.y, sides.y * u.x) * vec4f(half.xx, half.yy);
    }
    let away = reach(s);
    let inside = all(s.at + away > vec2f(0.0)) && all(s.at - away < vec2f(v.size)) && all(away > vec2f(0.0));
    // What is not a number, as VTK's root may be, is not drawn.
    if !inside || !all(abs(away) < vec2f(3e38)) {
        return none;
    }
    return s;
}
