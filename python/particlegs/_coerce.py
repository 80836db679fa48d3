"""What users hand over, as what the native half takes."""

from __future__ import annotations

import operator
import os
from typing import Any, Callable, Optional, Union

import numpy as np

from . import _units
from ._particlegs import InputError
from ._types import Float32, Float64, Numbers, Path, Progress
from ._units import plain

#: Origin, cell vectors by rows, which of them repeat.
Cell = tuple[list[float], list[list[float]], list[bool]]


def paths(given: Union[Path, Any]) -> list[str]:
    """A path, or several."""
    if isinstance(given, (str, os.PathLike)):
        given = [given]
    return [str(os.fspath(p)) for p in given]


def texts(given: Any) -> list[str]:
    """A name or a number, or several."""
    if given is None:
        return []
    if isinstance(given, (str, int)):
        given = [given]
    return [str(name) for name in given]


def names(given: Any) -> Optional[list[str]]:
    """Names of layers; None of all."""
    return None if given is None else texts(given)


def progress(given: Progress) -> Optional[Callable[[str, int, int], object]]:
    """The function that is told of progress: the user's own, a bar or text for True, none for False or None."""
    if given is None or given is False:
        return None
    if given is True:
        from ._progress import shown

        return shown()
    if callable(given):
        return given
    raise TypeError("progress must be True, False or a function of (phase, done, total)")


def _lies_well(column: Numbers) -> bool:
    """Native, contiguous, aligned float32?"""
    kind, flags = column.dtype, column.flags
    return bool(kind == np.float32 and kind.isnative and flags.c_contiguous and flags.aligned)


def _is_columns(given: Any) -> bool:
    """Three arrays x, y, z rather than three rows?"""
    if not isinstance(given, (tuple, list)) or len(given) != 3:
        return False
    return all(np.ndim(c) == 1 for c in given) and any(hasattr(c, "__array__") for c in given)


def positions(
    given: Any, units: Optional[str] = None
) -> tuple[Union[Numbers, tuple[Float32, Float32, Float32]], Optional[Any]]:
    """Positions as the native half takes them, and their unit: `units`, or what they carry.

    Three columns stay three columns where each lies as float32; otherwise there is one array (n, 3).
    """
    columns = _is_columns(given)
    unit = units if units is not None else _units.carried(given[0] if columns else given)
    if columns:
        x, y, z = (plain(c, "positions", unit) for c in given)
        if not x.shape == y.shape == z.shape:
            raise InputError("x, y and z must have one length")
        if all(_lies_well(c) for c in (x, y, z)):
            return (x, y, z), unit
        return np.stack((x, y, z), axis=1), unit
    array = plain(given, "positions", unit)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"positions must have the shape (n, 3), or be three columns; they have {array.shape}")
    if _lies_well(array.T) and not array.flags.c_contiguous:
        return (array[:, 0], array[:, 1], array[:, 2]), unit
    # Numbers of any kind and order are read where they lie, along strides that go forwards.
    if array.dtype.kind == "b" or array.dtype.itemsize > 8 or min(array.strides) < 0 or not array.flags.aligned:
        array = np.require(array, np.float64, ["C", "A"])
    return array, unit


def column(given: Any, what: str, unit: Optional[Any] = None) -> Float32:
    """A float32 column."""
    array = plain(given, what, unit)
    if array.ndim != 1:
        raise InputError(f"{what} must have the shape (n,); they have {array.shape}")
    with np.errstate(over="ignore"):
        return np.require(array, np.float32, ["C", "A"])


def points(given: Any, unit: Optional[str] = None) -> Float64:
    """float64 points, (n, 3), in a unit."""
    array = plain(given, "points", unit)
    if array.ndim == 1 and array.shape == (3,):
        array = array[None, :]
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"points must have the shape (n, 3); they have {array.shape}")
    return np.require(array, np.float64, ["C", "A"])


def size_of(given: Any) -> tuple[int, int]:
    """Width and height in pixels."""
    try:
        width, height = (operator.index(n) for n in given)
    except (TypeError, ValueError) as error:
        raise InputError("size takes width and height, whole numbers of pixels") from error
    return width, height


def _floats(given: Any, unit: Optional[Any], what: str) -> Float64:
    """Numbers of any shape in a unit."""
    given = _units.bare_in(given, unit, what)
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} must be numbers: {error}") from error


def lengths(given: Any, unit: Optional[str], what: str) -> list[float]:
    """Three numbers, or one for all, in a unit."""
    numbers = _floats(given, unit, what)
    if numbers.shape not in ((), (3,)):
        raise InputError(f"{what} must be a number, or three")
    return [float(v) for v in np.broadcast_to(numbers, (3,))]


def _lattice(lengths: Float64, angles: Float64) -> Float64:
    """Cell vectors of edges and angles (degrees): crystallographers' convention, a along x, b in the plane of x, y."""
    alpha, beta, gamma = np.radians(angles)
    a, b, c = lengths
    cx = c * np.cos(beta)
    cy = c * (np.cos(alpha) - np.cos(beta) * np.cos(gamma)) / np.sin(gamma)
    rest = c * c - cx * cx - cy * cy
    if not rest > 0:
        raise InputError("a box with these angles has no volume")
    vectors = np.array([[a, 0, 0], [b * np.cos(gamma), b * np.sin(gamma), 0], [cx, cy, np.sqrt(rest)]])
    # Right angles make zeros, not what is left of the cosine of 90 degrees.
    vectors[np.abs(vectors) < 1e-12 * np.max(lengths)] = 0.0
    return vectors


def vectors_of(box: Any, unit: Optional[Any] = None) -> Float64:
    """Cell vectors, (3, 3), in a unit: of one length, of three, of three with three angles, or as they are."""
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
    """Do the cell vectors lie along x, y and z?"""
    return bool(np.all(vectors == np.diag(np.diag(vectors))))


def cell(box: Any, pbc: Any, origin: Any, unit: Optional[Any] = None) -> Optional[Cell]:
    """The cell as the native half takes it; None without a box."""
    if box is None:
        if origin is not None:
            raise InputError("origin is the box's lowest corner: give box, too")
        return None
    vectors = vectors_of(box, unit)
    # Nothing repeats along vectors of zero, as of a slab.
    stated = vectors[np.any(vectors != 0, axis=1)]
    if not np.all(np.isfinite(vectors)) or not len(stated) or np.linalg.matrix_rank(stated) < len(stated):
        raise InputError("the box must be finite and have a volume")
    if np.ndim(box) < 2 and np.any(np.diag(vectors) < 0):
        raise InputError("the lengths of the box must be positive")
    periodic = [bool(pbc)] * 3 if np.ndim(pbc) == 0 else [bool(p) for p in pbc]
    corner = [0.0] * 3 if origin is None else lengths(origin, unit, "origin")
    if len(periodic) != 3 or len(corner) != 3:
        raise InputError("pbc takes one or three truth values, origin three numbers")
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
        raise InputError(f'size "{size}" is not a number with B, kB, MB, GB, KiB, MiB or GiB') from error


def share(value: Union[float, str]) -> float:
    """A share: 0.01, or text such as ``1%``."""
    try:
        if isinstance(value, str) and value.strip().endswith("%"):
            return float(f"{value.strip()[:-1].strip()}e-2")
        return float(value)
    except ValueError as error:
        raise InputError(f'"{value}" is no share: give 0.01 or "1%"') from error
