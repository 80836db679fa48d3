//! csv. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// csv.
pub const FORMAT: Format = Format {
    name: "csv",
    title: "csv",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "cannot be read yet")),
};
