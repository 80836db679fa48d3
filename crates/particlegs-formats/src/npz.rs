//! NumPy archive. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// NumPy archive.
pub const FORMAT: Format = Format {
    name: "npz",
    title: "NumPy archive",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "NumPy archive cannot be read yet")),
};
