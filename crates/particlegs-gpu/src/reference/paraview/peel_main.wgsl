// One peel: of each pixel's fragments the foremost and the hindmost give its next layers, those between its next range.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(3) var<storage, read_write> next_ranges: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read> ranges: array<u32>;
@group(0) @binding(5) var<storage, read> layers: array<u32>;
// Front and back of each pixel.
@group(0) @binding(6) var<storage, read_write> next_layers: array<atomic<u32>>;

fn raise_layer(at: u32, level: u32) {
    if atomicLoad(&next_layers[at]) < level {
        atomicMax(&next_layers[at], level);
    }
}

fn peel(p: QuadPixel) {
    let pixel = index_of(p.pixel);
    if ranges[2u * pixel] == 0u {
        return;
    }
    let low = least(ranges[2u * pixel]);
    let high = greatest(ranges[2u * pixel + 1u]);
    let z = quads[p.own].depth;
    let front = layers[pixel] & 255u;
    if z > plus(low, DEPTH_TOLERANCE) && z < minus(high, DEPTH_TOLERANCE) {
        widen(pixel, z);
        raise_layer(2u * pixel, front);
    } else if z < minus(low, DEPTH_TOLERANCE) || z > plus(high, DEPTH_TOLERANCE) {
        raise_layer(2u * pixel, front);
    } else {
        let a = alpha_of(p.own, p.pixel);
        if a > 0.0 {
            if z <= plus(low, DEPTH_TOLERANCE) {
                let through = minus(1.0, to_float(front));
                raise_layer(2u * pixel, to_byte(plus(times(through, a), to_float(front))));
            } else {
                raise_layer(2u * pixel, front);
                raise_layer(2u * pixel + 1u, to_byte(a));
            }
        }
    }
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) me: u32) {
    let slice = slices[group.x];
    let end = load(slice, me);
    for (var at = slice.y + me; at < end; at += THREADS) {
        let p = quad_pixel(at);
        if p.is_covered {
            peel(p);
        }
    }
}
