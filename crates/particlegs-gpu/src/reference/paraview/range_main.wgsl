// The range of depths of each pixel's fragments.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(3) var<storage, read_write> next_ranges: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let slice = slices[group.x];
    let end = load(slice, me);
    for (var at = slice.y + me; at < end; at += THREADS) {
        let p = quad_pixel(at);
        if p.is_covered {
            widen(index_of(p.pixel), quads[p.own].depth);
        }
    }
}
