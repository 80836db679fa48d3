// What strokes gather of a gradient: particlegs-train's depth::gather.

// Sums over a stroke's pixels of gradient times 2^power: times 1, u, u^2, v, u v, v^2; u along the row from its centre, v
// down.
struct GradientMoments {
    one: f32,
    u: f32,
    uu: f32,
    v: f32,
    uv: f32,
    vv: f32,
}

// The first three of each row that is gathered at once, and its v.
var<workgroup> rows_here: array<vec4f, 64>;

fn gather_row(stroke: u32, row: u32) -> vec4f {
    let s = strokes_here[stroke];
    let level = frame.levels[planes_here[stroke]];
    let span = span_of(stroke, row);
    let y = rows_of(s, planes_here[stroke]).x + row;
    let dy = f32(y) - s.y;
    let fall = s.down * (dy * dy);
    let first = f32(span.x) - (s.x + s.slope * dy);
    var sums = vec3f(0.0);
    for (var k = 0u; k < span.y; k++) {
        let dx = first + f32(k);
        let power = dx * dx * s.along + fall;
        if power >= s.end {
            let value = exp2(power) * by_depth[level.first + y * level.width + span.x + k];
            sums += value * vec3f(1.0, dx, dx * dx);
        }
    }
    return vec4f(sums, dy);
}

// All threads of a workgroup gather for what they have brought: a stroke each, or NOWHERE. Rows are shared out among them,
// and each sums its own in their order.
fn gather(me: u32, stroke: RasterSplat, plane: u32) -> GradientMoments {
    strokes_here[me] = stroke;
    planes_here[me] = plane;
    running_sum(ROWS, me, rows_of(stroke, plane).y);
    let rows = workgroupUniformLoad(&ends[ROWS + 63u]);
    var own = 0u;
    if me > 0u {
        own = ends[ROWS + me - 1u];
    }
    let own_end = ends[ROWS + me];
    var g: GradientMoments;
    for (var base = 0u; base < rows; base += THREADS) {
        if base + me < rows {
            let stroke_of_row = owner(ROWS, base + me);
            rows_here[me] = gather_row(stroke_of_row, within(ROWS, stroke_of_row, base + me));
        }
        workgroupBarrier();
        for (; own < min(own_end, base + THREADS); own++) {
            let row = rows_here[own - base];
            g.one += row.x;
            g.u += row.y;
            g.uu += row.z;
            g.v += row.x * row.w;
            g.uv += row.y * row.w;
            g.vv += row.x * row.w * row.w;
        }
        workgroupBarrier();
    }
    workgroupBarrier();
    return g;
}
