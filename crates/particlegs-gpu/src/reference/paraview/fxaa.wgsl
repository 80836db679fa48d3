// FXAA as VTK runs it with ParaView's settings, on 8-bit levels: particlegs' reference::fxaa. Luminosities are float32:
// their roundings decide ties.

@group(0) @binding(0) var<uniform> view: View;
// Four a word.
@group(0) @binding(1) var<storage, read> levels: array<u32>;

const RELATIVE_THRESHOLD: f32 = 0.125;
const HARD_THRESHOLD: f32 = 0.045;
const BLEND_LIMIT: f32 = 0.75;
const SUBPIXEL_THRESHOLD: f32 = 0.25;
const SEARCH_STEPS: i32 = 12;

// An edge, as seen from a pixel that lies on it.
struct Edge {
    pixel: vec2i,
    // The step to the other side.
    across: vec2i,
    // The pixel's luminosity and the other side's.
    own: f32,
    other: f32,
}

// Where a span ends: the luminosity there in the pixel's line, and how many steps away.
struct EdgeEnd {
    luminosity: f32,
    steps: i32,
}

fn level(at: vec2i) -> u32 {
    let p = vec2u(clamp(at, vec2i(0), vec2i(view.size) - 1));
    let k = p.y * view.size.x + p.x;
    return (levels[k / 4u] >> (8u * (k % 4u))) & 255u;
}

fn value(at: vec2i) -> f32 {
    return to_float(level(at));
}

// In Mesa's order of additions.
fn lum(at: vec2i) -> f32 {
    let v = value(at);
    return plus(plus(times(v, 0.114), times(v, 0.587)), times(v, 0.299));
}

fn apart(a: f32, b: f32) -> f32 {
    return abs(minus(a, b));
}

fn bend(a: f32, middle: f32, b: f32) -> f32 {
    return abs(plus(times(-2.0, middle), plus(a, b)));
}

// One pixel. North is the row below (VTK's y points up, the picture's rows go down).
fn filtered(at: vec2i) -> u32 {
    let c = lum(at);
    let n = lum(at + vec2i(0, 1));
    let s = lum(at - vec2i(0, 1));
    let w = lum(at - vec2i(1, 0));
    let e = lum(at + vec2i(1, 0));
    let most = max(c, max(max(n, s), max(w, e)));
    let range = minus(most, min(c, min(min(n, s), min(w, e))));
    if range < max(HARD_THRESHOLD, times(RELATIVE_THRESHOLD, most)) {
        return level(at);
    }
    let subpixel = apart(times(0.25, plus(plus(n, s), plus(w, e))), c);
    let excess = max(minus(over(subpixel, range), SUBPIXEL_THRESHOLD), 0.0);
    let blend = min(times(excess, 1.0 / (1.0 - SUBPIXEL_THRESHOLD)), BLEND_LIMIT);
    let moved = on_edge(at, c, vec4f(n, s, w, e));
    let mixed = plus(moved, times(blend, minus(average(at), moved)));
    return u32(round(times(clamp(mixed, 0.0, 1.0), 255.0)));
}

// Mean of the 3x3 neighbourhood, in VTK's order.
fn average(at: vec2i) -> f32 {
    var sum = 0.0;
    for (var dy = 1; dy >= -1; dy--) {
        for (var dx = -1; dx <= 1; dx++) {
            sum = plus(sum, value(at + vec2i(dx, dy)));
        }
    }
    return times(sum, 1.0 / 9.0);
}

// The pixel's value moved towards the other side of the edge it lies on.
fn on_edge(at: vec2i, c: f32, nswe: vec4f) -> f32 {
    let ne = lum(at + vec2i(1, 1));
    let se = lum(at + vec2i(1, -1));
    let nw = lum(at + vec2i(-1, 1));
    let sw = lum(at - vec2i(1, 1));
    let vertical = plus(plus(times(2.0, bend(nswe.z, c, nswe.w)), bend(nw, nswe.x, ne)), bend(sw, nswe.y, se));
    let horizontal = plus(plus(times(2.0, bend(nswe.x, c, nswe.y)), bend(nw, nswe.z, sw)), bend(ne, nswe.w, se));
    // The division by 12 rounds: it makes ties, and ties are horizontal.
    let is_horizontal = over(horizontal, 12.0) >= over(vertical, 12.0);
    let pair = select(nswe.zw, nswe.xy, is_horizontal);
    let towards_second = apart(c, pair.x) < apart(c, pair.y);
    let other = select(pair.x, pair.y, towards_second);
    let to_side = select(-1, 1, towards_second);
    // Steps along the span and across it; across is upwards in VTK, downwards in rows.
    let along = select(vec2i(0, -1), vec2i(1, 0), is_horizontal);
    let across = select(vec2i(to_side, 0), vec2i(0, -to_side), is_horizontal);
    let edge = Edge(at, across, c, other);
    let back = walk(edge, -along);
    let ahead = walk(edge, along);
    var near = ahead;
    if back.steps < ahead.steps {
        near = back;
    }
    if apart(near.luminosity, other) < apart(near.luminosity, c) {
        let shift = minus(0.5, over(f32(near.steps), f32(back.steps + ahead.steps)));
        // The texture unit's position is upward and rightward.
        return to_float(between(level(at), level(at + across), shift, to_side > 0));
    }
    return value(at);
}

// Where the span of an edge ends in steps of `along`.
fn walk(edge: Edge, along: vec2i) -> EdgeEnd {
    var here = 0.0;
    for (var k = 1; k <= SEARCH_STEPS; k++) {
        let at = edge.pixel + k * along;
        here = lum(at);
        let there = lum(at + edge.across);
        if apart(there, edge.other) > apart(there, edge.own) || apart(here, edge.own) > apart(here, edge.other) {
            return EdgeEnd(here, k);
        }
    }
    return EdgeEnd(here, SEARCH_STEPS + 1);
}

// The texture `shift` of the way from one texel to a neighbour, as the texture unit blends bytes: the way in 1/256, the
// later texel weighted by it, one rounding.
fn between(here: u32, there: u32, shift: f32, there_is_later: bool) -> u32 {
    let way = i32(round(times(shift, 256.0)));
    if way == 0 {
        return here;
    }
    let first = i32(select(there, here, there_is_later));
    let second = i32(select(here, there, there_is_later));
    let weight = select(256 - way, way, there_is_later);
    return u32(first + ((weight * (second - first) + 128) >> 8u));
}
