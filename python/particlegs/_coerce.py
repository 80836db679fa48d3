"""Converts arguments for the native module."""

from __future__ import annotations

import json
import operator
import os
from collections.abc import Mapping
from typing import Any, Callable, Optional, Union

import numpy as np

from . import _units
from ._particlegs import InputError
from ._types import Float32, Float64, Numbers, Path, Progress
from ._units import plain

#: Origin, cell vectors as rows, which of them are periodic.
Cell = tuple[list[float], list[list[float]], list[bool]]


def paths(given: Union[Path, Any]) -> list[str]:
    """One or more paths."""
    if isinstance(given, (str, os.PathLike)):
        given = [given]
    return [str(os.fspath(p)) for p in given]


def texts(given: Any) -> list[str]:
    """One or more names or numbers."""
    if given is None:
        return []
    if isinstance(given, (str, int)):
        given = [given]
    return [str(name) for name in given]


def names(given: Any) -> Optional[list[str]]:
    """Names of layers; None for all."""
    return None if given is None else texts(given)


def record(options: Mapping[str, Any]) -> str:
    """Options as JSON, with numbers of NumPy as Python's."""

    def number(value: Any) -> Union[int, float]:
        return operator.index(value) if hasattr(value, "__index__") else float(value)

    try:
        return json.dumps(options, default=number, allow_nan=False)
    except ValueError:
        raise InputError("options must be finite numbers") from None


def progress(given: Progress) -> Optional[Callable[[str, int, int], object]]:
    """The progress function: the user's own, a progress bar for True, None for False or None."""
    if given is None or given is False:
        return None
    if given is True:
        from ._progress import shown

        return shown()
    if callable(given):
        return given
    raise TypeError("progress must be True, False or a function of (phase, done, total)")


def _lies_well(column: Numbers) -> bool:
    """Whether it is native, contiguous, aligned float32."""
    kind, flags = column.dtype, column.flags
    return bool(kind == np.float32 and kind.isnative and flags.c_contiguous and flags.aligned)


def _is_columns(given: Any) -> bool:
    """Whether it is three arrays x, y, z, not three rows."""
    if not isinstance(given, (tuple, list)) or len(given) != 3:
        return False
    return all(np.ndim(c) == 1 for c in given) and any(hasattr(c, "__array__") for c in given)


def positions(
    given: Any, units: Optional[str] = None
) -> tuple[Union[Numbers, tuple[Float32, Float32, Float32]], Optional[Any]]:
    """Positions for the native module, and their unit: `units`, or the unit of the array.

    Three float32 columns stay three columns; otherwise the result is one array (n, 3).
    """
    columns = _is_columns(given)
    unit = units if units is not None else _units.carried(given[0] if columns else given)
    if columns:
        x, y, z = (plain(c, "positions", unit) for c in given)
        if not x.shape == y.shape == z.shape:
            raise InputError("x, y and z must have the same length")
        if all(_lies_well(c) for c in (x, y, z)):
            return (x, y, z), unit
        return np.stack((x, y, z), axis=1), unit
    array = plain(given, "positions", unit)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"positions must have shape (n, 3) or be three columns, not {array.shape}")
    if _lies_well(array.T) and not array.flags.c_contiguous:
        return (array[:, 0], array[:, 1], array[:, 2]), unit
    # The native module reads any number type and byte order in place, but only positive strides.
    if array.dtype.kind == "b" or array.dtype.itemsize > 8 or min(array.strides) < 0 or not array.flags.aligned:
        array = np.require(array, np.float64, ["C", "A"])
    return array, unit


def column(given: Any, what: str, unit: Optional[Any] = None) -> Float32:
    """A float32 column."""
    array = plain(given, what, unit)
    if array.ndim != 1:
        raise InputError(f"{what} must have shape (n,), not {array.shape}")
    with np.errstate(over="ignore"):
        return np.require(array, np.float32, ["C", "A"])


def points(given: Any, unit: Optional[str] = None) -> Float64:
    """float64 points, (n, 3), in a unit."""
    array = plain(given, "points", unit)
    if array.ndim == 1 and array.shape == (3,):
        array = array[None, :]
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"points must have shape (n, 3), not {array.shape}")
    return np.require(array, np.float64, ["C", "A"])


def field(given: Any, name: str) -> tuple[Optional[str], Float64]:
    """A field's unit and its numbers."""
    unit = _units.unit_of(given)
    array = plain(given, f"field {name!r}", unit)
    return unit, np.require(array, np.float64, ["C", "A"])


