// Moves every Gaussian in its own frame: particlegs-train's depth::parameters::DepthGaussians::change. A mean moves in what
// its first float leaves, so that small ways are not lost in large numbers.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> change: array<f32>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let n = step.count;
    let i = id.x;
    if i >= n {
        return;
    }
    let a = gaussians[6u * n + i];
    let b = gaussians[7u * n + i];
    let c = gaussians[8u * n + i];
    let d = gaussians[9u * n + i];
    let e = gaussians[10u * n + i];
    let f = gaussians[11u * n + i];
    let u = change[i];
    let v = change[n + i];
    let w = change[2u * n + i];
    let p = exp(change[3u * n + i]);
    let s10 = change[4u * n + i];
    let q = exp(change[5u * n + i]);
    let s20 = change[6u * n + i];
    let s21 = change[7u * n + i];
    let r = exp(change[8u * n + i]);
    gaussians[3u * n + i] += a * u;
    gaussians[4u * n + i] += b * u + c * v;
    gaussians[5u * n + i] += d * u + e * v + f * w;
    gaussians[6u * n + i] = a * p;
    gaussians[7u * n + i] = b * p + c * s10;
    gaussians[8u * n + i] = c * q;
    gaussians[9u * n + i] = d * p + e * s10 + f * s20;
    gaussians[10u * n + i] = e * q + f * s21;
    gaussians[11u * n + i] = f * r;
    let log_count = gaussians[13u * n + i] + change[9u * n + i];
    gaussians[12u * n + i] = exp(log_count);
    gaussians[13u * n + i] = log_count;
}
