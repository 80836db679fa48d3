//! NumPy array. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// NumPy array.
pub const FORMAT: Format = Format {
    name: "npy",
    title: "NumPy array",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "NumPy array cannot be read yet")),
};
