//! Small mathematics that every room uses: symmetric 3x3 matrices, random draws that do not depend
//! on order, and the SIMD level chosen at run time.

mod random;
mod simd;
mod symmetric;
mod vector;

pub use random::{Purpose, Random};
pub use simd::{disable_simd, simd_level, without_simd};
pub use symmetric::{Eigen, Sym3};
pub use vector::{across, add_product, exp2};
