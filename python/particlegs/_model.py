"""Models: files of Gaussians, and what is made of them."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any, Literal, Optional, Union, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _coerce, _particlegs, _units
from ._arrays import Grid, Map
from ._camera import Camera
from ._camera import native as native_camera
from ._gaussians import Gaussians
from ._particlegs import InputError
from ._snapshot import Snapshot, as_snapshot
from ._types import (
    Axis,
    Bytes8,
    Extent,
    Float32,
    Float64,
    LayeredDrawing,
    Method,
    Names,
    Numbers,
    Path,
    PictureStyle,
    Progress,
)
from ._view import View, opening_of, summary
from ._window import Window

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Model:
    """A mixture of Gaussians that stands for a snapshot; `read` and `compress` make one. Never changed."""

    _native: _particlegs.Model
    _said: dict[str, Any]

    def __init__(self) -> None:
        raise TypeError("particlegs.read or particlegs.compress make a model")

    @classmethod
    def _of(cls, native: _particlegs.Model) -> Model:
        model = cls.__new__(cls)
        model._native = native
        model._said = json.loads(native.told)
        return model

    # What it is.

    @property
    def name(self) -> str:
        """The file's name, or that of the snapshot."""
        return self._native.name

    @property
    def nbytes(self) -> int:
        """Bytes of the file."""
        return self._native.nbytes

    @property
    def ratio(self) -> float:
        """Bytes of the particles as float32 over the file's."""
        return float(self._said["raw_bytes"] / self.nbytes)

    @property
    def count(self) -> int:
        """Particles that it stands for."""
        return int(self.metadata["count"])

    @property
    def mass(self) -> Optional[float]:
        """Mass of all particles in the unit of mass, or None where it is not known."""
        mass: Optional[float] = self._said["mass"]
        return mass

    @property
    def law(self) -> str:
        """How Gaussians become pictures: ``"optical-depth"`` or ``"alpha-blend"``."""
        return "alpha-blend" if self._native.is_alpha_blend else "optical-depth"

    @property
    def metadata(self) -> dict[str, Any]:
        """What the file says of the snapshot and of its making."""
        metadata: dict[str, Any] = self._said["metadata"]
        return metadata

    @property
    def bounds(self) -> Float64:
        """The lowest and the highest corner of the snapshot, (2, 3)."""
        return np.array([self.metadata["bounds"]["min"], self.metadata["bounds"]["max"]])

    @property
    def box(self) -> Optional[Float64]:
        """Cell vectors by rows, (3, 3), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["vectors"])

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Along which cell vectors the box repeats."""
        cell = self.metadata["cell"]
        a, b, c = (False, False, False) if cell is None else cell["periodic"]
        return bool(a), bool(b), bool(c)

    @property
    def length_unit(self) -> Optional[str]:
        """Unit of length, as text, or None."""
        unit: Optional[str] = self.metadata["length_unit"]
        return unit

    @property
    def mass_unit(self) -> Optional[str]:
        """Unit of mass, as text, or None."""
        unit: Optional[str] = self.metadata["mass_unit"]
        return unit

    @property
    def radius(self) -> float:
        """Default particle radius, world units."""
        return float(self.metadata["default_radius"])

    @property
    def opacity(self) -> float:
        """Default opacity of a particle."""
        return float(self.metadata["default_opacity"])

    @property
    def layers(self) -> list[dict[str, Any]]:
        """Layers: name, particles, Gaussians, mass of a particle."""
        return [dict(layer) for layer in self._said["layers"]]

    @property
    def gaussians(self) -> Gaussians:
        """The Gaussians as arrays."""
        return Gaussians(self._native.gaussians)

    @property
    def certificate(self) -> Union[dict[str, Any], Any]:
        """What was measured of the decoded file when it was made, as a dict; None where nothing was."""
        certificate: Optional[dict[str, Any]] = self._said["certificate"]
        return certificate

    @property
    def findings(self) -> list[dict[str, str]]:
        """What the certificate says: dicts of ``use``, ``word`` and ``why``.

        The word is ``holds``, ``roughly``, ``does not`` or ``not measured``.
        """
        return [dict(finding) for finding in self._said["verdict"]]

    @property
    def verdict(self) -> str:
        """What the model is good for, in words: a line a use."""
        lines = (f"{f['use'].replace('_', ' ')}: {f['word']} ({f['why']})" for f in self.findings)
        return "\n".join(lines)

    # Files.

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Writes the model file, whole or not at all.

        Raises
        ------
        FileExistsError
            Where something is, unless `overwrite`.
        """
        self._native.save(os.fspath(path), overwrite)

    def to_bytes(self) -> bytes:
        """The file's bytes."""
        return self._native.to_bytes()

    def __reduce__(self) -> Any:
        return _of_bytes, (self.to_bytes(), self.name)

    # Pictures.

    @overload
    def render(
        self,
        azimuth: float = ...,
        elevation: float = ...,
        distance: float = ...,
        *,
        style: PictureStyle = ...,
        **drawing: Unpack[LayeredDrawing],
    ) -> Bytes8: ...
    @overload
    def render(
        self,
        azimuth: float = ...,
        elevation: float = ...,
        distance: float = ...,
        *,
        style: Literal["expected"],
        **drawing: Unpack[LayeredDrawing],
    ) -> Float32: ...
    @overload
    def render(
        self,
        azimuth: float = ...,
        elevation: float = ...,
        distance: float = ...,
        *,
        style: Literal["density"],
        **drawing: Unpack[LayeredDrawing],
    ) -> Map: ...
    def render(
        self,
        azimuth: float = 0.0,
        elevation: float = 0.0,
        distance: float = 1.0,
        *,
        style: str = "paraview",
        size: tuple[int, int] = (1920, 1080),
        radius: Optional[float] = None,
        opacity: Optional[float] = None,
        center: Optional[ArrayLike] = None,
        width: Optional[float] = None,
        depth: Optional[float] = None,
        camera: Optional[Camera] = None,
        layers: Optional[Names] = None,
        threads: Optional[int] = None,
    ) -> Numbers:
        """A picture of the particles.

        Parameters
        ----------
        azimuth, elevation : float
            Degrees; 0, 0 stands on +z and looks along -z, azimuth turns towards +x.
        distance : float
            Multiple of the distance from which all is seen.
        style : {"paraview", "paraview-no-fxaa", "expected", "density"}
            As ParaView draws the particles; without antialiasing; `1 - exp(-tau)` of the optical depth; surface
            density.
        size : (int, int)
            Width and height in pixels.
        radius, opacity : float, optional
            Of a particle: standard deviation in world units, and peak; the model's by default.
        center : array_like, shape (3,), optional
            The point looked at; the middle of the bounds by default.
        width, depth : float, optional
            An orthographic picture of this width, and of particles within this depth about the centre, world units.
        camera : Camera, optional
            A whole camera, in place of angles and window.
        layers : sequence of str, optional
            Layers to draw; all by default.
        threads : int, optional
            Threads; the picture does not depend on them.

        Returns
        -------
        numpy.ndarray, shape (height, width)
            uint8, the same as the command's; float32 in [0, 1] of ``"expected"``; a `Map` of ``"density"``.
        """
        unit, names, pixels = self.length_unit, _coerce.names(layers), _coerce.size_of(size)
        looking = native_camera(camera, (azimuth, elevation, distance), center, width, depth, unit)
        if style == "density":
            if radius is not None or opacity is not None:
                what = "radius" if radius is not None else "opacity"
                raise InputError(f"{what} does nothing here: a surface density has no particle radius or opacity")
            return self._map(self._native.density(pixels, looking, names, threads), None, None, names)
        radius = None if radius is None else _units.number_in(radius, unit, "radius")
        return self._native.render(style, pixels, looking, radius, opacity, names, threads)

    def _map(
        self,
        values: Float64,
        extent: Optional[Extent],
        axes: Optional[tuple[str, str]],
        layers: Optional[list[str]],
    ) -> Map:
        unit = self._native.density_unit(2, layers)
        known = {"length_unit": self.length_unit, "hubble": self.metadata["hubble"]}
        return Map._of(values, extent=extent, unit=unit, axes=axes, **known)

    def density_map(
        self,
        center: Optional[ArrayLike] = None,
        width: Optional[float] = None,
        depth: Optional[float] = None,
        *,
        axis: Axis = "z",
        shape: tuple[int, int] = (1024, 1024),
        layers: Optional[Names] = None,
        threads: Optional[int] = None,
    ) -> Map:
        """Surface density: mass, or particles, an area along an axis, averaged over each pixel.

        Parameters
        ----------
        center : array_like, shape (3,), optional
            Middle of the map; that of the box, or of the bounds, by default.
        width : float, optional
            World units across; by default the whole box, or all there is, whatever its shape and the map's: all of the
            mass, once.
        depth : float, optional
            World units along the axis; everything, once, by default.
        axis : {"x", "y", "z"}
            The axis looked along. A map along z has x across and y up; along y, x and z; along x, y and z.
        shape : (int, int)
            Rows and columns. Pixels are square.
        layers : sequence of str, optional
            Layers that count; all by default.
        threads : int, optional
            Threads; the map does not depend on them.

        Returns
        -------
        Map
            float64, with `extent` and `unit`; a window onto a part of a periodic box is continued by its copies.
        """
        window = Window.of(self, center, width, depth, axis, shape)
        names = _coerce.names(layers)
        values = self._native.density(window.pixels, window.camera, names, threads)
        return self._map(values, window.extent, window.axes, names)

    # Numbers.

    def density_grid(self, cells: int = 128, *, layers: Optional[Names] = None, threads: Optional[int] = None) -> Grid:
        """Density averaged over the cells of a grid: the mixture integrated over each, no shot noise.

        Parameters
        ----------
        cells : int
            Cells along the longest edge of the box (or of the bounds where nothing repeats).
        layers : sequence of str, optional
            Layers that count; all by default.
        threads : int, optional
            Threads; the densities do not depend on them.

        Returns
        -------
        Grid
            float64, shape (nx, ny, nz), mass (or particles) a volume. Sum times the volume of a cell, and what lies
            beyond open edges (`Grid.outside`), is the mass to one in a million.
        """
        names = _coerce.names(layers)
        values, origin, spacing, outside = self._native.density_grid(cells, names, threads)
        return Grid._of(
            values,
            origin=tuple(origin),
            spacing=tuple(spacing),
            unit=self._native.density_unit(3, names),
            length_unit=self.length_unit,
            periodic=self.periodic,
            hubble=self.metadata["hubble"],
            outside=outside,
        )

    def at(self, points: ArrayLike, *, layers: Optional[Names] = None, threads: Optional[int] = None) -> Float64:
        """Density at points: the sum of the Gaussians there, with their images in a periodic box.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units, or in a unit that they carry.
        layers : sequence of str, optional
            Layers that count; all by default.
        threads : int, optional
            Threads; the densities do not depend on them.

        Returns
        -------
        numpy.ndarray, float64, shape (n,)
            Mass (or particles) a volume, in the unit of `density_grid`.
        """
        names = _coerce.names(layers)
        return self._native.at(_coerce.points(points, self.length_unit), names, threads)

    def recover(
        self,
        n: Optional[int] = None,
        method: Method = "count",
        *,
        scale: float = 1.0,
        seed: int = 42,
        layers: Optional[Names] = None,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> Snapshot:
        """Draws synthetic particles: as many as the model stands for, or `n`.

        Parameters
        ----------
        n : int, optional
            Number of particles.
        method : {"count", "volume", "ellipsoid", "grid", "stratified", "spaced"}
            How they are drawn; see docs/results/recovery.md.
        scale : float
            Factor on the widths of the Gaussians.
        seed : int
            The same seed gives the same particles: those that the command's `recover` writes.
        layers : sequence of str, optional
            Layers to draw particles of; all by default.
        threads : int, optional
            Threads; the particles do not depend on them.
        progress : bool or callable, optional
            True for a bar (tqdm's where it is there), or a function of (phase, done, total).

        Returns
        -------
        Snapshot
            Marked `synthetic`; its `notes` say what it is good for.
        """
        names = _coerce.names(layers)
        native = self._native.recover(n, method, scale, seed, names, threads, _coerce.progress(progress))
        return Snapshot._of(native)

    # What the command's verbs do.

    def simplify(
        self,
        *,
        ratio: Optional[float] = None,
        size: Union[int, str, None] = None,
        gaussians: Optional[int] = None,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> Model:
        """A smaller model of the same, without the particles: as the command's ``simplify``.

        Parameters
        ----------
        ratio, size, gaussians : float, int or str, int
            One of them, as for `compress`.
        """
        given = (ratio, _coerce.bytes_of(size), gaussians)
        return Model._of(_particlegs.simplify(self._native, *given, threads, _coerce.progress(progress)))

    def merge(self, *others: Model, threads: Optional[int] = None, progress: Progress = None) -> Model:
        """One model of this one and others, such as of parts of a box: their coded blocks are copied, exactly."""
        parts = [self._native, *(other._native for other in others)]
        return Model._of(_particlegs.merge(parts, threads, _coerce.progress(progress)))

    def eval(
        self,
        snapshot: Union[Snapshot, ArrayLike],
        *,
        frames: int = 8,
        size: tuple[int, int] = (1920, 1080),
        seed: int = 42,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> dict[str, Any]:
        """Scores of the model's pictures against those of all particles: as the command's ``eval``.

        Parameters
        ----------
        snapshot : Snapshot or array_like, shape (n, 3)
            The particles.
        frames : int
            Views an orbit, of three.
        size : (int, int)
            Width and height of the pictures in pixels.
        seed : int
            Of the views, their radii and opacities.

        Returns
        -------
        dict
            ``views``, ``by_orbit`` and ``mean``: PSNR, masked PSNR (dB) and SSIM, beside those of trivial pictures.
        """
        native = as_snapshot(snapshot)._native
        pixels = _coerce.size_of(size)
        told = _particlegs.evaluate(self._native, native, frames, pixels, seed, threads, _coerce.progress(progress))
        scores: dict[str, Any] = json.loads(told)
        return scores

    def verify(
        self,
        snapshot: Union[Snapshot, ArrayLike],
        *,
        full: bool = False,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> dict[str, Any]:
        """Measures the certificate again on the particles that the model was made of: as the command's ``verify``.

        Parameters
        ----------
        snapshot : Snapshot or array_like, shape (n, 3)
            The particles.
        full : bool
            Measure what a full certificate has, whatever the file's is.

        Returns
        -------
        dict
            ``measured``, a certificate; ``differing``, the file's figures that are not what was measured, a line each.

        Raises
        ------
        InputError
            For other particles than those that the model was made of.
        """
        native = as_snapshot(snapshot)._native
        told = _particlegs.verify(self._native, native, full, threads, _coerce.progress(progress))
        return {"measured": json.loads(told[0]), "differing": told[1]}

    def export(
        self,
        path: Path,
        *,
        kind: Optional[str] = None,
        layers: Optional[Names] = None,
        cells: Optional[int] = None,
        radius: Optional[float] = None,
        opacity: Optional[float] = None,
        color: str = "grey",
        overwrite: bool = False,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> int:
        """Writes the model for other programs: as the command's ``export``.

        Parameters
        ----------
        path : path
            Its ending says what is written: splats (``.ply``, ``.glb``), the density in cells (``.npy``, ``.vti``,
            ``.fits``), Gaussians (``.npz``, ``.csv``), or a page (``.html``).
        kind : str, optional
            The ending, where the name's says something else.
        layers : sequence of str, optional
            Layers to write; all by default.
        cells : int, optional
            Cells along the longest edge, 128 by default.
        radius, opacity : float, optional
            Of the particles that splats show; the model's by default.
        color : {"grey", "layer", "density"}
            Of splats.
        overwrite : bool
            Replace what is there.

        Returns
        -------
        int
            Bytes written.
        """
        asked = {
            "kind": kind,
            "layers": _coerce.names(layers),
            "cells": cells,
            "radius": radius,
            "opacity": opacity,
            "color": color,
            "overwrite": overwrite,
        }
        return _particlegs.export(self._native, os.fspath(path), asked, threads, _coerce.progress(progress))

    # What a notebook shows.

    def to_html(self, **opening: Any) -> str:
        """A page that shows the model in any browser, offline: the whole file is inside.

        Parameters
        ----------
        **opening
            How the page opens; those of `view`.
        """
        return self._native.to_html(opening_of(opening))

    def view(self, height: int = 600, **opening: Any) -> View:
        """The interactive viewer in a notebook; it works offline, and in a saved page.

        Parameters
        ----------
        height : int
            Pixels.
        style : {"density", "paraview", "expected"}
            What is drawn first: the surface density by default, of an alpha-blend model "paraview".
        colormap : str
            Colour map of densities.
        range : tuple of float
            Surface densities of the first and the last colour.
        background : {"black", "white"}
        layers : sequence of str
            Layers that are drawn first.
        color_by_layer : bool
            Tell layers apart by colour.
        radius, opacity : float
            Of particles, in styles other than "density".
        camera : Camera
            Where it is looked from.

        Returns
        -------
        View
            What the notebook shows; `View.save` writes the page.
        """
        return View(self.to_html(**opening), int(height))

    def __repr__(self) -> str:
        return (
            f"<Model {self.name!r}: {self.count} particles in {self._said['gaussians']} Gaussians, "
            f"{self.nbytes} bytes, ratio {self.ratio:.0f}, {self.law}>"
        )

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        png, colors = self._native.poster((480, 270))
        picture = "of the style paraview"
        if colors is not None:
            picture = f"surface density, {colors[0]:.2g} to {colors[1]:.2g} {self._native.density_unit(2, None)}"
        return {"text/plain": repr(self), "text/html": summary(self, png, picture)}


def read(
    source: Union[Path, bytes, bytearray, memoryview], *, name: Optional[str] = None, threads: Optional[int] = None
) -> Model:
    """Opens a model file.

    Parameters
    ----------
    source : path or bytes
        The file, or its bytes.
    name : str, optional
        What to call a model of bytes.
    threads : int, optional
        Threads; all that the process may use by default.

    Returns
    -------
    Model

    Raises
    ------
    FileNotFoundError
        For a file that is not there.
    ModelError
        For a file that is corrupt, or of a newer version.
    """
    if isinstance(source, (bytes, bytearray, memoryview)):
        return Model._of(_particlegs.Model(bytes(source), name or "model", threads))
    return Model._of(_particlegs.Model.read(os.fspath(source), threads))


def _of_bytes(data: bytes, name: str) -> Model:
    return read(data, name=name)
