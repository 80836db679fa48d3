// The planes that are summed, and where they are read and written.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> scales: array<Scale>;
@group(0) @binding(2) var<storage, read_write> finest: array<u32>;
@group(0) @binding(3) var<storage, read_write> coarser: array<u32>;
// The finer plane of a pass; its coarser one is the next.
@group(0) @binding(4) var<uniform> target_plane: vec4u;

fn depth_at(plane: u32, x: u32, y: u32, is_sum: bool) -> f32 {
    let level = frame.levels[plane];
    if x >= level.width {
        return 0.0;
    }
    let at = level.first + min(y, level.rows - 1u) * level.width + x;
    var word = 0u;
    if level.first == 0u {
        word = finest[at];
    } else {
        word = coarser[at - finest_words()];
    }
    if is_sum {
        return f32(word) * scales[plane].down;
    }
    return bitcast<f32>(word);
}

// Sets the depth of a plane's pixel, counted from the first.
fn set_depth(level: Level, pixel: u32, depth: f32) {
    if level.first == 0u {
        finest[pixel] = bitcast<u32>(depth);
    } else {
        coarser[level.first - finest_words() + pixel] = bitcast<u32>(depth);
    }
}
