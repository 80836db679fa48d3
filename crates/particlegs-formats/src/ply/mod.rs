//! PLY points. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// PLY points.
pub const FORMAT: Format = Format {
    name: "ply",
    title: "PLY points",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "PLY points cannot be read yet")),
};
