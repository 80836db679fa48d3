// Adds the splats of particles, one a thread: small ones at once, the pixels of others shared out among the threads.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> positions: array<f32>;
@group(0) @binding(2) var<storage, read> integrals: array<f32>;
@group(0) @binding(3) var<storage, read_write> low: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> high: array<atomic<u32>>;

var<workgroup> splats: array<PixelSplat, 64>;
// The first pixel of each, and its columns.
var<workgroup> corners: array<vec2u, 64>;
var<workgroup> columns: array<u32, 64>;

fn add_small(s: PixelSplat) {
    let first = floor(s.at - CUT * s.axes.xw);
    for (var j = 0.0; j < 2.0; j += 1.0) {
        for (var i = 0.0; i < 2.0; i += 1.0) {
            let pixel = first + vec2f(i, j);
            if all(pixel >= vec2f(0.0)) && all(pixel < vec2f(view.size)) {
                let m = view.opacity * profile(s.at.x, s.axes.x, pixel.x) * profile(s.at.y, s.axes.w, pixel.y);
                add(view, u32(pixel.y) * view.size.x + u32(pixel.x), depth_of(view, max(m, 0.0)));
            }
        }
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let i = view.first + (group.y * groups.x + group.x) * THREADS + me;
    var pixels = 0u;
    if i < view.last {
        let n = view.count;
        let s = splat_of(view, vec3f(positions[i], positions[i + n], positions[i + 2u * n]));
        let away = reach(s);
        if away.x > 0.0 {
            if is_small(s) {
                add_small(s);
            } else {
                let first = vec2u(clamp(floor(s.at - away), vec2f(0.0), vec2f(view.size)));
                let end = vec2u(clamp(floor(s.at + away) + 1.0, vec2f(0.0), vec2f(view.size)));
                splats[me] = s;
                corners[me] = first;
                columns[me] = max(end.x, first.x) - first.x;
                pixels = columns[me] * (max(end.y, first.y) - first.y);
            }
        }
    }
    running_sum(0u, me, pixels);
    let all_pixels = workgroupUniformLoad(&ends[63]);
    for (var p = me; p < all_pixels; p += THREADS) {
        let own = owner(0u, p);
        let along = within(0u, own, p);
        let pixel = corners[own] + vec2u(along % columns[own], along / columns[own]);
        let m = mean_opacity(view, splats[own], vec2f(pixel));
        add(view, pixel.y * view.size.x + pixel.x, depth_of(view, max(m, 0.0)));
    }
}
