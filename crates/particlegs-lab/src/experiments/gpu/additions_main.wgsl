// Additions to the words of a plane, neighbours by neighbours.

@group(0) @binding(0) var<storage, read_write> words: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let count = arrayLength(&words);
    for (var k = 0u; k < 64u; k++) {
        atomicAdd(&words[(id.x + 40961u * k) % count], 1u);
    }
}
