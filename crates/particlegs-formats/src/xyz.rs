//! XYZ. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// XYZ.
pub const FORMAT: Format = Format {
    name: "xyz",
    title: "XYZ",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "XYZ cannot be read yet")),
};
