//! GenericIO (HACC). (Not read yet.)

use crate::Format;
use particlegs::Error;

/// GenericIO (HACC).
pub const FORMAT: Format = Format {
    name: "genericio",
    title: "GenericIO (HACC)",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "GenericIO (HACC) cannot be read yet")),
};
