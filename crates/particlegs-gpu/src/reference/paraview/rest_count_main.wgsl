// How many fragments of each slice the peels left.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;

var<workgroup> here: atomic<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let slice = slices[group.x];
    let end = load(slice, me);
    var own = 0u;
    for (var at = slice.y + me; at < end; at += THREADS) {
        own += u32(key_of(at) != 0u);
    }
    if own > 0u {
        atomicAdd(&here, own);
    }
    workgroupBarrier();
    if me == 0u {
        counts[group.x] = atomicLoad(&here);
    }
}
