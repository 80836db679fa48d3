// From the lengths of the lists to where each begins among all, and how long they are together: by one workgroup, each
// thread for a run of tiles. More than 32 bits hold stays at the most that they hold.

@group(0) @binding(0) var<storage, read_write> ends: array<u32>;
@group(0) @binding(1) var<storage, read_write> total: u32;

var<workgroup> sums: array<u32, 256>;

fn sum_of(a: u32, b: u32) -> u32 {
    return a + min(b, 0xffffffffu - a);
}

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) me: u32) {
    let tiles = arrayLength(&ends);
    let run = (tiles + 255u) / 256u;
    let first = min(me * run, tiles);
    let last = min(first + run, tiles);
    var own = 0u;
    for (var tile = first; tile < last; tile++) {
        own = sum_of(own, ends[tile]);
    }
    sums[me] = own;
    workgroupBarrier();
    for (var away = 1u; away < 256u; away *= 2u) {
        var add = 0u;
        if me >= away {
            add = sums[me - away];
        }
        workgroupBarrier();
        sums[me] = sum_of(sums[me], add);
        workgroupBarrier();
    }
    var start = 0u;
    if me > 0u {
        start = sums[me - 1u];
    }
    for (var tile = first; tile < last; tile++) {
        let length = ends[tile];
        ends[tile] = start;
        start = sum_of(start, length);
    }
    if me == 255u {
        total = sums[255];
    }
}
