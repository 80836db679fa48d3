"""The window of a density map."""

from __future__ import annotations

import json
from typing import Any, NamedTuple, Optional

import numpy as np

from . import _coerce, _particlegs, _units
from ._camera import Camera, point
from ._particlegs import InputError
from ._types import Extent, Float64

#: Directions of view, up, and the world axes across and up a map, by the axis looked along.
_ALONG = {
    "x": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1, 2),
    "y": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), 0, 2),
    "z": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 0, 1),
}


class Window(NamedTuple):
    """A camera along an axis, and the extent of its picture."""

    #: In JSON, by the keys of views files.
    camera: str
    #: Columns and rows.
    pixels: tuple[int, int]
    extent: Extent
    axes: tuple[str, str]

    @classmethod
    def of(
        cls,
        model: _particlegs.Model,
        space: tuple[Float64, Optional[Float64], Optional[str]],
        center: Any,
        width: Any,
        depth: Any,
        axis: str,
        shape: tuple[int, int],
    ) -> Window:
        """The window for the given arguments; others follow from the model, whose `space` is bounds, box and unit."""
        if axis not in _ALONG:
            raise InputError(f'axis must be "x", "y" or "z", not "{axis}"')
        toward, up, across, upward = _ALONG[axis]
        rows, columns = _shape(shape)
        bounds, box, unit = space
        center_whole, width_whole = model.whole(toward, up, (columns, rows))
        middle = np.array(center_whole if center is None else point(center, "center", unit))
        wide = width_whole if width is None else _units.number_in(width, unit, "width")
        if not (np.isfinite(wide) and wide > 0):
            raise InputError("width must be positive and finite")
        tall = wide * rows / columns
        reach = _beyond(bounds, box, middle) if depth is None else 0.5 * _units.number_in(depth, unit, "depth")
        if not (np.isfinite(reach) and reach > 0):
            raise InputError("depth must be positive and finite")
        camera = Camera(
            position=point(middle + reach * np.array(toward), "position"),
            focal_point=point(middle, "center"),
            view_up=up,
            height=float(tall),
            clipping_range=None if depth is None else (0.0, 2.0 * reach),
        )
        x, y = float(middle[across]), float(middle[upward])
        extent = (x - 0.5 * wide, x + 0.5 * wide, y - 0.5 * tall, y + 0.5 * tall)
        return cls(json.dumps(camera._record()), (columns, rows), extent, ("xyz"[across], "xyz"[upward]))


def _shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns."""
    columns, rows = _coerce.size_of(shape[::-1])
    if not (0 < rows <= 32768 and 0 < columns <= 32768):
        raise InputError("shape must be (rows, columns), 1 to 32768 each")
    return rows, columns


def _beyond(bounds: Float64, box: Optional[Float64], middle: Float64) -> float:
    """A distance from which all particles are in front of the camera."""
    low, high = bounds
    edges = np.linalg.norm(high - low) + (0.0 if box is None else np.abs(box).sum())
    # The extent is 0 if all particles are at one point.
    return float(4.0 * edges + np.linalg.norm(middle - 0.5 * (low + high))) or 1.0
