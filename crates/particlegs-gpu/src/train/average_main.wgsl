// Takes the average a share of the way to the Gaussians: particlegs-train's depth::parameters::DepthGaussians::approach.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> now: array<f32>;
@group(0) @binding(2) var<storage, read_write> averaged: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let n = step.count;
    let i = id.x;
    if i >= n {
        return;
    }
    for (var k = 0u; k < 3u; k++) {
        let high = k * n + i;
        let low = (3u + k) * n + i;
        averaged[low] += step.average * ((now[high] - averaged[high]) + (now[low] - averaged[low]));
    }
    for (var k = 6u; k < 14u; k++) {
        let at = k * n + i;
        averaged[at] += step.average * (now[at] - averaged[at]);
    }
}
