// Ranges of depths that fragments widen. Most change nothing, and are done with a look.

fn raise_range(at: u32, word: u32) {
    if atomicLoad(&next_ranges[at]) < word {
        atomicMax(&next_ranges[at], word);
    }
}

fn widen(pixel: u32, depth: f32) {
    let bits = bitcast<u32>(depth);
    raise_range(2u * pixel, ~bits);
    raise_range(2u * pixel + 1u, bits + 1u);
}
