"""Astropy: quantities and tables. Quantities come in as they are: ``Snapshot(positions, masses=..., box=...)``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from .._particlegs import InputError
from ._common import needed

if TYPE_CHECKING:
    from .._arrays import Grid, Map
    from .._snapshot import Snapshot


def unit(text: str) -> Any:
    """A unit of this package as astropy's: ``Msun/h / (Mpc/h)^2``, with h as ``littleh`` of its cosmology.

    Raises
    ------
    InputError
        For a unit that astropy does not know.
    """
    units, cosmology = needed("astropy.units"), needed("astropy.cosmology.units")
    above, _, below = text.partition(" / ")
    power = re.fullmatch(r"\(?(.+?)\)?(?:\^([0-9]+))?", below)

    def one(name: str) -> Any:
        if name == "particles":
            return units.dimensionless_unscaled
        try:
            with units.add_enabled_units([cosmology.littleh]):
                return units.Unit(re.sub(r"\bh\b", "littleh", name))
        except ValueError as error:
            raise InputError(f'astropy does not know the unit "{name}"') from error

    found = one(above)
    return found if power is None else found / one(power[1]) ** int(power[2] or 1)


def to_astropy(values: Union[Map, Grid]) -> Any:
    """The values as astropy has them.

    Returns
    -------
    astropy.units.Quantity
        The same numbers, copied, in their unit; numbers of particles have none. ``littleh`` is h:
        ``q.to("Msun / pc2", astropy.cosmology.units.with_H0(cosmology.H0))`` puts its value in.

    Raises
    ------
    InputError
        For a unit that astropy does not know, or where none was stated.
    """
    if values.length_unit is None:
        raise InputError("the unit of length is not known: state it by units= when the snapshot is opened")
    return needed("astropy.units").Quantity(np.array(values, subok=False), unit(values.unit))


def snapshot_to_astropy(snapshot: Snapshot) -> Any:
    """Hands the particles to astropy.

    Returns
    -------
    astropy.table.QTable
        Columns ``position`` (n, 3) and, where they are known, ``mass``, with units where they were stated; the box's
        vectors and what is known of the moment as metadata.

    Raises
    ------
    InputError
        For a unit that astropy does not know.
    """
    units = needed("astropy.units")
    length = units.dimensionless_unscaled if snapshot.length_unit is None else unit(snapshot.length_unit)
    mass = units.dimensionless_unscaled if snapshot.mass_unit is None else unit(snapshot.mass_unit)
    table = needed("astropy.table").QTable()
    table["position"] = units.Quantity(np.array(snapshot.positions), length)
    masses = snapshot.masses
    if masses is not None:
        table["mass"] = units.Quantity(np.broadcast_to(masses, (len(snapshot),)), mass)
    box, origin = snapshot.box, snapshot.origin
    if box is not None:
        table.meta.update(box=units.Quantity(box, length), origin=units.Quantity(origin, length))
        table.meta["periodic"] = snapshot.periodic
    known = ("name", "comoving", "scale_factor", "hubble", "time")
    table.meta.update({key: snapshot.metadata[key] for key in known if snapshot.metadata[key] is not None})
    return table
