// A splat's quad on the screen: which pixel centres it covers and what its alpha is there: particlegs' reference::quad.

// a + d x + e y, of u and of v.
struct QuadPlanes {
    u: vec3f,
    v: vec3f,
}

// Rows of pixels count from the bottom, as in VTK's framebuffer.
struct Quad {
    // Of its two triangles, below and above the diagonal.
    planes: array<QuadPlanes, 2>,
    // Snapped corners (-,-), (+,-), (-,+), (+,+) in (u, v), in 1/256 of a pixel, pixel centres at whole pixels.
    corners: array<vec2i, 4>,
    // First pixel of its box, clamped to the strip of the picture, and how many columns and rows that has.
    low: vec2u,
    extent: vec2u,
    depth: f32,
    aligned: u32,
}

const CUT: f32 = 3.0;
// Corners farther out lie millions of pixels outside the picture; so near, differences fit a word.
const FARTHEST: f32 = 1073741000.0;

fn snap(window: f32) -> i32 {
    return i32(clamp(round(times(minus(window, 0.5), 256.0)), -FARTHEST, FARTHEST));
}

// First pixel whose centre is at or beyond a snapped coordinate.
fn first_pixel(snapped: i32) -> i32 {
    return (snapped >> 8u) + i32((snapped & 255) != 0);
}

// (u, v) of a corner, in the order of VTK's triangle strip.
fn offset(corner: u32) -> vec2f {
    return vec2f(select(-CUT, CUT, (corner & 1u) == 1u), select(-CUT, CUT, corner >= 2u));
}

// Where a corner is in the window.
fn window_of(s: NdcSplat, corner: u32) -> vec2f {
    let half = 0.5 * vec2f(view.size);
    let o = offset(corner);
    let x = plus(s.at.x, plus(times(s.axes.x, o.x), times(s.axes.y, o.y)));
    let y = plus(s.at.y, plus(times(s.axes.z, o.x), times(s.axes.w, o.y)));
    return vec2f(plus(times(x, half.x), half.x), plus(times(y, half.y), half.y));
}

// Without pixels where it covers no pixel centre.
fn quad_of(s: NdcSplat) -> Quad {
    var q: Quad;
    if !s.seen {
        return q;
    }
    var window: array<vec2f, 4>;
    for (var k = 0u; k < 4u; k++) {
        window[k] = window_of(s, k);
        q.corners[k] = vec2i(snap(window[k].x), snap(window[k].y));
    }
    let least = min(min(q.corners[0], q.corners[1]), min(q.corners[2], q.corners[3]));
    let most = max(max(q.corners[0], q.corners[1]), max(q.corners[2], q.corners[3]));
    let is_aligned = s.axes.y == 0.0 && s.axes.z == 0.0;
    // Of a rotated quad's box the edges tell which pixels are in; the far side may be one of them.
    let more = select(1, 0, is_aligned);
    let start = vec2i(0, i32(view.strip.x));
    let end = vec2i(i32(view.size.x), i32(view.strip.y));
    let low = clamp(vec2i(first_pixel(least.x), first_pixel(least.y)), start, end);
    let high = min(vec2i(first_pixel(most.x) + more, first_pixel(most.y) + more), end);
    if any(low >= high) {
        return q;
    }
    q.low = vec2u(low);
    q.extent = vec2u(high - low);
    q.depth = s.depth;
    q.aligned = u32(is_aligned);
    // The order matters to float32: the first vertex is the one that planes start from.
    q.planes[0] = planes_of(vec3u(1u, 2u, 0u), window[1], window[2], window[0]);
    q.planes[1] = planes_of(vec3u(1u, 3u, 2u), window[1], window[3], window[2]);
    return q;
}

fn planes_of(corner: vec3u, a: vec2f, b: vec2f, c: vec2f) -> QuadPlanes {
    let first = vec2f(minus(a.x, b.x), minus(a.y, b.y));
    let third = vec2f(minus(c.x, a.x), minus(c.y, a.y));
    let inverse = over(1.0, minus(times(first.x, third.y), times(first.y, third.x)));
    let d01 = vec2f(times(first.x, inverse), times(first.y, inverse));
    let d20 = vec2f(times(third.x, inverse), times(third.y, inverse));
    let center = vec2f(minus(a.x, 0.5), minus(a.y, 0.5));
    let at = offset(corner.x);
    let to = at - offset(corner.y);
    let back = offset(corner.z) - at;
    return QuadPlanes(plane_of(at.x, to.x, back.x, d01, d20, center), plane_of(at.y, to.y, back.y, d01, d20, center));
}

