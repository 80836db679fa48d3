// Sums a tile's list, a tile a workgroup and a pixel a thread: the whole numbers that raster.wgsl adds, without atomics.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> strokes: array<RasterSplat>;
@group(0) @binding(2) var<storage, read> ends: array<u32>;
@group(0) @binding(3) var<storage, read> entries: array<u32>;
@group(0) @binding(4) var<storage, read> scales: array<Scale>;
@group(0) @binding(5) var<storage, read_write> finest: array<u32>;
@group(0) @binding(6) var<storage, read_write> coarser: array<u32>;

// A row of a stroke within the tile: its first pixel and the one beyond its last, and how it starts.
struct Row {
    start: vec2f,
    first: u32,
    end: u32,
}
// Of 64 strokes at a time: their first rows in the tile, their second ones, and so on.
var<workgroup> rows: array<Row, 512>;
// Where the tile's list begins and ends.
var<workgroup> list_here: vec2u;

fn list_of(tile: u32) -> vec2u {
    if tile >= arrayLength(&ends) {
        return vec2u(0u);
    }
    if tile == 0u {
        return vec2u(0u, ends[0]);
    }
    return vec2u(ends[tile - 1u], ends[tile]);
}

// The row `y` of a stroke of the workgroup.
fn row_of(own: u32, y: u32) -> Row {
    let s = strokes_here[own];
    let all = rows_of(s, planes_here[own]);
    if y < all.x || y - all.x >= all.y {
        return Row();
    }
    let span = span_of(own, y - all.x);
    return Row(row_start(s, span.x, y), span.x, span.x + span.y);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let tile = group.y * groups.x + group.x;
    if me == 0u {
        list_here = list_of(tile);
    }
    let list = workgroupUniformLoad(&list_here);
    let place = tile_place(tile);
    let plane = frame.levels[place.x];
    let pixel = SIDE * place.yz + vec2u(me % SIDE, me / SIDE);
    var sum = 0u;
    for (var base = list.x; base < list.y; base += 64u) {
        planes_here[me] = NOWHERE;
        if base + me < list.y {
            strokes_here[me] = strokes[entries[base + me]];
            planes_here[me] = place.x;
        }
        for (var k = 0u; k < SIDE; k++) {
            rows[64u * k + me] = row_of(me, SIDE * place.z + k);
        }
        workgroupBarrier();
        let count = min(list.y - base, 64u);
        for (var own = 0u; own < count; own++) {
            let row = rows[64u * (me / SIDE) + own];
            if pixel.x >= row.first && pixel.x < row.end {
                sum += addition(strokes_here[own], row.start, pixel.x - row.first, scales[place.x].up);
            }
        }
        workgroupBarrier();
    }
    // Tiles at the edges reach beyond their plane, where nothing is added.
    let at = plane.first + pixel.y * plane.width + pixel.x;
    if sum > 0u && place.x == 0u {
        finest[at] += sum;
    } else if sum > 0u {
        coarser[at - finest_words()] += sum;
    }
}
