"""Types that several signatures share."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Callable, Literal, Optional, TypedDict, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: A place in the file system.
Path = Union[str, "os.PathLike[str]"]
#: True for a bar, or a function that is told (phase, steps done, steps); 0 steps where their number is not known.
Progress = Union[bool, Callable[[str, int, int], object], None]
#: Names, or one.
Names = Union[str, Sequence[str]]
#: An array of numbers of any kind.
Numbers = NDArray[Any]
#: Left, right, bottom, top.
Extent = tuple[float, float, float, float]
Three = tuple[float, float, float]

PictureStyle = Literal["paraview", "paraview-no-fxaa"]
Axis = Literal["x", "y", "z"]
Method = Literal["count", "volume", "ellipsoid", "grid", "stratified", "spaced"]
Effort = Literal["default", "fast"]
Law = Literal["optical-depth", "alpha-blend"]
Training = Literal["fast", "best", "paper"]
CertificateLevel = Literal["none", "quick", "full"]
Assignment = Literal["ngp", "cic", "tsc"]
Convention = Literal["correct", "paper"]


class Known(TypedDict, total=False):
    """What may be said of particles beside their positions."""

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
    """How a picture is drawn, beside its style."""

    size: tuple[int, int]
    radius: Optional[float]
    opacity: Optional[float]
    center: Optional[ArrayLike]
    width: Optional[float]
    depth: Optional[float]
    camera: Any
    threads: Optional[int]


class LayeredDrawing(Drawing, total=False):
    """The same of a model."""

    layers: Optional[Names]


Bytes8 = NDArray[np.uint8]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
