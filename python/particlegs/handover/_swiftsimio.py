"""swiftsimio: snapshots of SWIFT, by an HDF5 file."""

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
    """Takes the particles of a snapshot that swiftsimio has loaded: positions, masses, box, scale factor and h.

    ``particlegs.open`` reads the same files without swiftsimio, faster and into less memory.

    Parameters
    ----------
    data : swiftsimio.SWIFTDataset, or a part of it
        What ``swiftsimio.load`` gives (masked or not), or one species such as ``data.dark_matter``.
    species : str
        The species of a whole data set.
    **known
        As for `Snapshot`; in place of what the data say.

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
    """Writes an HDF5 file by swiftsimio, and opens it.

    Parameters
    ----------
    path : path
        The file.
    hubble : float, optional
        Value of h of units such as ``Mpc/h``; the snapshot's by default.
    overwrite : bool
        Replace what is there.

    Returns
    -------
    swiftsimio.SWIFTDataset
        Dark matter: with coordinates (Mpc), masses (Msun), numbers from 1, and velocities of 0, which particlegs does
        not hold.

    Raises
    ------
    InputError
        Without a box, masses or units, or for units that are not lengths and masses.
    FileExistsError
        Where something is, unless `overwrite`.
    """
    swiftsimio, unyt = needed("swiftsimio"), needed("unyt")
    where = os.fspath(path)
    box, each = right_box(snapshot, "SWIFT"), mass_of_each(snapshot)
    if box is None or each is None:
        raise InputError("a file of SWIFT takes a box and masses: state them by box= and masses=")
    if snapshot.length_unit is None or snapshot.mass_unit is None:
        raise InputError("a file of SWIFT takes units: state them by units= and mass_units=")
    metadata = snapshot.metadata
    h = metadata["hubble"] if hubble is None else hubble
    length = _in(unyt, snapshot.length_unit, "length", h, "Mpc")
    mass = _in(unyt, snapshot.mass_unit, "mass", h, "Msun")
    a = metadata["scale_factor"] or 1.0

    def array(values: Any, unit: Any, exponent: int) -> Any:
        return swiftsimio.cosmo_array(values, unit, comoving=True, scale_factor=a, scale_exponent=exponent)

    corner = np.zeros(3) if snapshot.origin is None else snapshot.origin
    positions = np.asarray(snapshot.positions, dtype=np.float64) - corner
    # A file that says comoving holds positions at the time's scale.
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
    """The factor that takes a unit to another."""
    number, name = size_of(unit, dimension, hubble, SKY, "swiftsimio")
    return number if name == to else number * float(unyt.unyt_quantity(1.0, name).to_value(to))
