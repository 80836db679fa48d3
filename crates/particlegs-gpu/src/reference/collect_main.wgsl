// Sums of whole numbers to depth in a picture's plane.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> low: array<u32>;
@group(0) @binding(2) var<storage, read> high: array<u32>;
@group(0) @binding(3) var<uniform> frame: Frame;
@group(0) @binding(4) var<storage, read_write> planes: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let pixel = (group.y * groups.x + group.x) * 64u + me;
    if pixel >= view.size.x * view.size.y {
        return;
    }
    let depth = (f32(low[pixel]) + f32(high[pixel]) * 4294967296.0) / view.scale;
    let x = pixel % view.size.x;
    let y = pixel / view.size.x;
    planes[(y + PAD) * frame.levels[0].width + x + PAD] = bitcast<u32>(depth);
}
