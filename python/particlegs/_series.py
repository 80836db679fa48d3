"""Series: the snapshots of a run as models in one file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from typing import Any, Optional, Union

import numpy as np

from . import _coerce, _particlegs
from ._model import Model
from ._types import Assignment, Float64, Names, Path, Progress


class Series:
    """The snapshots of a run as models in one file, made by the command ``particlegs series``. Immutable.

    ``len(run)`` is the number of its frames, ``run[12]`` is a frame's `Model`, ``run[-1]`` that of the last, and
    ``run.at("z=1")`` the model of a moment, interpolated between frames. A loop gives the frames that are there.

    Parameters
    ----------
    path : path
        The file.
    threads : int, optional
        Number of threads for reading and for decoding frames; all that the process may use by default.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ModelError
        If the file is corrupt or of a newer version.
    """

    def __init__(self, path: Path, *, threads: Optional[int] = None) -> None:
        self._native = _particlegs.Series.read(os.fspath(path), threads)
        self._threads = threads

    @property
    def name(self) -> str:
        """The name of the file."""
        return self._native.name

    @property
    def nbytes(self) -> int:
        """Size of the file in bytes."""
        return self._native.nbytes

    @property
    def clock(self) -> str:
        """What `times` are: ``"scale factor"``, ``"time"``, ``"time step"`` or ``"frame"``."""
        return self._native.clock

    @property
    def times(self) -> Float64:
        """What the clock shows for each frame; NaN for a frame that is missing."""
        return np.array([np.nan if t is None else t for t in self._native.times])

    @property
    def redshifts(self) -> Optional[Float64]:
        """Redshift of each frame, NaN for a frame that is missing; None if the clock is not the scale factor."""
        return 1.0 / self.times - 1.0 if self.clock == "scale factor" else None

    def __len__(self) -> int:
        return len(self._native.times)

    def __getitem__(self, frame: int) -> Model:
        count = len(self)
        number = frame + count if frame < 0 else frame
        if not 0 <= number < count:
            raise IndexError(f"there is no frame {frame}; the series has {count} frames, from 0")
        return Model._of(self._native.frame(number, self._threads))

    def __iter__(self) -> Iterator[Model]:
        there = [i for i, time in enumerate(self._native.times) if time is not None]
        return (self[i] for i in there)

    def at(self, when: Union[str, float]) -> Model:
        """The model of a moment; between frames it is interpolated.

        Parameters
        ----------
        when : str or float
            ``"a=0.5"``, ``"z=1"``, ``"step=1000"``, a time such as ``"500ps"`` or ``"5Gyr"``, or a number
            as `times` has them.

        Raises
        ------
        InputError
            If the text names no moment, one of another clock, or the moment is outside the series.
        """
        time = self._native.moment(when) if isinstance(when, str) else float(when)
        return Model._of(self._native.at(time, self._threads))

    def verify(self, *, threads: Optional[int] = None, progress: Progress = None) -> dict[str, Any]:
        """Decodes every frame, and compares the index and the recipe with the frames, as the command's ``verify``.

        A frame is compared with its snapshot by ``run[12].verify(snapshot)``.

        Returns
        -------
        dict
            ``frames``, ``keyframes``; ``contradictions``, a line each; ``wrong``, what the command says of the first,
            or None.

        Raises
        ------
        ModelError
            If a frame cannot be decoded, or the index or the recipe contradicts it.
        """
        found, wrong = self._native.verify(threads, _coerce.progress(progress))
        return {**json.loads(found), "wrong": wrong}

    def film(
        self,
        path: Path,
        *,
        frames: Union[int, str] = "all",
        follow: Optional[str] = None,
        center: Union[str, Sequence[float], None] = None,
        style: Optional[str] = None,
        field: Optional[str] = None,
        layers: Optional[Names] = None,
        azimuth: float = 0.0,
        elevation: float = 0.0,
        distance: float = 1.0,
        orthographic: bool = False,
        width: Optional[float] = None,
        depth: Optional[float] = None,
        size: tuple[int, int] = (1280, 720),
        radius: Optional[float] = None,
        opacity: Optional[float] = None,
        colormap: Optional[str] = None,
        range: Optional[tuple[float, float]] = None,  # noqa: A002
        fps: int = 30,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> dict[str, Any]:
        """Draws a film of the series, as the command's ``render --frames``.

        Parameters
        ----------
        path : path
            The film: ``.gif``, or ``.mp4`` and ``.webm``, which need ffmpeg.
        frames : int or "all"
            Number of pictures, evenly over the time of the series; as many as it has frames by default.
        follow : str, optional
            A halo that the camera follows: ``"haloes.csv:12"``, a list and the halo's id, or its row without ids.
        center : str or numbers, optional
            What is in the middle: a place, a region of six numbers, or layers such as ``"stars"``, whose centre of mass
            the camera follows.
        style : str, optional
            ``"paraview"`` by default, ``"paraview-no-fxaa"``, ``"expected"`` or ``"density"``.
        field : str, optional
            A field to show instead, such as ``"velocity.los"``.
        layers : sequence of str, optional
            Layers to draw; all by default.
        azimuth, elevation, distance : float
            Camera, as for `Model.render`.
        orthographic : bool
            Parallel lines of sight.
        width, depth : float, optional
            Width of the picture and depth of the slab around the centre, world units.
        size : (int, int)
            Width and height in pixels.
        radius, opacity : float, optional
            Particle radius and opacity; the model's by default.
        colormap, range : optional
            Colours of densities and fields.
        fps : int
            Frames per second.
        threads, progress : optional
            As for `compress`.

        Returns
        -------
        dict
            The command's record: ``views``, ``range``, ``width``, ``height``.
        """
        words = center if center is None or isinstance(center, str) else ",".join(map(str, center))
        asked = {
            "frames": str(frames),
            "follow": follow,
            "center": words,
            "style": style,
            "field": field,
            "layers": _coerce.names(layers) or [],
            "azimuth": azimuth,
            "elevation": elevation,
            "distance": distance,
            "orthographic": orthographic,
            "width": width,
            "depth": depth,
            "size": _coerce.size_of(size),
            "radius": radius,
            "opacity": opacity,
            "colormap": colormap,
            "range": range,
            "fps": fps,
        }
        made = _particlegs.film(self._native, os.fspath(path), asked, threads, _coerce.progress(progress))
        record: dict[str, Any] = json.loads(made)
        return record

    def statistics(
        self,
        *,
        only: Names = (),
        layers: Optional[Names] = None,
        spectrum_grid: int = 256,
        spectrum_assignment: Assignment = "tsc",
        interlacing: bool = True,
        k_max: Optional[float] = None,
        linking: float = 0.2,
        linking_length: Union[float, str, None] = None,
        open: bool = False,  # noqa: A002
        seed: int = 42,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> dict[str, Any]:
        """Statistics over time: power spectra, friends-of-friends groups and means of fields of every frame.

        All frames are measured by the lengths of the first. Remarks on the results are warnings.

        Parameters
        ----------
        only : sequence of str
            Measures: spectrum, groups; both by default. Means of fields are always measured.
        layers : sequence of str, optional
            Layers to measure; all by default.
        spectrum_grid : int
            Cells of P(k) along the longest edge.
        spectrum_assignment : {"ngp", "cic", "tsc"}
            Mass assignment of P(k).
        interlacing : bool
            Measure P(k) on two grids half a cell apart, to reduce aliasing.
        k_max : float, optional
            Largest wave number, 1 over the unit of length; by default the Nyquist frequency of the first
            frame's particles.
        linking : float
            Linking length of groups in mean spacings of the first frame.
        linking_length : float or str, optional
            The linking length in the series' unit, or with a unit as in ``"0.02Mpc"``; overrides `linking`.
        open : bool
            Treat no axis as periodic.
        seed, threads, progress
            As for `compress`. Groups are those of particles drawn by the seed.

        Returns
        -------
        dict
            The contents of the command's stats.json: ``clock``, ``length_unit``, ``linking_length`` and ``frames``, one
            for each frame with ``time``, ``redshift``, ``particles``, ``spectrum`` (``k`` in 1 over the unit of length,
            ``power`` in that unit cubed), ``groups`` (numbers ``from`` so many particles on) and ``fields`` (each
            ``component`` with its ``value`` and ``unit``); of a missing frame ``frame`` and ``kind``.

        Raises
        ------
        InputError
            If an option is out of range, another measure is named, or the frames have other units than the first.
        """
        asked = {
            "only": _coerce.texts(only),
            "spectrum_grid": spectrum_grid,
            "spectrum_assignment": spectrum_assignment,
            "interlacing": interlacing,
            "k_max": k_max,
            "linking": linking,
            "linking_length": None if linking_length is None else str(linking_length),
            "open": open,
            "seed": seed,
        }
        record, shown = _coerce.record(asked), _coerce.progress(progress)
        found = self._native.statistics(record, _coerce.names(layers), threads, shown)
        return dict(json.loads(found))

    def __repr__(self) -> str:
        there = self.times[np.isfinite(self.times)]
        span = f", {self.clock} {there[0]:g} to {there[-1]:g}" if there.size else ""
        return f"<Series {self.name}: {len(self)} frames{span}, {self.nbytes} bytes>"


def is_series(path: Path) -> bool:
    """Whether a path is a file that begins like a series."""
    where = os.fspath(path)
    if not os.path.isfile(where):
        return False
    with open(where, "rb") as file:
        return _particlegs.Series.begins(file.read(64))
