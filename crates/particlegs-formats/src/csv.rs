//! Table of text. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// Table of text.
pub const FORMAT: Format = Format {
    name: "csv",
    title: "Table of text",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "Table of text cannot be read yet")),
};
