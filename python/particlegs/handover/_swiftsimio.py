"""swiftsimio: snapshots of SWIFT, through an HDF5 file."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._files import whole
from .._particlegs import InputError
from ._common import SKY, mass_of_each, needed, right_box, size_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._snapshot import Snapshot
    from .._types import Known, Path


def from_swiftsimio(
    cls: type[Snapshot], /, data: Any, species: str = "dark_matter", **known: Unpack[Known]
) -> Snapshot:
    """Converts particles loaded by swiftsimio: positions, masses, box, scale factor and h.

    ``particlegs.open`` reads the same files without swiftsimio, faster and with less memory.

    Parameters
    ----------
    data : swiftsimio.SWIFTDataset, or a part of it
        The result of ``swiftsimio.load`` (masked or not), or one species such as ``data.dark_matter``.
    species : str
        The species to convert from a whole data set.
    **known
        As for `Snapshot`; these override values of the data set.

    Returns
    -------
    Snapshot
        Comoving, in Mpc and Msun.
    """
    part = data if hasattr(data, "coordinates") else getattr(data, species)
    metadata = data.metadata
    cosmology = getattr(metadata, "cosmology", None)
    said: dict[str, Any] = {
        "units": "Mpc",
        "mass_units": "Msun",
        "box": metadata.boxsize.to_comoving(),
        "comoving": True,
        "scale_factor": float(np.squeeze(metadata.scale_factor)),
        "hubble": None if cosmology is None else float(cosmology.h),
        "masses": part.masses.to_comoving(),
        "name": os.path.basename(str(metadata.filename)),
    }
    return cls(part.coordinates.to_comoving(), **{**said, **known})


def to_swiftsimio(
    snapshot: Snapshot,
    path: Path,
    *,
    hubble: Optional[float] = None,
    overwrite: bool = False,
) -> Any:
    """Writes an HDF5 file with swiftsimio and opens it.

    Parameters
    ----------
    path : path
        The file.
    hubble : float, optional
        Value of h for units such as ``Mpc/h``; the snapshot's by default.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    swiftsimio.SWIFTDataset
        Dark matter with coordinates (Mpc), masses (Msun) and ids from 1. Velocities are 0, because particlegs does not
        store them.

    Raises
    ------
    InputError
        If box, masses or units are missing, or the units are not lengths and masses.
    FileExistsError
        If the path exists, unless `overwrite`.
    """
    swiftsimio, unyt = needed("swiftsimio"), needed("unyt")
    where = os.fspath(path)
    box, each = right_box(snapshot, "SWIFT"), mass_of_each(snapshot)
    if box is None or each is None:
        raise InputError("SWIFT files need a box and masses: give box= and masses= to Snapshot")
    if snapshot.length_unit is None or snapshot.mass_unit is None:
        raise InputError("SWIFT files need units: give units= and mass_units= to Snapshot")
    metadata = snapshot.metadata
    h = metadata["hubble"] if hubble is None else hubble
    length = _in(unyt, snapshot.length_unit, "length", h, "Mpc")
    mass = _in(unyt, snapshot.mass_unit, "mass", h, "Msun")
    a = metadata["scale_factor"] or 1.0

    def array(values: Any, unit: Any, exponent: int) -> Any:
        return swiftsimio.cosmo_array(values, unit, comoving=True, scale_factor=a, scale_exponent=exponent)

    corner = np.zeros(3) if snapshot.origin is None else snapshot.origin
    positions = np.asarray(snapshot.positions, dtype=np.float64) - corner
    # The file is marked comoving, so physical positions are divided by the scale factor.
    length = length if metadata["comoving"] is not False else length / a
    writer = swiftsimio.Writer(boxsize=array(box * length, unyt.Mpc, 1), scale_factor=a)
    part = writer.dark_matter
    part.coordinates = array(positions * length, unyt.Mpc, 1)
    part.velocities = array(np.zeros_like(positions), unyt.km / unyt.s, 0)
    part.masses = array(np.array(each) * mass, unyt.Msun, 0)
    part.particle_ids = np.arange(1, len(snapshot) + 1)
    with whole(where, overwrite) as begun:
        writer.write(begun)
    return swiftsimio.load(where)


def _in(unyt: Any, unit: str, dimension: str, hubble: Optional[float], to: str) -> float:
    """The factor from one unit to another."""
    number, name = size_of(unit, dimension, hubble, SKY, "swiftsimio")
    return number if name == to else number * float(unyt.unyt_quantity(1.0, name).to_value(to))
