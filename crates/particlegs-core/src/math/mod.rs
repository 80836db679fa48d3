//! Small mathematics that every module uses: symmetric 3x3 matrices, random draws that do not depend
//! on order, and functions of whole vectors.

mod random;
mod symmetric;
mod vector;

pub use random::{Purpose, Random};
pub use symmetric::{Eigen, Sym3};
pub use vector::{Matrix, across, add_product, exp2};
