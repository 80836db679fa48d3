// Draws the strokes of a workgroup on their planes, one Gaussian or piece a thread: their rows become spans of pixels, and
// pixels, whosesoever they are, are shared out evenly among the threads. Sums are of whole numbers, so that no order of
// adding shows.

// A row of a stroke: the sum that its first pixel adds to, and how it starts.
struct Span {
    start: vec2f,
    at: u32,
    stroke: u32,
}
var<workgroup> spans: array<Span, 64>;

// Where the pixels of each span end among those of all.
const SPANS: u32 = 64u;

// All threads of a workgroup draw what they have brought: a stroke each, or NOWHERE.
fn draw(me: u32, stroke: RasterSplat, plane: u32) {
    strokes_here[me] = stroke;
    planes_here[me] = plane;
    running_sum(ROWS, me, rows_of(stroke, plane).y);
    let rows = workgroupUniformLoad(&ends[ROWS + 63u]);
    let others = finest_words();
    for (var base = 0u; base < rows; base += THREADS) {
        var count = 0u;
        if base + me < rows {
            let own = owner(ROWS, base + me);
            let s = strokes_here[own];
            let row = within(ROWS, own, base + me);
            let span = span_of(own, row);
            let y = rows_of(s, planes_here[own]).x + row;
            let level = frame.levels[planes_here[own]];
            spans[me] = Span(row_start(s, span.x, y), level.first + y * level.width + span.x, own);
            count = span.y;
        }
        running_sum(SPANS, me, count);
        let pixels = workgroupUniformLoad(&ends[SPANS + 63u]);
        for (var pixel = me; pixel < pixels; pixel += THREADS) {
            let own = owner(SPANS, pixel);
            let along = within(SPANS, own, pixel);
            let span = spans[own];
            let value = addition(strokes_here[span.stroke], span.start, along, scales[planes_here[span.stroke]].up);
            if value > 0u {
                let at = span.at + along;
                if at < others {
                    atomicAdd(&finest[at], value);
                } else {
                    atomicAdd(&coarser[at - others], value);
                }
            }
        }
        workgroupBarrier();
    }
}
