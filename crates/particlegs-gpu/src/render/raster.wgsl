// Draws the strokes of a workgroup on their planes, one Gaussian or piece a thread: their rows become spans of pixels, and
// pixels, whosesoever they are, are shared out evenly among the threads. Sums are of whole numbers, so that no order of
// adding shows.

// The workgroup's strokes.
var<workgroup> strokes_here: array<Stroke, 64>;
var<workgroup> planes_here: array<u32, 64>;

// A row of a stroke: the sum that its first pixel adds to, the way from the centre to there, and the row's own fall.
struct Span {
    at: u32,
    dx: f32,
    fall: f32,
    stroke: u32,
}
var<workgroup> spans: array<Span, 64>;

// Where the rows of each stroke end among those of all, and where the pixels of each span do.
const ROWS: u32 = 0u;
const SPANS: u32 = 64u;

// The first row and the number of rows.
fn rows_of(s: Stroke, plane: u32) -> vec2u {
    if plane == NOWHERE {
        return vec2u(0u);
    }
    let top = max(ceil(s.y - s.half), 0.0);
    let bottom = min(floor(s.y + s.half), f32(frame.levels[plane].rows) - 1.0);
    return vec2u(u32(top), u32(max(bottom - top + 1.0, 0.0)));
}

// A stroke's row: where its pixels begin, and how many there are.
fn span_of(stroke: u32, row: u32) -> vec2u {
    let s = strokes_here[stroke];
    let plane = frame.levels[planes_here[stroke]];
    let y = f32(rows_of(s, planes_here[stroke]).x + row);
    let dy = y - s.y;
    let fall = s.down * (dy * dy);
    let left = (s.end - fall) / s.along;
    if left < 0.0 {
        return vec2u(0u);
    }
    let center = s.x + s.slope * dy;
    let half = sqrt(left);
    let left_edge = max(ceil(center - half), 0.0);
    let right_edge = min(floor(center + half), f32(plane.width) - 1.0);
    if right_edge < left_edge {
        return vec2u(0u);
    }
    return vec2u(u32(left_edge), u32(right_edge - left_edge) + 1u);
}

// All threads of a workgroup draw what they have brought: a stroke each, or NOWHERE.
fn draw(me: u32, stroke: Stroke, plane: u32, scale: f32) {
    strokes_here[me] = stroke;
    planes_here[me] = plane;
    running_sum(ROWS, me, rows_of(stroke, plane).y);
    let rows = workgroupUniformLoad(&ends[ROWS + 63u]);
    for (var base = 0u; base < rows; base += THREADS) {
        var count = 0u;
        if base + me < rows {
            let own = owner(ROWS, base + me);
            let s = strokes_here[own];
            let row = within(ROWS, own, base + me);
            let span = span_of(own, row);
            let y = rows_of(s, planes_here[own]).x + row;
            let dy = f32(y) - s.y;
            let level = frame.levels[planes_here[own]];
            let dx = f32(span.x) - (s.x + s.slope * dy);
            spans[me] = Span(level.first + y * level.width + span.x, dx, s.down * (dy * dy), own);
            count = span.y;
        }
        running_sum(SPANS, me, count);
        let pixels = workgroupUniformLoad(&ends[SPANS + 63u]);
        for (var pixel = me; pixel < pixels; pixel += THREADS) {
            let own = owner(SPANS, pixel);
            let along = within(SPANS, own, pixel);
            let span = spans[own];
            let s = strokes_here[span.stroke];
            let dx = span.dx + f32(along);
            let power = dx * dx * s.along + span.fall;
            let value = u32(exp2(power) * s.peak * scale + 0.5);
            if power >= s.end && value > 0u {
                atomicAdd(&sums[span.at + along], value);
            }
        }
        workgroupBarrier();
    }
}
