// Where the keys of each digit and block begin: sums of what stands before. One workgroup, a run of the counts a thread.

@group(0) @binding(1) var<storage, read_write> starts: array<u32>;

var<workgroup> sums: array<u32, 256>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) me: u32) {
    let all = 16u * digit.blocks;
    let run = (all + 255u) / 256u;
    let end = min((me + 1u) * run, all);
    var sum = 0u;
    for (var k = me * run; k < end; k++) {
        sum += starts[k];
    }
    sums[me] = sum;
    workgroupBarrier();
    for (var away = 1u; away < 256u; away *= 2u) {
        var add = 0u;
        if me >= away {
            add = sums[me - away];
        }
        workgroupBarrier();
        sums[me] += add;
        workgroupBarrier();
    }
    var next = sums[me] - sum;
    for (var k = me * run; k < end; k++) {
        let own = starts[k];
        starts[k] = next;
        next += own;
    }
}
