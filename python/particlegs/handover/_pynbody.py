"""pynbody: simulation snapshots."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._units import carried, text_of
from ._common import mass_of_each, needed, right_box

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._snapshot import Snapshot
    from .._types import Known, Numbers


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
    positions, unit = _in_whole_units(sim["pos"])
    properties = sim.properties
    said: dict[str, Any] = {"scale_factor": properties.get("a"), "hubble": properties.get("h")}
    if unit is not None:
        said.update(units=text_of(unit), comoving=" a" in str(unit))
    if "mass" in sim.loadable_keys() or "mass" in sim.keys():  # noqa: SIM118
        masses, mass_unit = _in_whole_units(sim["mass"])
        if np.all(masses > 0):
            said.update(masses=masses, mass_units=None if mass_unit is None else text_of(mass_unit))
    box = properties.get("boxsize")
    if box is not None:
        length = float(box.in_units(unit, **sim.conversion_context())) if hasattr(box, "in_units") else float(box)
        low = positions.min() < -1e-6 * length
        said.update(box=length, origin=[-0.5 * length if low else 0.0] * 3)
    return cls(positions, **{**said, **known})


def _in_whole_units(values: Any) -> tuple[Numbers, Optional[Any]]:
    """Values in their unit without its power of ten, and the unit."""
    unit = carried(values)
    if unit is None:
        return np.asarray(values).view(np.ndarray), None
    whole = needed("pynbody.units").Unit(re.sub(r"^[0-9.]+(e[+-]?[0-9]+)? (?=\S)", "", str(unit)))
    if str(whole) == str(unit):
        return np.asarray(values).view(np.ndarray), whole
    return np.asarray(values.in_units(whole)).view(np.ndarray), whole


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
