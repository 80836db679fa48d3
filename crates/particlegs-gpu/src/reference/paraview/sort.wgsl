// Keys sorted by 4 of their bits, in the order in which they came: blocks of 1024 keys, 16 in a row a thread.

struct Digit {
    // How many keys, and the lowest of the bits.
    count: u32,
    shift: u32,
    blocks: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> digit: Digit;

const EACH: u32 = 16u;
const BLOCK: u32 = 1024u;

fn digit_of(key: u32) -> u32 {
    return (key >> digit.shift) & 15u;
}
