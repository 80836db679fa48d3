// Adam's step of every Gaussian but those with a number or a gradient that is none: particlegs-train's alpha::steps.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> gradient: array<f32>;
@group(0) @binding(2) var<storage, read_write> trained: array<f32>;
// Means of gradients, then of their squares.
@group(0) @binding(3) var<storage, read_write> averages: array<f32>;
@group(0) @binding(4) var<storage, read_write> faults: Faults;

// 3DGS's.
const EPSILON: f32 = 1e-15;

// 0 place, 1 scales, 2 quaternion, 3 opacity, 4 grey level.
fn group_of(k: u32) -> u32 {
    return select(select(select(k / 3u, 2u, k >= ROTATION), 3u, k == LOGIT), 4u, k == FEATURE);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + me;
    let n = step.count;
    if i >= n {
        return;
    }
    for (var k = 0u; k < NUMBERS; k++) {
        if !(is_finite(gradient[k * n + i]) && is_finite(trained[k * n + i])) {
            atomicAdd(&faults.count, 1u);
            atomicMin(&faults.first, 8u * i + group_of(k));
            return;
        }
    }
    for (var k = 0u; k < NUMBERS; k++) {
        let kind = group_of(k);
        let rate = select(step.rate[min(kind, 3u)], step.rate_more.x, kind == 4u);
        let unroot = select(step.unroot[min(kind, 3u)], step.unroot_more.x, kind == 4u);
        let at = k * n + i;
        let g = gradient[at];
        let first = step.beta.x * averages[at] + (1.0 - step.beta.x) * g;
        let second = step.beta.y * averages[NUMBERS * n + at] + (1.0 - step.beta.y) * g * g;
        averages[at] = first;
        averages[NUMBERS * n + at] = second;
        trained[at] -= rate * first / (sqrt(second * unroot) + EPSILON);
    }
}
