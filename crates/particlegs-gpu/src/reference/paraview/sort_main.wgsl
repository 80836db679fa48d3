// Puts keys where those of their digit go.

@group(0) @binding(1) var<storage, read> keys: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> sorted: array<u32>;

// Where each thread's next key of each digit goes: the threads of a digit one after the other.
var<workgroup> next: array<u32, 1024>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let first = group.x * BLOCK + me * EACH;
    let end = min(first + EACH, digit.count);
    for (var at = first; at < end; at++) {
        next[digit_of(keys[at]) * 64u + me] += 1u;
    }
    workgroupBarrier();
    if me < 16u {
        var start = starts[me * digit.blocks + group.x];
        for (var k = 0u; k < 64u; k++) {
            let own = next[me * 64u + k];
            next[me * 64u + k] = start;
            start += own;
        }
    }
    workgroupBarrier();
    for (var at = first; at < end; at++) {
        let slot = digit_of(keys[at]) * 64u + me;
        sorted[next[slot]] = keys[at];
        next[slot] += 1u;
    }
}
