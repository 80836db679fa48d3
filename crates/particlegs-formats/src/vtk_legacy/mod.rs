//! legacy VTK. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// legacy VTK.
pub const FORMAT: Format = Format {
    name: "vtk-legacy",
    title: "legacy VTK",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "legacy VTK cannot be read yet")),
};
