"""The native module of the package; import `particlegs` instead."""

import builtins
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Callable, Optional, Union, final

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypeAlias, disjoint_base

__version__: str

_Path: TypeAlias = Union[str, PathLike[str]]
_Progress: TypeAlias = Optional[Callable[[str, int, int], object]]
_Camera: TypeAlias = Union[str, Mapping[str, Any]]
_Asked: TypeAlias = Mapping[str, Any]

class InputError(ValueError):
    """A snapshot, model or argument that cannot be used as it is."""

class ModelError(InputError):
    """A model file that is corrupt or of an unknown version."""

class UnreachableError(ValueError):
    """A size or quality that cannot be reached with this snapshot."""

@disjoint_base
class Snapshot:
    def __new__(
        cls,
        positions: Union[NDArray[Any], tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]],
        weights: Optional[NDArray[np.float32]],
        known: _Asked,
        skip_invalid: bool = False,
        threads: Optional[int] = None,
    ) -> Snapshot: ...
    def __len__(self) -> int: ...
    @property
    def fields(self) -> list[tuple[str, Optional[str], NDArray[np.float32]]]: ...
    @property
    def local_positions(self) -> NDArray[np.float32]: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def weights(self) -> Optional[NDArray[np.float32]]: ...
    def bounds(self, threads: Optional[int] = None) -> list[list[float]]: ...
    @property
    def layers(self) -> list[tuple[str, int, int, Optional[float], bool]]: ...
    @property
    def metadata(self) -> str: ...
    @property
    def drawn(self) -> Optional[str]: ...
    def of_species(self, name: str) -> Snapshot: ...
    def region(self, low: list[float], high: list[float], threads: Optional[int] = None) -> Snapshot: ...
    def save(
        self, path: _Path, overwrite: bool = False, threads: Optional[int] = None, progress: _Progress = None
    ) -> int: ...
    def render(
        self,
        style: str,
        size: tuple[int, int],
        camera: _Camera,
        radius: Optional[float] = None,
        opacity: Optional[float] = None,
        threads: Optional[int] = None,
    ) -> NDArray[Any]: ...

@final
class Series:
    @staticmethod
    def read(path: _Path, threads: Optional[int] = None) -> Series: ...
    @staticmethod
    def begins(head: builtins.bytes) -> bool: ...
    @property
    def name(self) -> str: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def clock(self) -> str: ...
    @property
    def times(self) -> list[Optional[float]]: ...
    def frame(self, frame: int, threads: Optional[int] = None) -> Model: ...
    def verify(self, threads: Optional[int] = None, progress: _Progress = None) -> tuple[str, Optional[str]]: ...
    def statistics(
        self,
        asked: str,
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
        progress: _Progress = None,
    ) -> str: ...
    def moment(self, text: str) -> float: ...
    def at(self, time: float, threads: Optional[int] = None) -> Model: ...

