// Sums of two numbers over the 256 threads of a workgroup.

var<workgroup> parts_here: array<vec2f, 256>;

fn sum_of(me: u32, own: vec2f) -> vec2f {
    parts_here[me] = own;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if me < half {
            parts_here[me] += parts_here[me + half];
        }
        workgroupBarrier();
    }
    let sum = parts_here[0];
    workgroupBarrier();
    return sum;
}
