// Adam's step, with the particles of every group of neighbours kept: particlegs-train's depth::steps::update and
// depth::groups, a group a workgroup. Changes take the gradients' place.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> epsilon: vec4f;
@group(0) @binding(2) var<storage, read_write> gradient: array<f32>;
// Means of gradients, then of their squares.
@group(0) @binding(3) var<storage, read_write> averages: array<f32>;
@group(0) @binding(4) var<storage, read> seen: array<f32>;
@group(0) @binding(5) var<storage, read> now: array<f32>;
// Gaussians by group, and ln count at the start.
@group(0) @binding(6) var<storage, read> members: array<vec2u>;
// The first member of each group, and what its counts are to sum to; then the end.
@group(0) @binding(7) var<storage, read> group_records: array<vec2u>;

var<workgroup> sums_here: array<vec2f, 64>;

fn sum_of(me: u32, own: vec2f) -> vec2f {
    sums_here[me] = own;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if me < half {
            sums_here[me] += sums_here[me + half];
        }
        workgroupBarrier();
    }
    let sum = sums_here[0];
    workgroupBarrier();
    return sum;
}

// Adam's change of number `k` of Gaussian `i`.
fn adam(k: u32, i: u32, g: f32) -> f32 {
    let n = step.count;
    let kind = kind_of(k);
    let first = step.beta.x * averages[k * n + i] + (1.0 - step.beta.x) * g;
    let second = step.beta.y * averages[(10u + k) * n + i] + (1.0 - step.beta.y) * g * g;
    averages[k * n + i] = first;
    averages[(10u + k) * n + i] = second;
    return -step.rate[kind] * first / (sqrt(second * step.unroot[kind]) + epsilon[kind]);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let own_group = group.y * groups.x + group.x;
    if own_group >= step.groups {
        return;
    }
    let n = step.count;
    let begin = group_records[own_group].x + me;
    let end = group_records[own_group + 1u].x;
    // What one's count gains its group's loses.
    var own = vec2f(0.0);
    for (var m = begin; m < end; m += 64u) {
        let i = members[m].x;
        own += vec2f(gradient[9u * n + i], seen[12u * n + i]);
    }
    let given = sum_of(me, own);
    let a_particle = given.x / max(given.y, 1e-38);
    own = vec2f(0.0);
    for (var m = begin; m < end; m += 64u) {
        let i = members[m].x;
        for (var k = 0u; k < 9u; k++) {
            gradient[k * n + i] = adam(k, i, gradient[k * n + i]);
        }
        let log_count = now[13u * n + i];
        let taken_back = step.decay * (log_count - bitcast<f32>(members[m].y));
        let by = adam(9u, i, gradient[9u * n + i] - a_particle * seen[12u * n + i]) - taken_back;
        gradient[9u * n + i] = by;
        own.x += exp(log_count + by);
    }
    let changed = sum_of(me, own).x;
    let shift = log(bitcast<f32>(group_records[own_group].y) / changed);
    for (var m = begin; m < end; m += 64u) {
        gradient[9u * n + members[m].x] += shift;
    }
}
