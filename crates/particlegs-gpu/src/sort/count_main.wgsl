// How many keys of each block have each digit.

@group(0) @binding(0) var<uniform> pass_of: Pass;
@group(0) @binding(1) var<storage, read> keys: array<u32>;
// A row a digit, a column a block.
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;

var<workgroup> bins: array<atomic<u32>, 16>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let block = group.y * groups.x + group.x;
    for (var k = 0u; k < EACH; k++) {
        let i = block * BLOCK + k * 64u + me;
        if i < pass_of.count {
            atomicAdd(&bins[digit(keys[i], pass_of.shift)], 1u);
        }
    }
    workgroupBarrier();
    if me < DIGITS && block < pass_of.blocks {
        counts[me * pass_of.blocks + block] = atomicLoad(&bins[me]);
    }
}
