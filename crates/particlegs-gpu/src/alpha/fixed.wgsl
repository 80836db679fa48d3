// Places as whole numbers of 2^-40 of the training frame's unit, 64 bits, low word first. The CPU rounds a place in
// the camera's axes once, to float32: so what is nearest comes out as there, also where Gaussians of a lattice are as deep
// as each other, and a camera far away sees them where they are.

// Bits of the fraction of places; an axis has 47.
const FRACTION: u32 = 40u;

fn plus(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn is_negative(a: vec2u) -> bool {
    return (a.y >> 31u) == 1u;
}

fn negate_if(a: vec2u, turn: bool) -> vec2u {
    return select(a, plus(~a, vec2u(1u, 0u)), turn);
}

fn magnitude(a: vec2u) -> vec2u {
    return negate_if(a, is_negative(a));
}

// A magnitude times one of an axis, which is at most 1: by digits of 16 bits.
fn axis_product(a: vec2u, axis: vec2u) -> vec2u {
    let digits = array<u32, 4>(a.x & 0xffffu, a.x >> 16u, a.y & 0xffffu, a.y >> 16u);
    let others = array<u32, 3>(axis.x & 0xffffu, axis.x >> 16u, axis.y & 0xffffu);
    var r: array<u32, 7>;
    for (var i = 0u; i < 3u; i++) {
        var carried = 0u;
        for (var j = 0u; j < 4u; j++) {
            // At most 2^32 - 1.
            let sum = r[i + j] + others[i] * digits[j] + carried;
            r[i + j] = sum & 0xffffu;
            carried = sum >> 16u;
        }
        r[i + 4u] = carried;
    }
    // From bit 47 on: the last of the third digit.
    var q: array<u32, 4>;
    for (var k = 0u; k < 4u; k++) {
        q[k] = (r[k + 2u] >> 15u) | ((r[k + 3u] << 1u) & 0xffffu);
    }
    return vec2u(q[0] | (q[1] << 16u), q[2] | (q[3] << 16u));
}

fn shift_right(a: vec2u, by: u32) -> vec2u {
    if by == 0u {
        return a;
    }
    if by < 32u {
        return vec2u((a.x >> by) | (a.y << (32u - by)), a.y >> by);
    }
    return vec2u(a.y >> (by - 32u), 0u);
}

// The lowest bits of two words, up to 63.
fn low_bits(bits: u32) -> vec2u {
    if bits < 32u {
        return vec2u((1u << bits) - 1u, 0u);
    }
    return vec2u(0xffffffffu, (1u << (bits - 32u)) - 1u);
}

// The nearest float32, the even one of two: every step is exact but the one that rounds, which is of whole numbers.
fn to_float(a: vec2u) -> f32 {
    let size = magnitude(a);
    var last = firstLeadingBit(size.x);
    if size.y > 0u {
        last = 32u + firstLeadingBit(size.y);
    }
    var digits = size.x;
    var dropped = 0u;
    if size.y > 0u || (size.x > 0u && last > 23u) {
        dropped = last - 23u;
        digits = shift_right(size, dropped).x;
        let half = shift_right(size, dropped - 1u).x & 1u;
        let more = any((size & low_bits(dropped - 1u)) != vec2u(0u));
        if half == 1u && (more || (digits & 1u) == 1u) {
            digits += 1u;
        }
    }
    let value = f32(digits) * bitcast<f32>((127u + dropped - FRACTION) << 23u);
    return select(value, -value, is_negative(a));
}
