// Writes Gaussians that density control has changed, with what Adam remembers of them: a record a thread.

struct Count {
    // Gaussians, and records.
    gaussians: u32,
    records: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> count: Count;
// Its number and its place among the members; then floats: ln count at the start; its columns; Adam's averages.
@group(0) @binding(1) var<storage, read> records: array<u32>;
@group(0) @binding(2) var<storage, read_write> now: array<f32>;
@group(0) @binding(3) var<storage, read_write> averages: array<f32>;
@group(0) @binding(4) var<storage, read_write> members: array<vec2u>;

const COLUMNS: u32 = 14u;
const AVERAGES: u32 = 20u;
const WORDS: u32 = 3u + COLUMNS + AVERAGES;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= count.records {
        return;
    }
    let first = id.x * WORDS;
    let i = records[first];
    members[records[first + 1u]] = vec2u(i, records[first + 2u]);
    for (var k = 0u; k < COLUMNS; k++) {
        now[k * count.gaussians + i] = bitcast<f32>(records[first + 3u + k]);
    }
    for (var k = 0u; k < AVERAGES; k++) {
        averages[k * count.gaussians + i] = bitcast<f32>(records[first + 3u + COLUMNS + k]);
    }
}
