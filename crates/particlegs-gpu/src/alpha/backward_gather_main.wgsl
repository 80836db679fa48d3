// Adds up the slots of each footprint of a slab in the order of its tiles: particlegs-train's alpha::raster::gather. A
// thread a footprint; one that is not drawn has none, and wants nothing.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> slab: Slab;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> touched_by: array<vec2u>;
@group(0) @binding(4) var<storage, read> places: array<vec2u>;
@group(0) @binding(5) var<storage, read> slots: array<f32>;
// A column a number, a row a Gaussian.
@group(0) @binding(6) var<storage, read_write> sums: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let place = group.y * groups.x + group.x;
    let rank = (slab.first + place) * 64u + me;
    if place >= slab.blocks || rank >= slab.gaussians {
        return;
    }
    let i = order[rank];
    let touched = touched_by[i];
    let first = slot_of(places[i], touched & vec2u(0xffffu));
    let end = first + number(touched);
    for (var k = 0u; k < NUMBERS; k++) {
        var sum = 0.0;
        for (var slot = first; slot < end; slot++) {
            sum += slots[NUMBERS * slot + k];
        }
        sums[k * slab.gaussians + i] = sum;
    }
}
