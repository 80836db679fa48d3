// Work shared out among the threads of a workgroup: each brings a number of pieces, and takes pieces whosesoever they are.

const THREADS: u32 = 64u;

// Where the pieces of each thread end among those of all: two lists, from 0 and from 64 on.
var<workgroup> ends: array<u32, 128>;

// Who has the piece `at`: the first whose pieces end beyond it.
fn owner(list: u32, at: u32) -> u32 {
    var low = list;
    for (var half = 32u; half > 0u; half /= 2u) {
        if ends[low + half - 1u] <= at {
            low += half;
        }
    }
    return low - list;
}

// The piece `at` among those of its owner.
fn within(list: u32, own: u32, at: u32) -> u32 {
    if own == 0u {
        return at;
    }
    return at - ends[list + own - 1u];
}

// Sums of the values up to each thread's own, over the workgroup.
fn running_sum(list: u32, me: u32, value: u32) {
    ends[list + me] = value;
    workgroupBarrier();
    for (var away = 1u; away < THREADS; away *= 2u) {
        var add = 0u;
        if me >= away {
            add = ends[list + me - away];
        }
        workgroupBarrier();
        ends[list + me] += add;
        workgroupBarrier();
    }
}
