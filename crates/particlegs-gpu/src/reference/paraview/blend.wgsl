// A pixel's fragments blended: dual depth peeling, then what the peels left: particlegs' reference::blend.
//
// A pixel's range of depths is two words: the complement of the least depth's bits, and the greatest one's bits plus 1, so
// that both only rise and 0 is the empty range. Its layers are one word: front, and back 256 times.

const DEPTH_TOLERANCE: f32 = 1e-7;

fn least(word: u32) -> f32 {
    return bitcast<f32>(~word);
}

fn greatest(word: u32) -> f32 {
    return bitcast<f32>(word - 1u);
}

// A number from 0 to 1 to 8 bits, as Mesa rounds it.
fn to_byte(x: f32) -> u32 {
    return bitcast<u32>(plus(times(x, 255.0 / 256.0), 32768.0)) & 255u;
}

// An 8-bit texel as a shader reads it.
fn to_float(byte: u32) -> f32 {
    return times(f32(byte), 1.0 / 255.0);
}

fn mul8(s: u32, t: u32) -> u32 {
    return (s * t + ((s * t) >> 8u) + 128u) >> 8u;
}

// What is behind, with a fragment over it.
fn over_back(back: u32, fragment: u32) -> u32 {
    return min(fragment + mul8(back, 255u - fragment), 255u);
}
