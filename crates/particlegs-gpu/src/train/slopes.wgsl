// How the moments of a Gaussian in one piece change with its mean depth and with its variance of depth: core's
// render::project::inverse_slopes.

fn inverse_slopes(d: f32, variance: f32) -> DepthSlopes {
    let s = 1.0 / d;
    let s2 = s * s;
    let e = variance * s2;
    let m2 = 1.0 + e * (3.0 + 15.0 * e);
    let m3 = 1.0 + e * (6.0 + 45.0 * e);
    let m4 = 1.0 + e * (10.0 + 105.0 * e);
    let by2 = 3.0 + 30.0 * e;
    let by3 = 6.0 + 90.0 * e;
    let by4 = 10.0 + 210.0 * e;
    let spread = e * (1.0 + e * (24.0 - e * (75.0 + 450.0 * e)));
    let by_spread = select(0.0, 1.0 + e * (48.0 - e * (225.0 + 1800.0 * e)), spread > 0.0);
    let inverse = 1.0 / m2;
    // By e: weight, mean, square, variance.
    let by_e = vec4f(
        by2 * s2,
        (by3 - m3 * inverse * by2) * inverse * s,
        (by4 - m4 * inverse * by2) * inverse * s2,
        (by_spread - 2.0 * max(spread, 0.0) * inverse * by2) * inverse * inverse * s2,
    );
    let m = inverse_moments(d, e);
    // e falls with depth as 1/d^2, and the moments with their own powers of it.
    let powers = vec4f(2.0, 1.0, 2.0, 2.0) * vec4f(m.weight, m.mean, m.square, m.variance);
    return DepthSlopes(-s * (powers + 2.0 * e * by_e), by_e * s2);
}
