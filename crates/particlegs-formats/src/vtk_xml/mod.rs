//! VTK XML (VTP, VTU). (Not read yet.)

use crate::Format;
use particlegs::Error;

/// VTK XML (VTP, VTU).
pub const FORMAT: Format = Format {
    name: "vtk-xml",
    title: "VTK XML (VTP, VTU)",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "VTK XML (VTP, VTU) cannot be read yet")),
};