fn plane_of(at: f32, da01: f32, da20: f32, d01: vec2f, d20: vec2f, center: vec2f) -> vec3f {
    let dx = minus(times(da01, d20.y), times(da20, d01.y));
    let dy = minus(times(da20, d01.x), times(da01, d20.x));
    return vec3f(minus(at, plus(times(dx, center.x), times(dy, center.y))), dx, dy);
}

// A product of whole numbers below 2^31 in two words, the upper first.
fn wide(a: i32, b: i32) -> vec2u {
    let x = u32(abs(a));
    let y = u32(abs(b));
    let low = (x & 0xffffu) * (y & 0xffffu);
    let first = (x >> 16u) * (y & 0xffffu) + (low >> 16u);
    let second = (x & 0xffffu) * (y >> 16u) + (first & 0xffffu);
    let product = vec2u((x >> 16u) * (y >> 16u) + (first >> 16u) + (second >> 16u), (second << 16u) | (low & 0xffffu));
    if (a < 0) == (b < 0) {
        return product;
    }
    // Its negative.
    return vec2u(~product.x + u32(product.y == 0u), ~product.y + 1u);
}

// On which side of the way from `a` to `b` is `c`: 1 left, -1 right, 0 neither?
fn side(a: vec2i, b: vec2i, c: vec2i) -> i32 {
    let left = wide(b.x - a.x, c.y - a.y);
    let right = wide(b.y - a.y, c.x - a.x);
    if left.x != right.x {
        return select(-1, 1, bitcast<i32>(left.x) > bitcast<i32>(right.x));
    }
    return select(select(-1, 1, left.y > right.y), 0, left.y == right.y);
}

// Is a pixel's centre left of an edge, or on one that is a left or bottom edge?
fn within_edge(a: vec2i, b: vec2i, at: vec2i) -> bool {
    let e = side(a, b, at);
    return e > 0 || (e == 0 && (b.y < a.y || (b.y == a.y && b.x > a.x)));
}

// Is the centre of a pixel of its box covered?
fn covers(corners: array<vec2i, 4>, pixel: vec2u) -> bool {
    let at = vec2i(pixel) << vec2u(8u);
    let a = corners[0];
    let c = corners[3];
    var b = corners[1];
    var d = corners[2];
    if side(a, b, c) < 0 {
        b = corners[2];
        d = corners[1];
    }
    return within_edge(a, b, at) && within_edge(b, c, at) && within_edge(c, d, at) && within_edge(d, a, at);
}

// Which of the two triangles a covered pixel centre lies in.
fn triangle(own: u32, pixel: vec2u) -> u32 {
    return u32(side(quads[own].corners[1], quads[own].corners[2], vec2i(pixel) << vec2u(8u)) <= 0);
}

// A value of a plane at a pixel.
fn on_plane(p: vec3f, pixel: vec2f) -> f32 {
    return exact_fma(p.z, pixel.y, exact_fma(p.y, pixel.x, p.x));
}

// The alpha of a covered pixel.
fn alpha_of(own: u32, pixel: vec2u) -> f32 {
    let planes = quads[own].planes[triangle(own, pixel)];
    let u = on_plane(planes.u, vec2f(pixel));
    let v = on_plane(planes.v, vec2f(pixel));
    return times(view.opacity, exp2_of(times(LOG2_E, times(-0.5, sum_of_squares(u, v)))));
}

const LOG2_E: f32 = 1.4426950408889634;
// 1.5 * 2^23: what is added to it is rounded to a whole number.
const ROUNDER: f32 = 12582912.0;

// Mesa's 2^x for x <= 0: integer part by exponent, fraction by a quintic.
fn exp2_of(power: f32) -> f32 {
    let x = max(power, -126.99999);
    var whole = minus(plus(x, ROUNDER), ROUNDER);
    if whole > x {
        whole = minus(whole, 1.0);
    }
    let f = minus(x, whole);
    let f2 = times(f, f);
    let even = exact_fma(f2, exact_fma(f2, 0.00898934, 0.24015362), 1.0);
    let odd = exact_fma(f2, exact_fma(f2, 0.0018775767, 0.055826318), 0.6931531);
    return times(exact_fma(odd, f, even), bitcast<f32>(u32(i32(whole) + 127) << 23u));
}
