"""Cameras."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Optional

from ._particlegs import InputError


def point(value, what):
    """Three finite numbers."""
    try:
        numbers = tuple(float(v) for v in value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} must be three numbers") from error
    if len(numbers) != 3:
        raise InputError(f"{what} must be three numbers")
    return numbers


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from, as ParaView and views files have it; world units.

    Parameters
    ----------
    position : array_like, shape (3,)
        The eye.
    focal_point : array_like, shape (3,)
        The point looked at.
    view_up : array_like, shape (3,)
        Up; not parallel to the direction of view.
    fov_deg : float, optional
        Vertical field of view of a perspective picture, degrees; 30 where no height is given.
    height : float, optional
        Height of an orthographic picture in world units, instead of a field of view.
    clipping_range : tuple of float, optional
        Nearest and farthest distance of particles that are drawn; all by default.
    """

    position: tuple = field()
    focal_point: tuple = field()
    view_up: tuple = (0.0, 1.0, 0.0)
    fov_deg: Optional[float] = None
    height: Optional[float] = None
    clipping_range: Optional[tuple] = None

    def __post_init__(self):
        for name in ("position", "focal_point", "view_up"):
            object.__setattr__(self, name, point(getattr(self, name), name))
        if self.fov_deg is not None and self.height is not None:
            raise InputError("a camera has either a field of view or a height")
        if self.fov_deg is None and self.height is None:
            object.__setattr__(self, "fov_deg", 30.0)
        if self.clipping_range is not None:
            near, far = self.clipping_range
            object.__setattr__(self, "clipping_range", (float(near), float(far)))

    def _native(self):
        return {
            "position": self.position,
            "focal_point": self.focal_point,
            "view_up": self.view_up,
            "fov_deg": self.fov_deg,
            "height": self.height,
            "clipping_range": self.clipping_range,
        }


def native(camera, azimuth, elevation, distance, center, width, depth):
    """A camera, or the angles and the window that stand for one."""
    if camera is not None:
        if not isinstance(camera, Camera):
            raise TypeError("camera must be a particlegs.Camera")
        return camera._native()
    return {
        "azimuth": float(azimuth),
        "elevation": float(elevation),
        "distance": float(distance),
        "center": None if center is None else point(center, "center"),
        "width": None if width is None else float(width),
        "depth": None if depth is None else float(depth),
    }
