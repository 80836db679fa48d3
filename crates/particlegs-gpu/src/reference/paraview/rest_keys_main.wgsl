// The keys of fragments that the peels left, in the order of their particles.

@group(0) @binding(0) var<uniform> view: View;
// Where each slice's keys begin.
@group(0) @binding(4) var<storage, read> offsets: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let slice = slices[group.x];
    let end = load(slice, me);
    var next = offsets[group.x];
    for (var first = slice.y; first < end; first += THREADS) {
        var key = 0u;
        if first + me < end {
            key = key_of(first + me);
        }
        running_sum(64u, me, u32(key != 0u));
        if key != 0u {
            keys[next + ends[64u + me] - 1u] = key;
        }
        next += workgroupUniformLoad(&ends[127]);
    }
}
