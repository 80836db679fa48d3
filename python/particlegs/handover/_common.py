"""What the modules share."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._particlegs import InputError
from .._types import Float64

if TYPE_CHECKING:
    from .._snapshot import Snapshot
    from .._types import Known

#: Angstrom in a unit of length, as molecular dynamicists call them.
ANGSTROM = {"Angstrom": 1.0, "angstrom": 1.0, "A": 1.0, "Å": 1.0, "nm": 10.0, "pm": 0.01, "Bohr": 0.529177210903}
#: Daltons in a unit of mass.
DALTON = {"Da": 1.0, "u": 1.0, "amu": 1.0, "g/mol": 1.0}


def needed(name: str) -> Any:
    """A package that only this hand-over takes.

    Raises
    ------
    ImportError
        Where it is not installed, with what installs it.
    """
    package = name.partition(".")[0]
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise ImportError(f"this takes the package {package}: pip install {package}", name=package) from error


def factor(unit: Optional[str], table: dict[str, float], what: str, to: str) -> float:
    """The factor that takes a unit to that of the table; plain numbers are in it already.

    Raises
    ------
    InputError
        For a unit that the table does not have.
    """
    if unit is None:
        return 1.0
    if unit not in table:
        raise InputError(f"{what} in {unit} cannot be converted to {to}: there are {', '.join(table)}")
    return table[unit]


def from_molecules(known: Known) -> tuple[float, float]:
    """The factors that take Angstrom and Da to the units that are asked for."""
    length = factor(known.get("units"), ANGSTROM, "positions", "Angstrom")
    return 1.0 / length, 1.0 / factor(known.get("mass_units"), DALTON, "masses", "Da")


def without_h(unit: str, hubble: Optional[float]) -> tuple[str, float]:
    """A unit without the Hubble parameter, and the factor that takes values to it: ``Mpc/h`` to ``Mpc``.

    Raises
    ------
    InputError
        Where h is in the unit and its value is not known.
    """
    if not unit.endswith("/h"):
        return unit, 1.0
    if hubble is None:
        raise InputError(f"{unit} takes the value of h: state it by hubble=")
    return unit[:-2], 1.0 / hubble


def mass_of_each(snapshot: Snapshot) -> Optional[Float64]:
    """The mass of each particle, (n,); None where masses are not known."""
    masses = snapshot.masses
    return None if masses is None else np.broadcast_to(np.asarray(masses, dtype=np.float64), (len(snapshot),))


def right_box(snapshot: Snapshot, package: str) -> Optional[Float64]:
    """The lengths of a box along x, y and z; None without a box.

    Raises
    ------
    InputError
        For a tilted box, which `package` does not know.
    """
    box = snapshot.box
    if box is None:
        return None
    if not np.array_equal(box, np.diag(np.diag(box))):
        raise InputError(f"{package} knows boxes along x, y and z alone, and this one is tilted")
    return np.diag(box).copy()
