"""pynbody: simulation snapshots."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._units import carried
from ._common import SKY, mass_of_each, needed, power_of_h, right_box, size_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._snapshot import Snapshot
    from .._types import Known

#: Names of units in pynbody.
_NAMES = {**{name: name for name in SKY if name not in ("Gpc", "AU")}, "Msun": "Msol"}
#: Named units for factors of cm and g, in which simulations state their units.
_NAMED_BY = {**dict.fromkeys(("cm", "m", "km"), ("pc", "kpc", "Mpc")), **dict.fromkeys(("g", "kg"), ("Msol",))}
#: Relative tolerance of such a factor: codes use different numbers of digits.
_TOLERANCE = 1e-3
#: Families, and the names of layers that belong to them.
_FAMILIES = {
    "gas": ("gas", "parttype0"),
    "dm": ("dm", "dark matter", "dark_matter", "halo", "parttype1"),
    "star": ("star", "stars", "parttype4"),
    "bh": ("bh", "black holes", "black_holes", "parttype5"),
}


def from_pynbody(cls: type[Snapshot], /, sim: Any, **known: Unpack[Known]) -> Snapshot:
    """Converts particles of pynbody: positions, masses, families, box, scale factor and h.

    Parameters
    ----------
    sim : pynbody.snapshot.SimSnap
        A snapshot, or a part of it such as ``sim.dm``.
    **known
        As for `Snapshot`; these override values of the particles.

    Returns
    -------
    Snapshot
        In the units of `sim`, but as named units without factors: ``1e10 Msol h**-1`` becomes ``Msun/h``, and
        ``3.085678e21 cm a h**-1`` becomes ``kpc/h``. Families become layers. The box begins at 0, or at minus half its
        length if there are negative positions, as pynbody wraps them.
    """
    positions, length = _in_whole_units(sim["pos"])
    unit = carried(positions)
    properties = sim.properties
    said: dict[str, Any] = {"scale_factor": properties.get("a"), "hubble": properties.get("h")}
    if unit is not None:
        said["comoving"] = " a" in str(unit)
    if "mass" in sim.loadable_keys() or "mass" in sim.keys():  # noqa: SIM118
        masses, _ = _in_whole_units(sim["mass"])
        if np.all(masses > 0):
            said["masses"] = masses
    parts = [(family.name, len(sim[family])) for family in sim.families()]
    if len(parts) > 1 and sum(count for _, count in parts) == len(positions):
        said["layers"] = dict(parts)
    box = properties.get("boxsize")
    if box is not None:
        if hasattr(box, "in_units"):
            box = box.in_units(carried(sim["pos"]), **sim.conversion_context())
        edge = length * float(box)
        low = positions.min() < -1e-6 * edge
        corner = -0.5 * edge if low else 0.0
        array = needed("pynbody.array").SimArray
        said.update(box=array([edge] * 3, unit), origin=array([corner] * 3, unit))
    return cls(positions, **{**said, **known})


def _in_whole_units(values: Any) -> tuple[Any, float]:
    """Values in a named unit without a factor, and the factor applied."""
    unit = carried(values)
    found = re.fullmatch(r"(?:[0-9.]+(?:e[+-]?[0-9]+)? )?([A-Za-z]+)((?: (?:a|h)(?:\*\*\S+)?)*)", str(unit))
    if unit is None or found is None:
        return values, 1.0
    base, powers = found[1], found[2]
    for name in (*_NAMED_BY.get(base, ()), base):
        number = float(unit.ratio(name + powers))
        factor = 10.0 ** round(math.log10(number)) if name in ("Msol", base) else 1.0
        if abs(number / factor - 1.0) < _TOLERANCE:
            break
    else:
        factor = number
    if factor == 1.0 and name == base:
        return values, 1.0
    # Masses of galaxies in grams overflow float32.
    numbers = np.asarray(values) if factor == 1.0 else np.asarray(values, dtype=np.float64) * factor
    return needed("pynbody.array").SimArray(numbers, name + powers), factor


def to_pynbody(snapshot: Snapshot, family: Optional[str] = None) -> Any:
    """Converts the particles to pynbody.

    Parameters
    ----------
    family : str, optional
        One family for all particles: ``"dm"``, ``"gas"``, ``"star"``, ... By default it follows from each layer's name,
        and is dark matter for unknown names.

    Returns
    -------
    pynbody.snapshot.SimSnap
        With ``pos``, ``mass`` (1 if masses are unknown), and the box, scale factor and h as properties.

    Raises
    ------
    InputError
        If the box is tilted or not a cube, or a unit is unknown.
    """
    from .._particlegs import InputError

    pynbody = needed("pynbody")
    places: dict[str, list[slice]] = {}
    for name, place in snapshot.layers.items():
        of = [f for f, names in _FAMILIES.items() if name.lower() in names]
        places.setdefault(family or (of[0] if of else "dm"), []).append(place)
    sim = pynbody.new(**{f: sum(p.stop - p.start for p in parts) for f, parts in places.items()})
    each = mass_of_each(snapshot)
    each = np.ones(len(snapshot)) if each is None else each
    columns = {"pos": np.asarray(snapshot.positions, dtype=np.float64), "mass": each}
    sim["pos"], sim["mass"] = np.zeros((len(snapshot), 3)), np.zeros(len(snapshot))
    for f, parts in places.items():
        for column, values in columns.items():
            sim[pynbody.family.get_family(f)][column] = np.concatenate([values[p] for p in parts])
    length = _unit(snapshot.length_unit, "length", bool(snapshot.metadata["comoving"]))
    mass = _unit(snapshot.mass_unit, "mass", False)
    if length is not None:
        sim["pos"].units = length
    if mass is not None:
        sim["mass"].units = mass
    box = right_box(snapshot, "pynbody")
    if box is not None:
        if np.ptp(box) > 1e-9 * box[0]:
            raise InputError("pynbody supports only cubic boxes")
        sim.properties["boxsize"] = box[0] * pynbody.units.Unit(length) if length is not None else float(box[0])
    for name, key in (("a", "scale_factor"), ("h", "hubble")):
        if snapshot.metadata[key] is not None:
            sim.properties[name] = snapshot.metadata[key]
    return sim


def _unit(text: Optional[str], dimension: str, comoving: bool) -> Optional[str]:
    """A unit as pynbody writes it, with its power of h."""
    if text is None:
        return None
    number, name = size_of(text, dimension, 1.0, _NAMES, "pynbody")
    power = power_of_h(text, dimension)
    words = ["" if number == 1.0 else repr(number), name, "a" if comoving else "", f"h**{power:g}" if power else ""]
    return " ".join(word for word in words if word)
