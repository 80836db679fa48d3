// Products and sums of float32: four chains of four a thread, so that none waits for the one before.

@group(0) @binding(0) var<storage, read_write> words: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let start = f32(id.x & 1023u) * (1.0 / 1024.0);
    let shrink = vec4f(0.5 + 0.25 * start);
    var a = vec4f(start, 1.0, 2.0, 3.0);
    var b = a + 4.0;
    var c = a + 8.0;
    var d = a + 12.0;
    for (var k = 0u; k < 256u; k++) {
        a = fma(a, shrink, vec4f(0.25));
        b = fma(b, shrink, vec4f(0.5));
        c = fma(c, shrink, vec4f(0.75));
        d = fma(d, shrink, vec4f(1.0));
    }
    // What nobody reads, compilers leave out.
    words[id.x % arrayLength(&words)] = dot(a + b + c + d, vec4f(1.0));
}
