// How many keys of a block have each digit: digit by digit, block after block.

@group(0) @binding(1) var<storage, read> keys: array<u32>;
@group(0) @binding(2) var<storage, read_write> starts: array<u32>;

var<workgroup> here: array<atomic<u32>, 16>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    for (var k = 0u; k < EACH; k++) {
        let at = group.x * BLOCK + k * 64u + me;
        if at < digit.count {
            atomicAdd(&here[digit_of(keys[at])], 1u);
        }
    }
    workgroupBarrier();
    if me < 16u {
        starts[me * digit.blocks + group.x] = atomicLoad(&here[me]);
    }
}
