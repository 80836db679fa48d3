//! The paper's numbers on recovery, from its \newcommand lines (particlegs-sc26.tex): 281 million HACC particles in a
//! box of 256 Mpc/h, an alpha-blend model of 8 blocks at ratio 65 trained on pictures.

use particlegs_fit::recover::Method;

/// A row of a table of the paper.
pub(super) struct PublishedRecovery {
    pub correlation: f64,
    /// Mean absolute error of delta.
    pub mae: f64,
    /// Mean distance to the nearest neighbour among 500 000 random particles, Mpc/h.
    pub nearest: f64,
    /// Mean |xi / xi_truth - 1|, per cent.
    pub xi: f64,
}

/// The truth's mean distance to the nearest neighbour (\RecGtNNMean), Mpc/h.
pub(super) const TRUTH_NEAREST: f64 = 0.665;
/// P(k) is within 10 % up to here (\RecPkTenPctK), h/Mpc.
pub(super) const POWER_TO: f64 = 2.63;
/// xi(r) is within 10 % from here on (\RecXiTenPctR), Mpc/h.
pub(super) const XI_FROM: f64 = 10.0;
/// Particles in a cell of its density grid: 281 million in 256^3 (\RecGridSize).
pub(super) const PARTICLES_A_CELL: f64 = 281e6 / (256.0 * 256.0 * 256.0);

const fn row(correlation: f64, mae: f64, nearest: f64, xi: f64) -> PublishedRecovery {
    PublishedRecovery { correlation, mae, nearest, xi }
}

/// Table tab:recovery_methods (\RecVZero... to \RecVSix...); `None` for methods that it does not have.
pub(super) fn method(method: Method) -> Option<PublishedRecovery> {
    Some(match method {
        Method::Count => row(0.928, 0.718, 0.250, 8.6),
        Method::Volume => row(0.437, 1.172, 1.216, 4.0),
        Method::Ellipsoid => row(0.917, 0.701, 0.281, 8.9),
        Method::Grid => row(0.003, 1.924, 0.061, 154.1),
        Method::Stratified | Method::Spaced => return None,
    })
}

/// Table tab:recovery_blocks (\RecBlk...), by number of blocks.
pub(super) fn blocks(number: u32) -> Option<PublishedRecovery> {
    Some(match number {
        1 => row(0.897, 0.906, 0.161, 15.3),
        2 => row(0.916, 0.815, 0.186, 9.3),
        4 => row(0.923, 0.760, 0.218, 8.3),
        8 => row(0.928, 0.718, 0.250, 8.6),
        16 => row(0.928, 0.681, 0.292, 7.8),
        _ => return None,
    })
}
