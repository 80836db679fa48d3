"""Shared by the modules."""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .. import _particlegs
from .._particlegs import InputError
from .._types import Float64

if TYPE_CHECKING:
    from .._snapshot import Snapshot
    from .._types import Known

#: Units of molecules.
_OF_MOLECULES = ("A", "Bohr", "nm", "pm", "amu", "kDa")
#: Names of astronomical units in yt and astropy.
SKY = {name: name for name in ("pc", "kpc", "Mpc", "Gpc", "AU", "km", "m", "cm", "Msun", "kg", "g")}


def needed(name: str) -> Any:
    """Imports a package that only this conversion needs.

    Raises
    ------
    ImportError
        If it is not installed; the message says how to install it.
    """
    package = name.partition(".")[0]
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise ImportError(f"this needs the package {package}: pip install {package}", name=package) from error


def factor(unit: Optional[str], dimension: str, to: str) -> float:
    """The factor from one molecular unit to another; 1 for numbers without a unit.

    Raises
    ------
    InputError
        If the unit is not a molecular unit.
    """
    if unit is None:
        return 1.0
    parts, into = _particlegs.unit_parts(unit, dimension), _particlegs.unit_parts(to, dimension)
    if parts is None or into is None or parts[1] not in _OF_MOLECULES or parts[4] != 0:
        raise InputError(f"{unit} cannot be converted to {to}: state another by units= or mass_units=")
    return parts[0] * parts[2] / (into[0] * into[2])


def from_molecules(known: Known) -> tuple[float, float]:
    """The factors from Angstrom and Da to the requested units."""
    return 1.0 / factor(known.get("units"), "length", "Angstrom"), 1.0 / factor(known.get("mass_units"), "mass", "Da")


def size_of(
    unit: str, dimension: str, hubble: Optional[float], names: Mapping[str, str], package: str
) -> tuple[float, str]:
    """A unit as a factor and a unit of another package, with h inserted: ``1e10 Msun/h`` in ``Msun``.

    Parameters
    ----------
    names
        Names of units in the package; it must know ``m`` and ``kg``.

    Raises
    ------
    InputError
        If the unit is unknown, or contains h and its value is unknown.
    """
    parts = _particlegs.unit_parts(unit, dimension)
    if parts is None:
        what = f'{package} does not know the unit "{unit}", and it cannot be converted to a known unit of {dimension}'
        raise InputError(f"{what}: state another by units= or mass_units=")
    number, name, size, _, power = parts
    if power != 0:
        if hubble is None:
            raise InputError(f"{unit} needs the value of h: give hubble=")
        number *= hubble**power
    if name in names:
        return number, names[name]
    return number * size, "kg" if dimension == "mass" else "m"


def power_of_h(unit: str, dimension: str) -> float:
    """The power of h in a unit: -1 in ``kpc/h``."""
    parts = _particlegs.unit_parts(unit, dimension)
    return 0.0 if parts is None else parts[4]


def above_and_below(unit: str) -> tuple[str, Optional[str], int]:
    """Splits a unit of density: ``1e10 Msun/h / (kpc/h)^2`` is ``1e10 Msun/h``, ``kpc/h`` and 2."""
    found = re.fullmatch(r"(.+) / (?:\((.+)\)|([^ /()]+))\^([23])", unit)
    return (unit, None, 0) if found is None else (found[1], found[2] or found[3], int(found[4]))


def mass_of_each(snapshot: Snapshot) -> Optional[Float64]:
    """The mass of each particle, (n,); None if masses are unknown."""
    masses = snapshot.masses
    return None if masses is None else np.broadcast_to(np.asarray(masses, dtype=np.float64), (len(snapshot),))


def right_box(snapshot: Snapshot, package: str) -> Optional[Float64]:
    """The lengths of a box along x, y and z; None without a box.

    Raises
    ------
    InputError
        For a tilted box, which `package` does not support.
    """
    box = snapshot.box
    if box is None:
        return None
    if not np.array_equal(box, np.diag(np.diag(box))):
        raise InputError(f"{package} supports only boxes along x, y and z, but this box is tilted")
    return np.diag(box).copy()
