"""pynbody: simulation snapshots."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._units import carried
from ._common import mass_of_each, needed, right_box

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._snapshot import Snapshot
    from .._types import Known


def from_pynbody(cls: type[Snapshot], /, sim: Any, **known: Unpack[Known]) -> Snapshot:
    """Takes the particles of pynbody: positions, masses, box, scale factor and h.

    Parameters
    ----------
    sim : pynbody.snapshot.SimSnap
        A snapshot, or a part of it such as ``sim.dm``.
    **known
        As for `Snapshot`; in place of what the particles say.

    Returns
    -------
    Snapshot
        In the units of `sim`, without powers of ten: ``1e10 Msol h**-1`` become ``Msun/h``. The box begins at 0, or
        at minus half its length where positions are below 0, as pynbody wraps them.
    """
    positions = _in_whole_units(sim["pos"])
    unit = carried(positions)
    properties = sim.properties
    said: dict[str, Any] = {"scale_factor": properties.get("a"), "hubble": properties.get("h")}
    if unit is not None:
        said["comoving"] = " a" in str(unit)
    if "mass" in sim.loadable_keys() or "mass" in sim.keys():  # noqa: SIM118
        masses = _in_whole_units(sim["mass"])
        if np.all(masses > 0):
            said["masses"] = masses
    box = properties.get("boxsize")
    if box is not None:
        length = float(box.in_units(unit, **sim.conversion_context())) if hasattr(box, "in_units") else float(box)
        low = positions.min() < -1e-6 * length
        corner = -0.5 * length if low else 0.0
        array = needed("pynbody.array").SimArray
        said.update(box=array([length] * 3, unit), origin=array([corner] * 3, unit))
    return cls(positions, **{**said, **known})


def _in_whole_units(values: Any) -> Any:
    """Values in their unit without its power of ten."""
    unit = str(carried(values))
    whole = re.sub(r"^[0-9.]+(e[+-]?[0-9]+)? (?=\S)", "", unit)
    return values if whole == unit else values.in_units(whole)


def to_pynbody(snapshot: Snapshot, family: str = "dm") -> Any:
    """Hands the particles to pynbody.

    Parameters
    ----------
    family : str
        The family that they are of: ``"dm"``, ``"gas"``, ``"star"``, ...

    Returns
    -------
    pynbody.snapshot.SimSnap
        With ``pos``, ``mass`` (1 where masses are not known), and the box, scale factor and h as properties.

    Raises
    ------
    InputError
        For a box that is tilted or not a cube.
    """
    from .._particlegs import InputError

    pynbody = needed("pynbody")
    sim = pynbody.new(**{family: len(snapshot)})
    sim["pos"] = np.asarray(snapshot.positions, dtype=np.float64)
    each = mass_of_each(snapshot)
    sim["mass"] = np.ones(len(snapshot)) if each is None else each
    length = _unit(snapshot.length_unit, bool(snapshot.metadata["comoving"]))
    mass = _unit(snapshot.mass_unit, False)
    if length is not None:
        sim["pos"].units = length
    if mass is not None:
        sim["mass"].units = mass
    box = right_box(snapshot, "pynbody")
    if box is not None:
        if np.ptp(box) > 1e-9 * box[0]:
            raise InputError("pynbody knows cubic boxes alone")
        sim.properties["boxsize"] = box[0] * pynbody.units.Unit(length) if length is not None else float(box[0])
    for name, key in (("a", "scale_factor"), ("h", "hubble")):
        if snapshot.metadata[key] is not None:
            sim.properties[name] = snapshot.metadata[key]
    return sim


def _unit(text: Optional[str], comoving: bool) -> Optional[str]:
    """A unit as pynbody writes it."""
    if text is None:
        return None
    name = text.replace("Msun", "Msol")
    by_h = name.endswith("/h")
    return f"{name[:-2] if by_h else name}{' a' if comoving else ''}{' h**-1' if by_h else ''}"
