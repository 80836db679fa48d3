// Puts keys, and what they carry, where they belong by one digit.

@group(0) @binding(0) var<uniform> pass_of: Pass;
@group(0) @binding(1) var<storage, read> keys: array<u32>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read> totals: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys_out: array<u32>;

// Keys of each digit up to each thread's last: two digits a word, eight words a thread, those of a word side by side.
var<workgroup> sums: array<u32, 512>;
// Where the block's keys of each digit begin.
var<workgroup> begins: array<u32, 16>;

// Sums of each word up to each thread's own.
fn running_sums(me: u32) {
    for (var away = 1u; away < 64u; away *= 2u) {
        var add: array<u32, 8>;
        if me >= away {
            for (var w = 0u; w < 8u; w++) {
                add[w] = sums[w * 64u + me - away];
            }
        }
        workgroupBarrier();
        for (var w = 0u; w < 8u; w++) {
            sums[w * 64u + me] += add[w];
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) me: u32,
) {
    let block = group.y * groups.x + group.x;
    let first = block * BLOCK + me * EACH;
    var own: array<u32, 8>;
    for (var k = 0u; k < EACH; k++) {
        if first + k < pass_of.count {
            let d = digit(keys[first + k], pass_of.shift);
            own[d / 2u] += 1u << (16u * (d % 2u));
        }
    }
    for (var w = 0u; w < 8u; w++) {
        sums[w * 64u + me] = own[w];
    }
    if me < DIGITS && block < pass_of.blocks {
        var begin = counts[me * pass_of.blocks + block];
        for (var d = 0u; d < me; d++) {
            begin += totals[d];
        }
        begins[me] = begin;
    }
    workgroupBarrier();
    running_sums(me);
    // How many of each digit came before, from here on: nothing is carried from one half of a word to the other.
    var before: array<u32, 8>;
    for (var w = 0u; w < 8u; w++) {
        before[w] = sums[w * 64u + me] - own[w];
    }
    for (var k = 0u; k < EACH; k++) {
        if first + k < pass_of.count {
            let key = keys[first + k];
            let d = digit(key, pass_of.shift);
            let half = 16u * (d % 2u);
            let to = begins[d] + ((before[d / 2u] >> half) & 0xffffu);
            before[d / 2u] += 1u << half;
            keys_out[to] = key;
            carry(first + k, to);
        }
    }
}