def cells(given: Any) -> Union[int, list[int]]:
    """Numbers of cells: along the longest edge, or along x, y and z."""
    try:
        numbers = [operator.index(n) for n in np.atleast_1d(given)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in (1, 3) or min(numbers) < 1:
        raise InputError(f"cells must be one or three whole numbers from 1, not {given!r}")
    return numbers if len(numbers) == 3 else numbers[0]


def size_of(given: Any) -> tuple[int, int]:
    """Width and height in pixels."""
    try:
        width, height = (operator.index(n) for n in given)
    except (TypeError, ValueError) as error:
        raise InputError("size must be (width, height), whole numbers of pixels") from error
    return width, height


def _floats(given: Any, unit: Optional[Any], what: str) -> Float64:
    """Numbers of any shape in a unit."""
    given = _units.bare_in(given, unit, what)
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} must be numbers: {error}") from error


def lengths(given: Any, unit: Optional[str], what: str) -> list[float]:
    """Three numbers in a unit; one number stands for all three."""
    numbers = _floats(given, unit, what)
    if numbers.shape not in ((), (3,)):
        raise InputError(f"{what} must be one or three numbers")
    return [float(v) for v in np.broadcast_to(numbers, (3,))]


def _lattice(lengths: Float64, angles: Float64) -> Float64:
    """Cell vectors from lengths and angles (degrees), by the usual convention: a along x, b in the xy plane."""
    alpha, beta, gamma = np.radians(angles)
    a, b, c = lengths
    cx = c * np.cos(beta)
    cy = c * (np.cos(alpha) - np.cos(beta) * np.cos(gamma)) / np.sin(gamma)
    rest = c * c - cx * cx - cy * cy
    if not rest > 0:
        raise InputError("a box with these angles has no volume")
    vectors = np.array([[a, 0, 0], [b * np.cos(gamma), b * np.sin(gamma), 0], [cx, cy, np.sqrt(rest)]])
    # Removes the rounding errors of right angles.
    vectors[np.abs(vectors) < 1e-12 * np.max(lengths)] = 0.0
    return vectors


def vectors_of(box: Any, unit: Optional[Any] = None) -> Float64:
    """Cell vectors, (3, 3), in a unit, from one length, three lengths, three lengths and three angles, or vectors."""
    numbers = _floats(box, unit, "the box")
    if numbers.ndim == 0:
        return np.diag([float(numbers)] * 3)
    if numbers.shape == (3,):
        return np.diag(numbers)
    if numbers.shape == (6,):
        right = bool(np.all(numbers[3:] == 90.0))
        return np.diag(numbers[:3]) if right else _lattice(numbers[:3], numbers[3:])
    if numbers.shape == (3, 3):
        return numbers
    raise InputError("box must be a length, three lengths, three lengths and three angles, or a (3, 3) array")


def is_right(vectors: Float64) -> bool:
    """Whether the cell vectors are along x, y and z."""
    return bool(np.all(vectors == np.diag(np.diag(vectors))))


def cell(box: Any, pbc: Any, origin: Any, unit: Optional[Any] = None) -> Optional[Cell]:
    """The cell for the native module; None without a box."""
    if box is None:
        if origin is not None:
            raise InputError("origin needs box: it is the lowest corner of the box")
        return None
    vectors = vectors_of(box, unit)
    # Vectors of length 0, as of a slab, are not periodic.
    stated = vectors[np.any(vectors != 0, axis=1)]
    if not np.all(np.isfinite(vectors)) or not len(stated) or np.linalg.matrix_rank(stated) < len(stated):
        raise InputError("the box must be finite and have a volume")
    if np.ndim(box) < 2 and np.any(np.diag(vectors) < 0):
        raise InputError("the lengths of the box must be positive")
    periodic = [bool(pbc)] * 3 if np.ndim(pbc) == 0 else [bool(p) for p in pbc]
    corner = [0.0] * 3 if origin is None else lengths(origin, unit, "origin")
    if len(periodic) != 3 or len(corner) != 3:
        raise InputError("pbc must be one or three booleans, and origin three numbers")
    return (corner, vectors.tolist(), periodic)


def bytes_of(size: Union[int, str, None]) -> Optional[int]:
    """A size in bytes: a number, or text such as ``11MB`` or ``1.5GiB``."""
    if size is None:
        return None
    if isinstance(size, (int, np.integer)):
        return int(size)
    text = str(size).strip()
    number = text.rstrip("BbKkMmGgIi ")
    units: dict[str, float] = {"": 1, "b": 1, "kb": 1e3, "k": 1e3, "mb": 1e6, "m": 1e6, "gb": 1e9, "g": 1e9}
    units.update({"kib": 2**10, "mib": 2**20, "gib": 2**30})
    try:
        return int(float(number) * units[text[len(number) :].strip().lower()])
    except (KeyError, OverflowError, ValueError) as error:
        raise InputError(f'"{size}" is not a size: give bytes, or a number with kB, MB, GB, KiB, MiB or GiB') from error


def share(value: Union[float, str]) -> float:
    """A share: 0.01, or text such as ``1%``."""
    try:
        if isinstance(value, str) and value.strip().endswith("%"):
            return float(f"{value.strip()[:-1].strip()}e-2")
        return float(value)
    except ValueError as error:
        raise InputError(f'"{value}" is not a share: give 0.01 or "1%"') from error
