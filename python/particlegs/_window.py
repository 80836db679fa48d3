"""Where a density map lies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _coerce, _units
from ._camera import point
from ._particlegs import InputError
from ._types import Extent, Float64

if TYPE_CHECKING:
    from ._model import Model

#: Directions of view, up, and the world axes across and up a map, by the axis looked along.
_ALONG = {
    "x": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1, 2),
    "y": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), 0, 2),
    "z": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 0, 1),
}


class Window(NamedTuple):
    """A camera that looks along an axis, and what it sees."""

    camera: dict[str, Any]
    #: Columns and rows.
    pixels: tuple[int, int]
    extent: Extent
    axes: tuple[str, str]

    @classmethod
    def of(cls, model: Model, center: Any, width: Any, depth: Any, axis: str, shape: tuple[int, int]) -> Window:
        """Completes what is asked for by what the model holds."""
        if axis not in _ALONG:
            raise InputError(f'axis="{axis}": there are x, y and z')
        toward, up, across, upward = _ALONG[axis]
        rows, columns = _shape(shape)
        (low, high), unit = _region(model), model.length_unit
        middle = 0.5 * (low + high) if center is None else np.array(point(center, "center", unit))
        across_box = max(high[across] - low[across], (high[upward] - low[upward]) * columns / rows)
        wide = float(across_box) if width is None else _units.number_in(width, unit, "width")
        if not (np.isfinite(wide) and wide > 0):
            raise InputError("width must be positive and finite")
        tall = wide * rows / columns
        along = "xyz".index(axis)
        reach = _reach(model, along, middle, low, high) if depth is None else _units.number_in(depth, unit, "depth")
        if not (np.isfinite(reach) and reach > 0):
            raise InputError("depth must be positive and finite")
        camera = {
            "position": tuple(middle + 0.5 * reach * np.array(toward)),
            "focal_point": tuple(middle),
            "view_up": up,
            "fov_deg": None,
            "height": float(tall),
            "clipping_range": (0.0, reach),
        }
        x, y = float(middle[across]), float(middle[upward])
        extent = (x - 0.5 * wide, x + 0.5 * wide, y - 0.5 * tall, y + 0.5 * tall)
        return cls(camera, (columns, rows), extent, ("xyz"[across], "xyz"[upward]))


def _shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns."""
    columns, rows = _coerce.size_of(shape[::-1])
    if not (0 < rows <= 32768 and 0 < columns <= 32768):
        raise InputError("shape takes rows and columns, 1 to 32768 each")
    return rows, columns


def _repeats(model: Model, axis: int) -> bool:
    """Does an orthogonal box repeat along an axis?"""
    return model.box is not None and model.periodic[axis] and _coerce.is_right(model.box)


def _region(model: Model) -> tuple[Float64, Float64]:
    """The box along axes on which it repeats, the bounds along others."""
    (low, high), box, cell = model.bounds, model.box, model.metadata["cell"]
    for k in range(3):
        if box is not None and _repeats(model, k):
            low[k] = cell["origin"][k]
            high[k] = low[k] + box[k][k]
    return low, high


def _reach(model: Model, along: int, middle: Float64, low: Float64, high: Float64) -> float:
    """One box along the line of sight, or all there is."""
    thick = float(high[along] - low[along])
    away = float(abs(middle[along] - 0.5 * (low + high)[along]))
    # Particles in one plane have a density along it, too.
    return thick if _repeats(model, along) else 2.0 * (away + thick) or 1.0
