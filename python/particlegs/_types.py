"""Types shared by several signatures."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Callable, Literal, Optional, TypedDict, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

Path = Union[str, "os.PathLike[str]"]
#: True for a progress bar, or a function of (phase, steps done, steps); steps is 0 if unknown.
Progress = Union[bool, Callable[[str, int, int], object], None]
#: One or more names.
Names = Union[str, Sequence[str]]
#: Cells of a grid: along the longest edge, or along x, y and z.
Cells = Union[int, tuple[int, int, int]]
#: An array of numbers of any type.
Numbers = NDArray[Any]
#: Left, right, bottom, top.
Extent = tuple[float, float, float, float]
Three = tuple[float, float, float]

PictureStyle = Literal["paraview", "paraview-no-fxaa"]
Axis = Literal["x", "y", "z"]
Method = Literal["count", "volume", "ellipsoid", "grid", "stratified", "spaced"]
Effort = Literal["default", "fast", "best"]
Law = Literal["optical-depth", "alpha-blend"]
Training = Literal["fast", "best", "paper"]
CertificateLevel = Literal["none", "quick", "full"]
Assignment = Literal["ngp", "cic", "tsc"]
Convention = Literal["correct", "paper"]
Sharing = Literal["auto", "yes", "no"]


class Known(TypedDict, total=False):
    """Keywords of `Snapshot` besides positions."""

    masses: Any
    box: Any
    pbc: Union[bool, Sequence[bool]]
    origin: Optional[ArrayLike]
    units: Optional[str]
    mass_units: Optional[str]
    name: str
    comoving: Optional[bool]
    scale_factor: Optional[float]
    hubble: Optional[float]
    time: Optional[float]
    layers: Optional[Mapping[str, int]]
    skip_invalid: bool
    threads: Optional[int]


class Drawing(TypedDict, total=False):
    """Keywords of `Snapshot.render` besides style."""

    size: tuple[int, int]
    radius: Optional[float]
    opacity: Optional[float]
    center: Optional[ArrayLike]
    width: Optional[float]
    depth: Optional[float]
    camera: Any
    threads: Optional[int]


class LayeredDrawing(Drawing, total=False):
    """Keywords of `Model.render` besides style."""

    layers: Optional[Names]


Bytes8 = NDArray[np.uint8]
Float32 = NDArray[np.float32]
Floats = Union[NDArray[np.float32], NDArray[np.float64]]
Float64 = NDArray[np.float64]
