// After a peel: each pixel's next layers and range become its own.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read_write> next_ranges: array<u32>;
@group(0) @binding(2) var<storage, read_write> ranges: array<u32>;
@group(0) @binding(3) var<storage, read_write> layers: array<u32>;
@group(0) @binding(4) var<storage, read_write> next_layers: array<u32>;
// Did a back layer come to any pixel? Is anything left between the layers?
@group(0) @binding(5) var<storage, read_write> found: array<atomic<u32>, 2>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let pixel = (group.y * groups.x + group.x) * 64u + me;
    if pixel >= view.size.x * (view.strip.y - view.strip.x) || ranges[2u * pixel] == 0u {
        return;
    }
    var back = layers[pixel] >> 8u;
    let more = next_layers[2u * pixel + 1u];
    if more > 0u {
        back = over_back(back, more);
        atomicOr(&found[0], 1u);
    }
    layers[pixel] = next_layers[2u * pixel] | (back << 8u);
    let next = vec2u(next_ranges[2u * pixel], next_ranges[2u * pixel + 1u]);
    if next.x > 0u {
        atomicOr(&found[1], 1u);
    }
    ranges[2u * pixel] = next.x;
    ranges[2u * pixel + 1u] = next.y;
    next_ranges[2u * pixel] = 0u;
    next_ranges[2u * pixel + 1u] = 0u;
    next_layers[2u * pixel] = 0u;
    next_layers[2u * pixel + 1u] = 0u;
}
