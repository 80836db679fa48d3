// Where the keys of each block begin among those of their digit, a workgroup a digit.

@group(0) @binding(0) var<uniform> pass_of: Pass;
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
// Keys of each digit.
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let blocks = pass_of.blocks;
    let each = (blocks + THREADS - 1u) / THREADS;
    let low = min(me * each, blocks);
    let high = min(low + each, blocks);
    let row = group.x * blocks;
    var sum = 0u;
    for (var b = low; b < high; b++) {
        sum += counts[row + b];
    }
    running_sum(0u, me, sum);
    var before = ends[me] - sum;
    for (var b = low; b < high; b++) {
        let own = counts[row + b];
        counts[row + b] = before;
        before += own;
    }
    if me == THREADS - 1u {
        totals[group.x] = ends[me];
    }
}
