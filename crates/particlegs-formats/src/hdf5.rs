//! HDF5 snapshot. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// HDF5 snapshot.
pub const FORMAT: Format = Format {
    name: "hdf5",
    title: "HDF5 snapshot",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "HDF5 snapshot cannot be read yet")),
};
