"""Cameras."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np

from . import _coerce, _particlegs, _units
from ._particlegs import InputError
from ._types import Three


def point(value: Any, what: str, unit: Optional[str] = None) -> Three:
    """Three numbers, in a unit of length."""
    if np.ndim(value) != 1:
        raise InputError(f"{what} must be three numbers")
    x, y, z = _coerce.lengths(value, unit, what)
    return x, y, z


@dataclass(frozen=True)
class Camera:
    """A camera as in ParaView and views files, in world units.

    Parameters
    ----------
    position : array_like, shape (3,)
        The position of the camera.
    focal_point : array_like, shape (3,)
        The point looked at.
    view_up : array_like, shape (3,)
        Up; not parallel to the direction of view.
    fov_deg : float, optional
        Vertical field of view of a perspective picture, degrees; 30 if no height is given.
    height : float, optional
        Height of an orthographic picture in world units, instead of a field of view.
    clipping_range : tuple of float, optional
        Smallest and largest distance of particles to draw; all by default.
    """

    position: Three
    focal_point: Three
    view_up: Three = (0.0, 1.0, 0.0)
    fov_deg: Optional[float] = None
    height: Optional[float] = None
    clipping_range: Optional[tuple[float, float]] = None

    def __post_init__(self) -> None:
        for name in ("position", "focal_point", "view_up"):
            object.__setattr__(self, name, point(getattr(self, name), name))
        if self.fov_deg is not None and self.height is not None:
            raise InputError("a camera has either a field of view or a height")
        if self.fov_deg is None and self.height is None:
            object.__setattr__(self, "fov_deg", 30.0)
        if self.clipping_range is not None:
            range_ = np.asarray(self.clipping_range, dtype=np.float64)
            if range_.shape != (2,):
                raise InputError("clipping_range must be the smallest and the largest distance")
            object.__setattr__(self, "clipping_range", (float(range_[0]), float(range_[1])))
        for name in ("fov_deg", "height"):
            if (value := getattr(self, name)) is not None:
                if not np.isfinite(value):
                    raise InputError(f"{name} must be finite")
                object.__setattr__(self, name, float(value))

    @classmethod
    def around(cls, bounds: Any, azimuth: float = 0.0, elevation: float = 0.0, distance: float = 1.0) -> Camera:
        """A perspective camera at these angles about bounds.

        Parameters
        ----------
        bounds : array_like, shape (2, 3)
            Lowest and highest corner, world units.
        azimuth, elevation : float
            Degrees, as in `Model.render`.
        distance : float
            In base distances of a picture that is not taller than wide.
        """
        low, high = (point(corner, "bounds") for corner in bounds)
        around = _particlegs.camera_around((low, high), float(azimuth), float(elevation), float(distance))
        return cls(**json.loads(around))

    def _record(self) -> dict[str, Any]:
        """The camera as a dict with the keys of views files."""
        at = {"position": self.position, "focal_point": self.focal_point, "view_up": self.view_up}
        lens = {"fov_deg": self.fov_deg, "height_world": self.height, "clipping_range": self.clipping_range}
        return {**at, **{name: value for name, value in lens.items() if value is not None}}


def native(
    camera: Optional[Camera],
    angles: tuple[float, float, float],
    center: Any,
    width: Any,
    depth: Any,
    unit: Optional[str],
) -> Union[str, dict[str, Any]]:
    """A camera as JSON, or the angles, distance and window that define one."""
    azimuth, elevation, distance = (float(v) for v in angles)
    if camera is not None:
        idle = [n for n, v in (("center", center), ("width", width), ("depth", depth)) if v is not None]
        turned = zip(("azimuth", "elevation", "distance"), (azimuth, elevation, distance), (0.0, 0.0, 1.0))
        idle += [name for name, value, usual in turned if value != usual]
        if idle:
            raise InputError(f"{idle[0]} does nothing if camera is given: leave it out")
        if not isinstance(camera, Camera):
            raise TypeError("camera must be a particlegs.Camera")
        return json.dumps(camera._record())
    if width is None and depth is not None:
        raise InputError("depth does nothing in perspective: also give width for an orthographic picture")
    if width is not None and distance != 1.0:
        raise InputError("distance does nothing if width is given, because the picture is orthographic")
    return {
        "azimuth": azimuth,
        "elevation": elevation,
        "distance": distance,
        "center": None if center is None else point(center, "center", unit),
        "width": None if width is None else _units.number_in(width, unit, "width"),
        "depth": None if depth is None else _units.number_in(depth, unit, "depth"),
    }
