"""What users hand over, as what the native half takes."""

from __future__ import annotations

import os

import numpy as np

from ._particlegs import InputError


def paths(given):
    """A path, or several."""
    if isinstance(given, (str, os.PathLike)):
        given = [given]
    return [os.fspath(p) for p in given]


def texts(given):
    """A name or a number, or several."""
    if given is None:
        return []
    if isinstance(given, (str, int)):
        given = [given]
    return [str(name) for name in given]


def progress(given):
    """The function that is told of progress: the user's own, tqdm's bar for True, none for False or None."""
    if given is None or given is False:
        return None
    if given is True:
        from ._progress import Bar

        return Bar()
    if callable(given):
        return given
    raise TypeError("progress must be True, False or a function of (phase, done, total)")


def unit_of(values):
    """The unit of values that carry one (astropy, unyt, yt, swiftsimio), as text; None of plain numbers."""
    unit = getattr(values, "unit", None)
    if unit is None:
        unit = getattr(values, "units", None)
    text = None if unit is None or callable(unit) else str(unit)
    return None if text in (None, "", "dimensionless", "NoUnit()") else text


def plain(values, what):
    """A plain array of numbers, where it lies."""
    array = getattr(values, "value", values) if hasattr(values, "unit") and hasattr(values, "value") else values
    array = np.asarray(array).view(np.ndarray)
    if np.ma.isMaskedArray(values) and np.ma.is_masked(values):
        raise InputError(f"{what} must not be masked: leave the masked ones out")
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{what} must be real numbers, not of type {array.dtype}")
    return array


def _lies_well(column):
    """Native, contiguous, aligned float32?"""
    return column.dtype == np.float32 and column.dtype.isnative and column.flags.c_contiguous and column.flags.aligned


def _contiguous(array, dtype=None):
    """The array in native order, contiguous and aligned: itself where it is."""
    dtype = dtype or array.dtype.newbyteorder("=")
    return np.require(array, dtype=dtype, requirements=["C", "A"])


def positions(given):
    """Positions as the native half takes them, and their unit.

    Three columns stay three columns where each lies as float32; otherwise there is one array (n, 3).
    """
    unit = unit_of(given)
    if isinstance(given, (tuple, list)) and len(given) == 3 and all(np.ndim(c) == 1 for c in given) and (
        any(hasattr(c, "__array__") for c in given)
    ):
        columns = [plain(c, "positions") for c in given]
        unit = unit or unit_of(given[0])
        if len({c.shape for c in columns}) != 1:
            raise InputError("x, y and z must have one length")
        if all(_lies_well(c) for c in columns):
            return tuple(columns), unit
        return np.stack(columns, axis=1), unit
    array = plain(given, "positions")
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"positions must have the shape (n, 3), or be three columns; they have {array.shape}")
    if _lies_well(array.T) and not array.flags.c_contiguous:
        return tuple(array.T), unit
    # Numbers of any kind and order are read where they lie, along strides that go forwards.
    if array.dtype.kind == "b" or array.dtype.itemsize > 8 or min(array.strides) < 0 or not array.flags.aligned:
        array = _contiguous(array, np.float64)
    return array, unit


def column(given, what):
    """A float32 column."""
    array = plain(given, what)
    if array.ndim != 1:
        raise InputError(f"{what} must have the shape (n,); they have {array.shape}")
    with np.errstate(over="ignore"):
        return _contiguous(array, np.float32)


def points(given):
    """float64 points, (n, 3)."""
    array = plain(given, "points")
    if array.ndim == 1 and array.shape == (3,):
        array = array[None, :]
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"points must have the shape (n, 3); they have {array.shape}")
    return _contiguous(array, np.float64)


def _lattice(lengths, angles):
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


def vectors_of(box):
    """Cell vectors, (3, 3): of one length, of three, of three with three angles, or as they are."""
    numbers = np.asarray(getattr(box, "value", box), dtype=np.float64)
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


def cell(box, pbc, origin):
    """The cell as the native half takes it; None without a box."""
    if box is None:
        if origin is not None:
            raise InputError("origin is the box's lowest corner: give box, too")
        return None
    vectors = vectors_of(box)
    if not np.all(np.isfinite(vectors)) or not abs(np.linalg.det(vectors)) > 0:
        raise InputError("the box must be finite and have a volume")
    if np.all(vectors == np.diag(np.diag(vectors))) and np.any(np.diag(vectors) <= 0):
        raise InputError("the lengths of the box must be positive")
    periodic = [bool(pbc)] * 3 if np.ndim(pbc) == 0 else [bool(p) for p in pbc]
    corner = [0.0] * 3 if origin is None else [float(v) for v in np.asarray(getattr(origin, "value", origin))]
    if len(periodic) != 3 or len(corner) != 3:
        raise InputError("pbc takes one or three truth values, origin three numbers")
    return (corner, vectors.tolist(), periodic)


def bytes_of(size):
    """A size in bytes: a number, or text such as ``11MB`` or ``1.5GiB``."""
    if size is None or isinstance(size, (int, np.integer)):
        return None if size is None else int(size)
    text = str(size).strip()
    number = text.rstrip("BbKkMmGgIi ")
    units = {"": 1, "b": 1, "kb": 1e3, "k": 1e3, "mb": 1e6, "m": 1e6, "gb": 1e9, "g": 1e9}
    units.update({"kib": 2**10, "mib": 2**20, "gib": 2**30})
    try:
        return int(float(number) * units[text[len(number) :].strip().lower()])
    except (KeyError, ValueError) as error:
        raise InputError(f'size "{size}" is not a number with B, kB, MB, GB, KiB, MiB or GiB') from error


def share(value):
    """A share: 0.01, or text such as ``1%``."""
    if isinstance(value, str) and value.strip().endswith("%"):
        return float(f"{value.strip()[:-1].strip()}e-2")
    return float(value)
