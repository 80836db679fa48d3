// Projects Gaussians, places their footprints on planes and bounds their sums; lists those that are to be cut.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;
@group(0) @binding(2) var<storage, read_write> strokes: array<RasterSplat>;
@group(0) @binding(3) var<storage, read_write> planes_of: array<u32>;
@group(0) @binding(4) var<storage, read_write> tiles: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> cuts: array<u32>;
@group(0) @binding(6) var<storage, read_write> cut_count: atomic<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.count {
        return;
    }
    planes_of[id.x] = NOWHERE;
    let g = camera_gaussian(frame.lens, id.x, frame.count);
    if !(g.weight > 0.0) {
        return;
    }
    let what = clip_class(frame.lens, g.mean.z, g.depth);
    if what == CUT {
        cuts[atomicAdd(&cut_count, 1u)] = id.x;
    }
    if what != WHOLE {
        return;
    }
    let placed = place(footprint(frame.lens, g, whole(frame.lens, g.mean.z, g.depth)));
    if placed.level == NOWHERE {
        return;
    }
    planes_of[id.x] = placed.level;
    strokes[id.x] = placed.stroke;
    add_to_tiles(placed);
}
