"""Units of arrays (astropy, unyt of yt and swiftsimio, pynbody): as text, and conversion."""

from __future__ import annotations

import re
from typing import Any, Optional

import numpy as np

from ._particlegs import InputError, unit_parts
from ._types import Numbers

#: Translates unit names of other packages.
_NAMES = [
    (r"\s*/\s*", "/"),
    (r"\blittleh\b", "h"),
    (r"\b(solMass|Msol|M_sun|Msun)\b", "Msun"),
    (r"\bangstrom\b", "Angstrom"),
    (r"\b([kMG]?pc|[ckm]?m|AU)cm\b", r"\1"),
    (r"^(.*\S) h\*\*-1$", r"\1/h"),
    (r"^(.*\S) a(/h)?$", r"\1\2"),
]
#: Texts that mean there is no unit.
_NOTHING = ("", "1", "dimensionless", "NoUnit()", "None")


def carried(values: Any) -> Any:
    """The unit of values, as an object of their package; None for plain numbers."""
    unit = getattr(values, "unit", None)
    if unit is None:
        unit = getattr(values, "units", None)
    return None if unit is None or callable(unit) or str(unit) in _NOTHING else unit


def text_of(unit: Any) -> Optional[str]:
    """A unit as text, such as ``Mpc/h``."""
    text = str(unit).strip()
    if text in _NOTHING:
        return None
    for pattern, name in _NAMES:
        text = re.sub(pattern, name, text)
    return text


def unit_of(values: Any) -> Optional[str]:
    """The unit of values, as text; None for plain numbers."""
    unit = carried(values)
    return None if unit is None else text_of(unit)


def bare(values: Any) -> Any:
    """The numbers without their unit, not copied."""
    if carried(values) is None:
        return values
    return values.view(np.ndarray) if isinstance(values, np.ndarray) else getattr(values, "value", values)


def bare_in(values: Any, unit: Optional[Any], what: str) -> Any:
    """The numbers of values in a unit; plain numbers are taken to be in it.

    Raises
    ------
    InputError
        If the units cannot be converted.
    """
    own, text = carried(values), None if unit is None else text_of(unit)
    if own is None or text_of(own) == text:
        return bare(values)
    if text is None:
        raise InputError(f"{what} is in {text_of(own)}, but the unit of the particles is unknown: state it by units=")
    if getattr(values, "dtype", None) == np.float32:
        # Masses of galaxies in grams overflow float32.
        values = values.astype(np.float64)
    for convert in (getattr(values, name, None) for name in ("to_value", "in_units")):
        for target in (unit, text):
            if convert is None:
                continue
            # Every package has its own exceptions for units that are unknown or do not fit.
            try:
                return np.asarray(convert(target)).view(np.ndarray)
            except Exception:  # noqa: BLE001
                continue
    raise InputError(f"{what} in {text_of(own)} cannot be converted to {text}")


def number_in(value: Any, unit: Optional[Any], what: str) -> float:
    """One number in a unit."""
    try:
        return float(bare_in(value, unit, what))
    except (TypeError, ValueError) as error:
        raise error if isinstance(error, InputError) else InputError(f"{what} must be a number") from error


def moment_of(values: Any) -> dict[str, Any]:
    """Whether values are comoving, and the scale factor, from swiftsimio's attributes or from the unit."""
    comoving = getattr(values, "comoving", None)
    if not isinstance(comoving, (bool, np.bool_)):
        parts = unit_parts(str(carried(values)), "length")
        return {} if parts is None or parts[3] == 0 else {"comoving": True, "scale_factor": None}
    scale = getattr(getattr(values, "cosmo_factor", None), "scale_factor", None)
    return {"comoving": bool(comoving), "scale_factor": None if scale is None else float(scale)}


def plain(values: Any, what: str, unit: Optional[Any] = None) -> Numbers:
    """A plain array of numbers in a unit, copied only for conversion."""
    if np.ma.isMaskedArray(values) and np.ma.is_masked(values):
        raise InputError(f"{what} must not contain masked values: remove them first")
    array = np.asarray(bare_in(values, unit, what)).view(np.ndarray)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{what} must be real numbers, not of type {array.dtype}")
    return array


def named(values: Any) -> tuple[Any, Optional[str]]:
    """Values in a unit without a factor, and its name: ``1e10 Msun`` becomes ``Msun``."""
    text = unit_of(values)
    found = re.fullmatch(r"[0-9.]+(?:e[+-]?[0-9]+)?\s*\*?\s*([A-Za-z].*)", text or "")
    if found is None:
        return values, text
    try:
        return bare_in(values, found[1], "values"), found[1]
    except InputError:
        return values, text