@final
class Gaussians:
    def __len__(self) -> int: ...
    @property
    def means(self) -> NDArray[np.float64]: ...
    @property
    def covariances(self) -> NDArray[np.float64]: ...
    @property
    def counts(self) -> NDArray[np.float64]: ...
    @property
    def masses(self) -> Optional[NDArray[np.float64]]: ...
    @property
    def opacities(self) -> Optional[NDArray[np.float64]]: ...
    @property
    def grey_levels(self) -> Optional[NDArray[np.float64]]: ...
    @property
    def fields(self) -> list[tuple[str, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]: ...
    @property
    def layer_ranges(self) -> list[tuple[str, int, int]]: ...

@disjoint_base
class Model:
    def __new__(cls, bytes: builtins.bytes, name: str, threads: Optional[int] = None) -> Model: ...
    @staticmethod
    def read(path: _Path, threads: Optional[int] = None) -> Model: ...
    @property
    def name(self) -> str: ...
    @property
    def nbytes(self) -> int: ...
    def to_bytes(self) -> builtins.bytes: ...
    def whole(
        self, toward: Sequence[float], up: Sequence[float], size: tuple[int, int]
    ) -> tuple[list[float], float]: ...
    def save(self, path: _Path, overwrite: bool = False) -> None: ...
    @property
    def description(self) -> str: ...
    @property
    def gaussians(self) -> Gaussians: ...
    def render(
        self,
        style: str,
        size: tuple[int, int],
        camera: _Camera,
        radius: Optional[float] = None,
        opacity: Optional[float] = None,
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
    ) -> NDArray[Any]: ...
    def density(
        self,
        size: tuple[int, int],
        camera: _Camera,
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
    ) -> NDArray[np.float64]: ...
    @property
    def fields(self) -> list[tuple[str, str, Optional[str], str]]: ...
    def field_map(
        self,
        field: str,
        size: tuple[int, int],
        camera: _Camera,
        bulk: Optional[list[float]] = None,
        subtract_mean: bool = False,
        weight: str = "mass",
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
    ) -> tuple[NDArray[np.float64], Optional[str], str, str]: ...
    def density_unit(self, power: int, layers: Optional[Sequence[str]] = None) -> str: ...
    def field_unit(self, field: str, dispersion: bool) -> Optional[str]: ...
    def grid(
        self,
        cells: Union[int, Sequence[int]],
        field: Optional[tuple[str, bool]] = None,
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
    ) -> tuple[NDArray[np.float64], list[float], list[float], float]: ...
    def at(
        self,
        points: NDArray[np.float64],
        field: Optional[tuple[str, bool]] = None,
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
    ) -> NDArray[np.float64]: ...
    def recover(
        self,
        n: Optional[int],
        method: str,
        scale: float,
        seed: int,
        layers: Optional[Sequence[str]] = None,
        threads: Optional[int] = None,
        progress: _Progress = None,
    ) -> Snapshot: ...
    def to_html(self, opening: str) -> str: ...
    def poster(self, size: tuple[int, int]) -> tuple[builtins.bytes, Optional[tuple[float, float]]]: ...
    @property
    def is_alpha_blend(self) -> bool: ...

def open(
    paths: Sequence[str],
    asked: _Asked,
    scratch: Optional[_Path] = None,
    memory: bool = False,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> Snapshot: ...
def unit_parts(text: str, dimension: str) -> Optional[tuple[float, str, float, float, float]]: ...
def formats() -> list[str]: ...
def camera_around(
    bounds: tuple[Sequence[float], Sequence[float]], azimuth: float, elevation: float, distance: float
) -> str: ...
def density_range(values: NDArray[np.float64]) -> tuple[Optional[list[float]], float]: ...
def compress(
    snapshot: Snapshot,
    asked: _Asked,
    target: _Asked,
    fields: Sequence[tuple[str, Optional[str], NDArray[np.float64]]] = ...,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> Model: ...
def make_series(
    snapshots: Sequence[str],
    output: _Path,
    read: _Asked,
    compress: _Asked,
    frames: _Asked,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> str: ...
def film(
    series: Series, path: _Path, asked: _Asked, threads: Optional[int] = None, progress: _Progress = None
) -> str: ...
def stats(
    truth: Union[Snapshot, Model],
    other: Union[Snapshot, Model],
    asked: str,
    fields: Sequence[Sequence[tuple[str, Optional[str], Any]]] = ...,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> str: ...
def haloes(
    source: Union[Snapshot, Model],
    asked: str,
    fields: Sequence[tuple[str, Optional[str], Any]] = ...,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> tuple[list[tuple[str, str, str, bool, NDArray[np.float64]]], list[str], list[str]]: ...
def simplify(
    model: Model,
    ratio: Optional[float] = None,
    size: Optional[int] = None,
    gaussians: Optional[int] = None,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> Model: ...
def merge(
    models: Sequence[Model],
    fields: Optional[Sequence[str]] = None,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> Model: ...
def evaluate(
    model: Model,
    snapshot: Snapshot,
    frames: int,
    size: tuple[int, int],
    seed: int,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> str: ...
def verify(
    model: Model,
    snapshot: Optional[Snapshot] = None,
    full: bool = False,
    fields: Sequence[tuple[str, Optional[str], Any]] = ...,
    threads: Optional[int] = None,
    progress: _Progress = None,
) -> tuple[str, Optional[str]]: ...
def export(
    model: Model, path: _Path, asked: _Asked, threads: Optional[int] = None, progress: _Progress = None
) -> int: ...
