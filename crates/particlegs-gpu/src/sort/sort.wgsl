// A stable radix sort, four bits a pass: what comes first among equals stays first, and no order of threads shows.

struct Pass {
    // Keys, and blocks of them.
    count: u32,
    blocks: u32,
    // The first of the four bits.
    shift: u32,
    pad0: u32,
}

const DIGITS: u32 = 16u;
// Keys of a thread, and of a workgroup.
const EACH: u32 = 8u;
const BLOCK: u32 = 512u;

fn digit(key: u32, shift: u32) -> u32 {
    return (key >> shift) & (DIGITS - 1u);
}
