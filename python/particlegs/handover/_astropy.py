"""Astropy: quantities and tables. `Snapshot` also accepts quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from .._particlegs import InputError
from ._common import SKY, above_and_below, needed, power_of_h, size_of

if TYPE_CHECKING:
    from .._arrays import Grid, Map
    from .._snapshot import Snapshot

#: Astropy's names of units, only those in FITS.
_NAMES = {**SKY, "Msun": "solMass", "Rsun": "solRad", "ly": "lyr", "A": "Angstrom", "nm": "nm", "um": "um", "amu": "u"}


def unit(text: Optional[str], dimension: str, hubble: Optional[float]) -> tuple[float, Any]:
    """A unit as a factor and an astropy unit: ``1e10 Msun/h`` in ``solMass``, or in ``solMass / littleh`` if h is
    unknown.

    Raises
    ------
    InputError
        If the unit is unknown.
    """
    units = needed("astropy.units")
    if text is None:
        return 1.0, units.dimensionless_unscaled
    power = power_of_h(text, dimension) if hubble is None else 0.0
    number, name = size_of(text, dimension, 1.0 if hubble is None else hubble, _NAMES, "astropy")
    found = units.Unit(name)
    return number, found if power == 0 else found * needed("astropy.cosmology.units").littleh ** power


def to_astropy(values: Union[Map, Grid], hubble: Optional[float] = None) -> Any:
    """Converts the values to an astropy quantity.

    Parameters
    ----------
    hubble : float, optional
        Value of h for units such as ``Mpc/h``; by default that of the values.

    Returns
    -------
    astropy.units.Quantity
        A copy of the values in units of the FITS standard; particle counts are dimensionless. If h is unknown, the unit
        contains ``littleh``: ``q.to("Msun / pc2", astropy.cosmology.units.with_H0(cosmology.H0))`` inserts its value.

    Raises
    ------
    InputError
        If the unit is unknown or missing.
    """
    if values.length_unit is None:
        raise InputError("the unit of length is unknown: state it by units= when you open the snapshot")
    h = values.hubble if hubble is None else hubble
    above, below, power = above_and_below(values.unit)
    mass, of = unit(None if above in ("particles", "mass") else above, "mass", h)
    length, per = unit(below or values.length_unit, "length", h)
    return needed("astropy.units").Quantity(np.array(values, subok=False) * (mass / length**power), of / per**power)


def snapshot_to_astropy(snapshot: Snapshot, hubble: Optional[float] = None) -> Any:
    """Converts the particles to an astropy table, whose ``write("particles.fits")`` writes FITS.

    Parameters
    ----------
    hubble : float, optional
        Value of h for units such as ``Mpc/h``; the snapshot's by default.

    Returns
    -------
    astropy.table.QTable
        Columns ``position`` (n, 3) and, if known, ``mass``, with their units (with ``littleh`` if h is unknown). Box
        vectors, cosmology and time are in the metadata.

    Raises
    ------
    InputError
        If the unit is unknown.
    """
    quantity = needed("astropy.units").Quantity
    h = snapshot.metadata["hubble"] if hubble is None else hubble
    scale, length = unit(snapshot.length_unit, "length", h)
    table = needed("astropy.table").QTable()
    table["position"] = quantity(np.array(snapshot.positions) * scale, length)
    masses = snapshot.masses
    if masses is not None:
        number, mass = unit(snapshot.mass_unit, "mass", h)
        table["mass"] = quantity(np.broadcast_to(masses, (len(snapshot),)) * number, mass)
    box, origin = snapshot.box, snapshot.origin
    if box is not None and origin is not None:
        table.meta.update(box=quantity(box * scale, length), origin=quantity(origin * scale, length))
        table.meta["periodic"] = snapshot.periodic
    known = ("name", "comoving", "scale_factor", "hubble", "time")
    table.meta.update({key: snapshot.metadata[key] for key in known if snapshot.metadata[key] is not None})
    return table
