//! The projection backwards: from the gradient of a footprint to that of a Gaussian.

use particlegs_core::math::each_axis;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::project::{CameraGaussian, DepthMoments, DepthSlopes};

/// Gradient with a footprint's mean, covariance (xx, xy, yy, each a number of its own) and sum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FootprintGradient {
    pub mean: [f64; 2],
    pub cov: [f64; 3],
    pub sum: f64,
}

/// Gradient with a Gaussian's mean (3), covariance (xx, xy, xz, yy, yz, zz, each a number of its
/// own) and count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GaussianGradient {
    pub mean: [f64; 3],
    pub cov: [f64; 6],
    pub count: f64,
}

/// The inverse depths of a piece of a Gaussian.
#[derive(Clone, Copy, Debug)]
pub struct PieceDepth {
    pub moments: DepthMoments,
    /// Changes of the moments with the Gaussian.
    pub slopes: DepthSlopes,
}

impl GaussianGradient {
    pub fn is_finite(&self) -> bool {
        self.mean.iter().chain(&self.cov).all(|v| v.is_finite()) && self.count.is_finite()
    }

    /// Adds the part of one piece, in the camera's axes: the reverse of
    /// [`CameraGaussian::footprint`] in perspective.
    pub fn add_piece(&mut self, lens: &Lens, g: &CameraGaussian, depth: &PieceDepth, by: &FootprintGradient) {
        let PieceDepth { moments: m, slopes } = depth;
        let [x, y, d] = g.mean.map(f64::from);
        let (slope, zz, across) = (g.slope.map(f64::from), f64::from(g.depth), g.rest());
        let (xz, yz) = (slope[0] * zz, slope[1] * zz);
        let f2 = lens.focal * lens.focal;
        let [cxx, cxy, cyy] = by.cov;
        // position on the plane t = base + carried * (inverse depth)
        let carried = [x - slope[0] * d, y - slope[1] * d];
        let t = [slope[0] + carried[0] * m.mean, slope[1] + carried[1] * m.mean];
        // covariance = f^2 (rest square + c c^T variance + r^2 square (1 + t t^T)), c = `carried` (docs/law/depth.md).
        let round = f2 * lens.radius2;
        let by_t = [
            lens.focal * by.mean[0] + round * m.square * (2.0 * cxx * t[0] + cxy * t[1]),
            lens.focal * by.mean[1] + round * m.square * (2.0 * cyy * t[1] + cxy * t[0]),
        ];
        let rest = [f2 * m.square * cxx, f2 * m.square * cxy, f2 * m.square * cyy];
        let by_square = f2 * (cxx * across[0] + cxy * across[1] + cyy * across[2])
            + round * (cxx * (1.0 + t[0] * t[0]) + cxy * t[0] * t[1] + cyy * (1.0 + t[1] * t[1]));
        let by_spread =
            f2 * (cxx * carried[0] * carried[0] + cxy * carried[0] * carried[1] + cyy * carried[1] * carried[1]);
        let by_carried = [
            by_t[0] * m.mean + f2 * m.variance * (2.0 * cxx * carried[0] + cxy * carried[1]),
            by_t[1] * m.mean + f2 * m.variance * (2.0 * cyy * carried[1] + cxy * carried[0]),
        ];
        let by_place = by_t[0] * carried[0] + by_t[1] * carried[1];
        let by_weight = f64::from(g.weight) * by.sum;
        // The rest at a given depth is S_xx - g S_xz and so on: it moves with g = S_xz / S_zz too.
        let by_slope =
            [by_t[0] - by_carried[0] * d - rest[0] * xz - rest[1] * yz, by_t[1] - by_carried[1] * d - rest[2] * yz];
        let moments =
            |s: &DepthMoments| by_weight * s.weight + by_place * s.mean + by_square * s.square + by_spread * s.variance;
        self.mean[0] += by_carried[0];
        self.mean[1] += by_carried[1];
        // Depth enters by its moments, and by c = x - g d.
        self.mean[2] += moments(&slopes.by_depth) - by_carried[0] * slope[0] - by_carried[1] * slope[1];
        self.count += lens.unit * m.weight * by.sum;
        self.cov[0] += rest[0];
        self.cov[1] += rest[1];
        self.cov[3] += rest[2];
        self.cov[5] += moments(&slopes.by_variance);
        // Where the regression took a depth spread for none, its slopes are constants.
        if zz > 1e-14 * (across[0] + across[2] + slope[0] * xz + slope[1] * yz) {
            let inverse = 1.0 / zz;
            self.cov[2] += by_slope[0] * inverse - rest[0] * slope[0];
            self.cov[4] += by_slope[1] * inverse - rest[1] * slope[0] - rest[2] * slope[1];
            self.cov[5] -= (by_slope[0] * slope[0] + by_slope[1] * slope[1]) * inverse;
        }
    }

    /// From the camera's axes to the world's.
    pub fn to_world(self, lens: &Lens) -> GaussianGradient {
        let a = &lens.axes;
        let mean = each_axis(|k| (0..3).map(|r| a[r][k] * self.mean[r]).sum());
        let g = full(&self.cov);
        let world = |i: usize, j: usize| -> f64 {
            (0..3).map(|r| a[r][i] * (0..3).map(|c| g[r][c] * a[c][j]).sum::<f64>()).sum()
        };
        let cov = [world(0, 0), 2.0 * world(0, 1), 2.0 * world(0, 2), world(1, 1), 2.0 * world(1, 2), world(2, 2)];
        GaussianGradient { mean, cov, count: self.count }
    }
}

/// The symmetric matrix G with dL = tr(G dS) of a gradient with six numbers of S.
pub fn full(c: &[f64; 6]) -> [[f64; 3]; 3] {
    let [xx, xy, xz, yy, yz, zz] = *c;
    [[xx, 0.5 * xy, 0.5 * xz], [0.5 * xy, yy, 0.5 * yz], [0.5 * xz, 0.5 * yz, zz]]
}
