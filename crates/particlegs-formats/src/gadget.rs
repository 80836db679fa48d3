//! Gadget binary. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// Gadget binary.
pub const FORMAT: Format = Format {
    name: "gadget",
    title: "Gadget binary",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "Gadget binary cannot be read yet")),
};
