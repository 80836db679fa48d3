// The scale of the sums of each plane, from the tile in which most may come together: a plane a workgroup.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> tiles: array<u32>;
@group(0) @binding(2) var<storage, read_write> scales: array<Scale>;

var<workgroup> most: array<f32, 256>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let plane = frame.levels[group.x];
    let end = plane.first_tile + plane.tiles * ((plane.rows + TILE - 1u) / TILE);
    var own = 0.0;
    for (var tile = plane.first_tile + me; tile < end; tile += 256u) {
        own = max(own, f32(tiles[2u * tile]) / 65536.0 + f32(tiles[2u * tile + 1u]) * 65536.0);
    }
    most[me] = own;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if me < half {
            most[me] = max(most[me], most[me + half]);
        }
        workgroupBarrier();
    }
    if me == 0u {
        // A power of two, half as large as would just fit: each of the sum's terms may be rounded up by half.
        let fits = bitcast<u32>(2147483648.0 / max(most[0], 1e-9)) & 0x7f800000u;
        let up = bitcast<f32>(fits);
        scales[group.x] = Scale(up, 1.0 / up);
    }
}
