// Float32 as Rust computes it: every operation rounded once, on its own. Compilers of kernels may fuse products with sums
// and cancel what would cancel without rounding, and GPUs divide and take roots slightly inexactly. A word of the view that is
// always 0 hides from the compiler where a number comes from; quotients and roots are put right by what they leave.

fn round_once(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ view.nothing);
}

fn plus(a: f32, b: f32) -> f32 {
    return round_once(a + b);
}

fn minus(a: f32, b: f32) -> f32 {
    return round_once(a - b);
}

fn times(a: f32, b: f32) -> f32 {
    return round_once(a * b);
}

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

// The upper half of a number's digits.
fn head(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) & 0xfffff000u);
}

// What rounding took from the product `p` of two numbers (Dekker).
fn product_error(a: f32, b: f32, p: f32) -> f32 {
    let ah = head(a);
    let bh = head(b);
    let al = minus(a, ah);
    let bl = minus(b, bh);
    return plus(plus(plus(minus(times(ah, bh), p), times(ah, bl)), times(al, bh)), times(al, bl));
}

// a b + c, rounded once.
fn exact_fma(a: f32, b: f32, c: f32) -> f32 {
    let p = times(a, b);
    let s = plus(p, c);
    // What rounding took from the sum (Knuth).
    let back = minus(s, p);
    let t = plus(minus(p, minus(s, back)), minus(c, back));
    return plus(s, plus(t, product_error(a, b, p)));
}

fn over(a: f32, b: f32) -> f32 {
    let q = round_once(a / b);
    if !is_finite(q) {
        return q;
    }
    let p = times(q, b);
    return plus(q, round_once(minus(minus(a, p), product_error(q, b, p)) / b));
}

// Of a number that is not negative.
fn root(x: f32) -> f32 {
    let s = round_once(sqrt(x));
    if !is_finite(s) || s == 0.0 {
        return s;
    }
    let p = times(s, s);
    return plus(s, round_once(minus(minus(x, p), product_error(s, s, p)) / (2.0 * s)));
}
