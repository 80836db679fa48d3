// How many strokes touch each tile.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> strokes: array<RasterSplat>;
@group(0) @binding(2) var<storage, read> planes_of: array<u32>;
@group(0) @binding(3) var<storage, read_write> ends: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.count || planes_of[id.x] == NOWHERE {
        return;
    }
    let level = planes_of[id.x];
    let box = tiles_of(strokes[id.x], level);
    for (var y = box.y; y < box.w; y++) {
        for (var x = box.x; x < box.z; x++) {
            atomicAdd(&ends[tile_number(frame.levels[level], x, y)], 1u);
        }
    }
}
