"""Models: files of Gaussians, and their pictures and densities."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal, Optional, Union, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _coerce, _particlegs, _units
from ._arrays import Grid, Map
from ._camera import Camera
from ._camera import native as native_camera
from ._gaussians import Gaussians
from ._measured import Field
from ._particlegs import InputError
from ._snapshot import Snapshot, as_snapshot
from ._types import (
    Axis,
    Bytes8,
    Cells,
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
    """A mixture of Gaussians that represents a snapshot, made by `read` or `compress`. Immutable."""

    _native: _particlegs.Model
    _description: dict[str, Any]

    def __init__(self) -> None:
        raise TypeError("use particlegs.read or particlegs.compress to make a model")

    @classmethod
    def _of(cls, native: _particlegs.Model) -> Model:
        model = cls.__new__(cls)
        model._native = native
        model._description = json.loads(native.description)
        return model

    # Properties.

    @property
    def name(self) -> str:
        """The name of the file or of the snapshot."""
        return self._native.name

    @property
    def nbytes(self) -> int:
        """Size of the file in bytes."""
        return self._native.nbytes

    @property
    def ratio(self) -> float:
        """Bytes of positions (as float32), masses and fields that the snapshot held, over bytes of the file."""
        return float(self._description["raw_bytes"] / self.nbytes)

    @property
    def count(self) -> int:
        """Number of particles in the snapshot."""
        return int(self.metadata["count"])

    @property
    def mass(self) -> Optional[float]:
        """Mass of all particles in the unit of mass, or None if unknown."""
        mass: Optional[float] = self._description["mass"]
        return mass

    @property
    def law(self) -> str:
        """How Gaussians become pictures: ``"optical-depth"`` or ``"alpha-blend"``."""
        return "alpha-blend" if self._native.is_alpha_blend else "optical-depth"

    @property
    def metadata(self) -> dict[str, Any]:
        """The file's metadata about the snapshot and the compression."""
        metadata: dict[str, Any] = self._description["metadata"]
        return metadata

    @property
    def bounds(self) -> Float64:
        """The lowest and the highest corner of the snapshot, (2, 3)."""
        return np.array([self.metadata["bounds"]["min"], self.metadata["bounds"]["max"]])

    @property
    def box(self) -> Optional[Float64]:
        """Cell vectors as rows, (3, 3), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["vectors"])

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Along which cell vectors the box is periodic."""
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
        return [dict(layer) for layer in self._description["layers"]]

    @property
    def gaussians(self) -> Gaussians:
        """The Gaussians as arrays."""
        return Gaussians(self._native.gaussians)

    @property
    def certificate(self) -> Union[dict[str, Any], Any]:
        """The measurements made on the decoded file at compression, as a dict; None without a certificate."""
        certificate: Optional[dict[str, Any]] = self._description["certificate"]
        return certificate

    @property
    def findings(self) -> list[dict[str, str]]:
        """The verdict of the certificate by use: dicts of ``use``, ``word`` and ``why``.

        `word` is ``good``, ``fair``, ``poor`` or ``not measured``.
        """
        return [dict(finding) for finding in self._description["verdict"]]

    @property
    def verdict(self) -> str:
        """What the model is good for, in words, with a line per use."""
        lines = (f"{f['use'].replace('_', ' ')}: {f['word']} ({f['why']})" for f in self.findings)
        return "\n".join(lines)

    # Files.

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Writes the model file, completely or not at all.

        Raises
        ------
        FileExistsError
            If the path exists, unless `overwrite`.
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
        """Renders a picture of the particles.

        Parameters
        ----------
        azimuth, elevation : float
            Degrees; at 0, 0 the camera is on +z and looks along -z; a positive azimuth turns it towards +x.
        distance : float
            In multiples of the distance that shows the whole box.
        style : {"paraview", "paraview-no-fxaa", "expected", "density"}
            ParaView's picture; the same without antialiasing; `1 - exp(-tau)` for the optical depth tau; surface
            density.
        size : (int, int)
            Width and height in pixels.
        radius, opacity : float, optional
            Standard deviation of a particle in world units, and its peak opacity; the model's by default.
        center : array_like, shape (3,), optional
            The point looked at; by default the middle of the bounds, or of the box in orthographic pictures.
        width, depth : float, optional
            Draw an orthographic picture of this width, of the particles within this depth about the centre.
        camera : Camera, optional
            A camera, instead of angles and window.
        layers : sequence of str, optional
            Layers to draw; all by default.
        threads : int, optional
            Number of threads; the picture does not depend on it.

        Returns
        -------
        numpy.ndarray, shape (height, width)
            uint8, the same as the command's; float32 in [0, 1] for ``"expected"``; a `Map` for ``"density"``.
        """
        unit, names, pixels = self.length_unit, _coerce.names(layers), _coerce.size_of(size)
        looking = native_camera(camera, (azimuth, elevation, distance), center, width, depth, unit)
        if style == "density":
            if radius is not None or opacity is not None:
                what = "radius" if radius is not None else "opacity"
                raise InputError(f'{what} does nothing with style="density": leave it out')
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
        return Map._of(values, extent=extent, unit=unit, axes=axes, title=None, scale=None, **known)

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
        """Surface density along an axis (mass or number of particles per area), averaged over each pixel.

        Parameters
        ----------
        center : array_like, shape (3,), optional
            Centre of the map; by default the centre of the box or of the bounds.
        width : float, optional
            Width in world units; by default the map shows the whole box, or all particles, once.
        depth : float, optional
            Depth along the axis in world units; everything by default.
        axis : {"x", "y", "z"}
            Direction of view. The horizontal and vertical axes are x, y for z; x, z for y; and y, z for x.
        shape : (int, int)
            Rows and columns. Pixels are square.
        layers : sequence of str, optional
            Layers to include; all by default.
        threads : int, optional
            Number of threads; the map does not depend on it.

        Returns
        -------
        Map
            float64, with `extent` and `unit`. Windows on a part of a periodic box include its periodic images.
        """
        window = Window.of(self._native, (self.bounds, self.box, self.length_unit), center, width, depth, axis, shape)
        names = _coerce.names(layers)
        values = self._native.density(window.pixels, window.camera, names, threads)
        return self._map(values, window.extent, window.axes, names)

    # Numbers.

    @property
    def fields(self) -> dict[str, Field]:
        """What particles carried beside positions and masses, by name."""
        return {name: Field(kind, unit, weighting) for name, kind, unit, weighting in self._native.fields}

    def map(
        self,
        field: str,
        center: Optional[ArrayLike] = None,
        width: Optional[float] = None,
        depth: Optional[float] = None,
        *,
        axis: Axis = "z",
        shape: tuple[int, int] = (1024, 1024),
        bulk: Union[ArrayLike, Literal["mean"], None] = None,
        weight: str = "mass",
        layers: Optional[Names] = None,
        threads: Optional[int] = None,
    ) -> Map:
        """Mean of a field along an axis, weighted by mass (or number of particles), or by another field.

        Parameters
        ----------
        field : str
            A scalar such as ``"temperature"``; a component of a vector such as ``"velocity.x"``, or ``"velocity.los"``,
            positive away from the observer; or a dispersion: ``"dispersion.los"``, ``"dispersion.temperature"``,
            in dex for positive scalars that span a factor of 100.
        center, width, depth, axis, shape
            The window, as for `density_map`.
        bulk : array_like, shape (3,), or "mean", optional
            Subtracted from a vector: numbers in its unit, or the mean of all particles.
        weight : str
            ``"mass"``, ``"count"`` (all particles alike), or a positive scalar field, such as ``"Density"``: its value
            times mass.
        layers : sequence of str, optional
            Layers to include; all by default. Layers without the field add nothing.
        threads : int, optional
            Number of threads; the map does not depend on it.

        Returns
        -------
        Map
            float64, with `extent` and `unit`; NaN where there is no mass.
        """
        window = Window.of(self._native, (self.bounds, self.box, self.length_unit), center, width, depth, axis, shape)
        mean = isinstance(bulk, str)
        if mean and bulk != "mean":
            raise InputError(f'bulk is "mean" or three numbers, not {bulk!r}')
        vector = None if bulk is None or mean else [float(v) for v in np.asarray(bulk, dtype=float).reshape(3)]
        values, unit, title, scale = self._native.field_map(
            field, window.pixels, window.camera, vector, mean, weight, _coerce.names(layers), threads
        )
        known = {"length_unit": self.length_unit, "hubble": self.metadata["hubble"]}
        return Map._of(
            values, extent=window.extent, unit=unit or "", axes=window.axes, title=title, scale=scale, **known
        )

    def density_grid(
        self, cells: Cells = 128, *, layers: Optional[Names] = None, threads: Optional[int] = None
    ) -> Grid:
        """Density averaged over the cells of a grid: the integral of the mixture over each cell, without shot noise.

        Parameters
        ----------
        cells : int or three
            Cells along the longest edge of the box (or of the bounds if nothing is periodic), or along x, y and z.
        layers : sequence of str, optional
            Layers to include; all by default.
        threads : int, optional
            Number of threads; the densities do not depend on it.

        Returns
        -------
        Grid
            float64, shape (nx, ny, nz), mass (or number of particles) per volume. Its sum times the volume of a cell,
            plus the mass beyond open edges (`Grid.outside`), is the total mass to one in a million.
        """
        names = _coerce.names(layers)
        values, origin, spacing, outside = self._native.grid(_coerce.cells(cells), None, names, threads)
        return Grid._of(
            values,
            origin=tuple(origin),
            spacing=tuple(spacing),
            unit=self._native.density_unit(3, names),
            length_unit=self.length_unit,
            periodic=self.periodic,
            hubble=self.metadata["hubble"],
            outside=outside,
            field=None,
        )

    def grid(
        self, field: str, cells: Cells = 128, *, layers: Optional[Names] = None, threads: Optional[int] = None
    ) -> Grid:
        """Mean of a field over each cell of the grid of `density_grid`, weighted by density.

        Parameters
        ----------
        field : str
            A field's name, such as ``"velocity"``, or its dispersion: ``"dispersion.velocity"``.
        cells : int or three
            Cells along the longest edge of the box (or of the bounds if nothing is periodic), or along x, y and z.
        layers : sequence of str, optional
            Layers to include; all by default. Layers without the field add nothing.
        threads : int, optional
            Number of threads; the values do not depend on it.

        Returns
        -------
        Grid
            float64, shape (nx, ny, nz), or (nx, ny, nz, 3) for a vector; NaN where no Gaussian with the field reaches.
            `Grid.outside` is NaN.
        """
        name, dispersion = self._field(field)
        names = _coerce.names(layers)
        values, origin, spacing, outside = self._native.grid(_coerce.cells(cells), (name, dispersion), names, threads)
        return Grid._of(
            values,
            origin=tuple(origin),
            spacing=tuple(spacing),
            unit=self._native.field_unit(name, dispersion) or "",
            length_unit=self.length_unit,
            periodic=self.periodic,
            hubble=self.metadata["hubble"],
            outside=outside,
            field=name,
        )

    def _field(self, field: str) -> tuple[str, bool]:
        """Split the name of a field, or of its dispersion."""
        name = field.removeprefix("dispersion.")
        if name not in self.fields:
            there = ", ".join(self.fields) or "none"
            raise InputError(f"the model has no field {name!r}; its fields: {there}")
        if name != field and self.fields[name].kind == "sum":
            raise InputError(f"{name!r} is a sum over particles and has no dispersion")
        return name, name != field

    def at(
        self,
        points: ArrayLike,
        field: Optional[str] = None,
        *,
        layers: Optional[Names] = None,
        threads: Optional[int] = None,
    ) -> Float64:
        """Density at points, or a field there: sums over the Gaussians, including periodic images.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            In world units or with a unit of their own.
        field : str, optional
            A field's mean, such as ``"velocity"``, or its dispersion, such as ``"dispersion.velocity"``, instead of the
            density.
        layers : sequence of str, optional
            Layers to include; all by default.
        threads : int, optional
            Number of threads; the densities do not depend on it.

        Returns
        -------
        numpy.ndarray, float64, shape (n,)
            Mass (or number of particles) per volume, in the unit of `density_grid`. A field has its own unit, is NaN
            beyond all Gaussians, and has the shape (n, 3) if it is a vector.
        """
        asked = None if field is None else self._field(field)
        return self._native.at(_coerce.points(points, self.length_unit), asked, _coerce.names(layers), threads)

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
        """Draws synthetic particles: as many as in the snapshot, or `n`.

        Parameters
        ----------
        n : int, optional
            Number of particles.
        method : {"count", "volume", "ellipsoid", "grid", "stratified", "spaced"}
            How to draw them; see docs/results/recovery.md.
        scale : float
            Factor on the widths of the Gaussians.
        seed : int
            The same seed gives the same particles, also in the command's `recover`.
        layers : sequence of str, optional
            Layers to draw particles from; all by default.
        threads : int, optional
            Number of threads; the particles do not depend on it.
        progress : bool or callable, optional
            True for a progress bar, or a function of (phase, done, total).

        Returns
        -------
        Snapshot
            `synthetic` is True; `notes` say what the particles are good for.
        """
        names = _coerce.names(layers)
        native = self._native.recover(n, method, scale, seed, names, threads, _coerce.progress(progress))
        return Snapshot._of(native)

    # The command's subcommands.

    def simplify(
        self,
        *,
        ratio: Optional[float] = None,
        size: Union[int, str, None] = None,
        gaussians: Optional[int] = None,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> Model:
        """A smaller model made from this one, as by the command's ``simplify``.

        Parameters
        ----------
        ratio, size, gaussians : float, int or str, int
            One target, as for `compress`.
        """
        given = (ratio, _coerce.bytes_of(size), gaussians)
        return Model._of(_particlegs.simplify(self._native, *given, threads, _coerce.progress(progress)))

    def merge(
        self,
        *others: Model,
        fields: Optional[Names] = None,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> Model:
        """Merges this model with others, such as parts of a box. Their coded blocks are copied unchanged.

        `fields` names the fields to keep, which all must have; by default all, if the models have the same.
        """
        parts = [self._native, *(other._native for other in others)]
        return Model._of(_particlegs.merge(parts, _coerce.names(fields), threads, _coerce.progress(progress)))

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
        """Compares the model's pictures with those of all particles, as the command's ``eval``.

        Parameters
        ----------
        snapshot : Snapshot or array_like, shape (n, 3)
            The particles.
        frames : int
            Number of views on each of three orbits.
        size : (int, int)
            Width and height of the pictures in pixels.
        seed : int
            Seed for the views and their radii and opacities.

        Returns
        -------
        dict
            ``views``, ``by_orbit`` and ``mean``: PSNR, masked PSNR (dB) and SSIM, also those of trivial pictures;
            ``source_matches``: whether these are the particles that the model was made from (if not, it warns).
        """
        native = as_snapshot(snapshot)._native
        pixels = _coerce.size_of(size)
        result = _particlegs.evaluate(self._native, native, frames, pixels, seed, threads, _coerce.progress(progress))
        scores: dict[str, Any] = json.loads(result)
        return scores

    def verify(
        self,
        snapshot: Optional[Union[Snapshot, ArrayLike]] = None,
        *,
        full: bool = False,
        fields: Optional[Mapping[str, Any]] = None,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> dict[str, Any]:
        """Looks for contradictions, and measures again on the original particles what the file says, as the command's
        ``verify``.

        Parameters
        ----------
        snapshot : Snapshot or array_like, shape (n, 3), optional
            The particles.
        full : bool
            Measure a full certificate even if the file has a smaller one.
        fields : dict of array_like, optional
            The fields of the particles that the model has, as for `compress`. Those of files are read from them;
            others are not compared without.

        Returns
        -------
        dict
            ``measured``, a certificate; ``differing``, a line for each number of the file that differs from the
            measurement, for what is listed otherwise than the snapshot has it, and for each contradiction;
            ``verdict``, a dict with ``use``, ``word`` and ``why`` for each use; ``wrong``, the error or None;
            and the rest of the command's JSON.

        Raises
        ------
        InputError
            If these are not the particles that the model was made from.
        """
        native = None if snapshot is None else as_snapshot(snapshot)._native
        own = [(name, *_coerce.field(values, name)) for name, values in (fields or {}).items()]
        result, wrong = _particlegs.verify(self._native, native, full, own, threads, _coerce.progress(progress))
        found = json.loads(result)
        off = [f for f in found["figures"] if f["differs"]]
        differing = [f"{f['name']} is stored as {f['stored']}, measured {f['measured']}" for f in off]
        listed = [f"{name} is {stored}, in the snapshot {own}" for name, stored, own in found["source_differences"]]
        lines = differing + listed + found["contradictions"]
        return {**found, "measured": found["measured_again"], "differing": lines, "wrong": wrong}

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
        fields: Optional[Names] = None,
        overwrite: bool = False,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> int:
        """Exports the model for other programs, as the command's ``export``.

        Parameters
        ----------
        path : path
            The ending chooses the content: splats (``.ply``, ``.glb``), a density grid (``.npy``, ``.vti``,
            ``.fits``, ``.dx``, ``.mrc``), Gaussians (``.npz``, ``.csv``), or a web page (``.html``).
        kind : str, optional
            The kind of content, if the ending does not tell it.
        layers : sequence of str, optional
            Layers to write; all by default.
        cells : int, optional
            Cells along the longest edge, 128 by default.
        radius, opacity : float, optional
            Particle radius and opacity for splats; the model's by default.
        color : {"grey", "layer", "density"}
            Colour of splats.
        fields : sequence of str, optional
            Fields to add to a density grid (``.vti``, ``.fits``), or ``"all"``: mean and dispersion in each cell.
        overwrite : bool
            Replace an existing file.

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
            "fields": _coerce.names(fields) or [],
            "overwrite": overwrite,
        }
        return _particlegs.export(self._native, os.fspath(path), asked, threads, _coerce.progress(progress))

    # Notebooks.

    def to_html(self, **opening: Any) -> str:
        """A web page that shows the model offline; it contains the whole file.

        Parameters
        ----------
        **opening
            First view of the page: keywords of `view`.
        """
        return self._native.to_html(opening_of(opening))

    def view(self, height: int = 600, **opening: Any) -> View:
        """The interactive viewer for a notebook. It works offline and in saved notebooks.

        Parameters
        ----------
        height : int
            Height in pixels.
        style : {"density", "paraview", "expected"}
            Style of the first picture: "density" by default, "paraview" for an alpha-blend model.
        colormap : str
            Colour map of densities.
        range : tuple of float
            Surface densities of the first and the last colour.
        background : {"black", "white"}
        layers : sequence of str
            Layers to show first; all by default.
        color_by_layer : bool
            Give each layer its own colour.
        radius, opacity : float
            Particle radius and opacity, in styles other than "density".
        camera : Camera
            The first camera.

        Returns
        -------
        View
            Shown by the notebook; `View.save` writes the page.
        """
        return View(self.to_html(**opening), int(height))

    def __repr__(self) -> str:
        return (
            f"<Model {self.name!r}: {self.count} particles in {self._description['gaussians']} Gaussians, "
            f"{self.nbytes} bytes, ratio {self.ratio:.0f}, {self.law}>"
        )

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        png, colors = self._native.poster((480, 270))
        picture = "style paraview"
        if colors is not None:
            picture = f"surface density, {colors[0]:.2g} to {colors[1]:.2g} {self._native.density_unit(2, None)}"
        return {"text/plain": repr(self), "text/html": summary(self.name, [*_rows(self), ("picture", picture)], png)}


def read(
    source: Union[Path, bytes, bytearray, memoryview], *, name: Optional[str] = None, threads: Optional[int] = None
) -> Model:
    """Opens a model file.

    Parameters
    ----------
    source : path or bytes
        The file or its bytes.
    name : str, optional
        Name of a model read from bytes.
    threads : int, optional
        Number of threads; all that the process may use by default.

    Returns
    -------
    Model

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ModelError
        If the file is corrupt or of a newer version.
    """
    if isinstance(source, (bytes, bytearray, memoryview)):
        return Model._of(_particlegs.Model(bytes(source), name or "model", threads))
    return Model._of(_particlegs.Model.read(os.fspath(source), threads))


def _rows(model: Model) -> Iterator[tuple[str, str]]:
    """The rows of the table: names and values."""
    scale_factor, unit = model.metadata["scale_factor"], model.length_unit or ""
    low, high = model.bounds
    size = " x ".join(f"{v:.4g}" for v in high - low)
    yield "particles", f"{model.count:,}"
    yield "Gaussians", f"{len(model.gaussians):,}"
    yield "file", f"{model.nbytes:,} bytes, ratio {model.ratio:.0f}"
    yield "extent", f"{size} {unit}".strip()
    if len(model.layers) > 1:
        yield "layers", ", ".join(layer["name"] for layer in model.layers)
    if model.mass is not None:
        yield "mass", f"{model.mass:.4g} {model.mass_unit or ''}".strip()
    if scale_factor:
        yield "redshift", f"{1.0 / scale_factor - 1.0:.3g}"
    words: dict[str, list[str]] = {}
    for finding in model.findings:
        words.setdefault(finding["word"], []).append(finding["use"].replace("_", " "))
    for word in ("good", "fair", "poor", "cannot tell", "not measured"):
        if word in words:
            yield word, ", ".join(words[word])


def _of_bytes(data: bytes, name: str) -> Model:
    return read(data, name=name)
