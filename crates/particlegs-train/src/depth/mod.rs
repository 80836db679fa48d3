//! Training by the optical-depth law: a sum over Gaussians passed through one curve, so gradients
//! need no order and no recursion (docs/law/depth.md).
//!
//! `raster` projects and draws as `render` does and keeps what it placed; the
//! backward pass takes the gradient of the depth down the pyramid of planes, each piece gathers it
//! over its footprint (`gather`), and `adjoint` carries it back through the projection to mean,
//! covariance and count. A step moves them ([`DepthStepper`]) in each Gaussian's own frame.

mod adjoint;
mod config;
mod density;
mod gather;
mod groups;
mod learner;
mod parameters;
mod raster;
mod steps;

#[cfg(test)]
mod tests;

pub use config::{DepthConfig, DepthRates};
pub use groups::GaussianGroups;
pub(crate) use learner::{DepthContext, DepthLearner};
pub use parameters::{DepthGaussians, Numbers, Parameters, WIDTHS};
pub use steps::{DepthCpuSteps, DepthStepper, LEAST_EPSILON, StepSize};
