//! Small mathematics that every module uses: symmetric 3x3 matrices, random draws that do not depend
//! on order, and functions of whole vectors.

mod random;
mod symmetric;
mod vector;

pub use random::{Purpose, Random};
pub use symmetric::{Eigen, Sym3};
/// What `of` makes of each axis: x, y and z are 0, 1 and 2. A plain array: `std::array::from_fn` takes the compiler
/// six functions for every closure, and vectors of three are made in hundreds of places.
#[inline(always)]
pub fn each_axis<T>(mut of: impl FnMut(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

pub use vector::{Matrix, across, add_product, exp2};
