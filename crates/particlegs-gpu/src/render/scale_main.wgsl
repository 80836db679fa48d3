// The scale of a picture's sums, from the tile in which most may come together.

@group(0) @binding(0) var<storage, read> tiles: array<u32>;
@group(0) @binding(1) var<storage, read_write> scale: Scale;

var<workgroup> most: array<f32, 256>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) me: u32) {
    var own = 0.0;
    for (var tile = me; tile < arrayLength(&tiles) / 2u; tile += 256u) {
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
        scale.up = bitcast<f32>(fits);
        scale.down = 1.0 / scale.up;
    }
}
