// The rows of a workgroup's strokes, one Gaussian or piece a thread, and the pixels of a row.

// The workgroup's strokes.
var<workgroup> strokes_here: array<RasterSplat, 64>;
var<workgroup> planes_here: array<u32, 64>;

// Where the rows of each stroke end among those of all.
const ROWS: u32 = 0u;

// The first row and the number of rows.
fn rows_of(s: RasterSplat, plane: u32) -> vec2u {
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
