// How the moments of a piece of a Gaussian change with its mean depth and with its variance of depth, the splines where they
// are: core's render::project::slices::cut_with_slopes.

fn piece_slopes(lens: Lens, s: SplineGrid, k: u32, sums: PieceSums) -> DepthSlopes {
    // In perspective q is told over that of the piece's middle, less 1.
    let unit = select(1.0, exp(-middle_of(s, k)), lens.perspective == 1u);
    let mean = sums.here.y / sums.here.x;
    let square = sums.here.z / sums.here.x;
    let variance = square - mean * mean;
    let by_depth = slope(sums, sums.by_depth, vec3f(mean, square, variance), unit);
    return DepthSlopes(by_depth, slope(sums, sums.by_variance, vec3f(mean, square, variance), unit));
}

fn slope(sums: PieceSums, by: vec3f, m: vec3f, unit: f32) -> vec4f {
    let mean = (by.y - m.x * by.x) / sums.here.x;
    let square = (by.z - m.y * by.x) / sums.here.x;
    let variance = select(0.0, square - 2.0 * m.x * mean, m.z > 0.0);
    // The mean square of the whole q = unit (1 + q) is its mean's square and its variance.
    return vec4f(by.x, unit * mean, unit * unit * (2.0 * (1.0 + m.x) * mean + variance), unit * unit * variance);
}
