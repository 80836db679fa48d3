"""Models: files of Gaussians, and what is made of them."""

from __future__ import annotations

import base64
import html
import json
import os

import numpy as np

from . import _coerce, _particlegs
from ._arrays import Grid, Map
from ._camera import native as native_camera
from ._camera import point
from ._particlegs import InputError
from ._snapshot import Snapshot

#: Directions of view, up, and the world axes across and up a map, by the axis looked along.
_ALONG = {
    "x": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1, 2),
    "y": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), 0, 2),
    "z": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 0, 1),
}


class Gaussians:
    """The Gaussians of a model as read-only arrays, layer by layer.

    Attributes
    ----------
    means : numpy.ndarray, float64, shape (n, 3)
        World units.
    covariances : numpy.ndarray, float64, shape (n, 3, 3)
        World units squared.
    counts : numpy.ndarray, float64, shape (n,)
        Particles that each stands for; whole numbers.
    masses : numpy.ndarray, float64, shape (n,), or None
        Mass of each, in the model's unit; None where masses are not known.
    opacities, grey_levels : numpy.ndarray, float64, shape (n,), or None
        Of alpha-blend models alone.
    layers : dict of str to slice
        The Gaussians of each layer.
    """

    def __init__(self, native):
        self._native = native

    def __len__(self):
        return len(self._native)

    @property
    def means(self):
        """Means, (n, 3), world units."""
        return self._native.means

    @property
    def covariances(self):
        """Covariances, (n, 3, 3), world units squared."""
        return self._native.covariances

    @property
    def counts(self):
        """Particles that each stands for, (n,)."""
        return self._native.counts

    @property
    def masses(self):
        """Masses, (n,), or None where they are not known."""
        return self._native.masses

    @property
    def opacities(self):
        """Opacities of an alpha-blend model, (n,); None of others."""
        return self._native.opacities

    @property
    def grey_levels(self):
        """Grey levels of an alpha-blend model, (n,); None of others."""
        return self._native.grey_levels

    @property
    def layers(self):
        """The Gaussians of each layer, as slices."""
        return {name: slice(first, end) for name, first, end in self._native.layer_ranges}

    def __repr__(self):
        return f"<Gaussians: {len(self)} in {len(self.layers)} layer(s)>"


class Model:
    """A mixture of Gaussians that stands for a snapshot; `read` and `compress` make one. Never changed."""

    def __init__(self):
        raise TypeError("particlegs.read or particlegs.compress make a model")

    @classmethod
    def _of(cls, native):
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
        return self._said["raw_bytes"] / self.nbytes

    @property
    def count(self) -> int:
        """Particles that it stands for."""
        return self.metadata["count"]

    @property
    def mass(self):
        """Mass of all particles in the unit of mass, or None where it is not known."""
        return self._said["mass"]

    @property
    def law(self) -> str:
        """How Gaussians become pictures: ``"optical-depth"`` or ``"alpha-blend"``."""
        return "alpha-blend" if self._native.is_alpha_blend else "optical-depth"

    @property
    def metadata(self) -> dict:
        """What the file says of the snapshot and of its making."""
        return self._said["metadata"]

    @property
    def bounds(self) -> np.ndarray:
        """The lowest and the highest corner of the snapshot, (2, 3)."""
        return np.array([self.metadata["bounds"]["min"], self.metadata["bounds"]["max"]])

    @property
    def box(self):
        """Cell vectors by rows, (3, 3), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["vectors"])

    @property
    def periodic(self) -> tuple:
        """Along which cell vectors the box repeats."""
        cell = self.metadata["cell"]
        return (False,) * 3 if cell is None else tuple(cell["periodic"])

    @property
    def length_unit(self):
        """Unit of length, as text, or None."""
        return self.metadata["length_unit"]

    @property
    def mass_unit(self):
        """Unit of mass, as text, or None."""
        return self.metadata["mass_unit"]

    @property
    def radius(self) -> float:
        """Default particle radius, world units."""
        return self.metadata["default_radius"]

    @property
    def opacity(self) -> float:
        """Default opacity of a particle."""
        return self.metadata["default_opacity"]

    @property
    def layers(self) -> list:
        """Layers: name, particles, Gaussians, mass of a particle."""
        return [dict(layer) for layer in self._said["layers"]]

    @property
    def gaussians(self) -> Gaussians:
        """The Gaussians as arrays."""
        return Gaussians(self._native.gaussians)

    @property
    def certificate(self):
        """What was measured of the decoded file when it was made, as a dict; None where nothing was."""
        return self._said["certificate"]

    @property
    def findings(self) -> list:
        """What the certificate says: dicts of ``use``, ``word`` and ``why``."""
        return [dict(finding) for finding in self._said["verdict"]]

    @property
    def verdict(self) -> str:
        """What the model is good for, in words: a line a use."""
        lines = (f"{f['use'].replace('_', ' ')}: {f['word']} ({f['why']})" for f in self.findings)
        return "\n".join(lines)

    # Files.

    def save(self, path, *, overwrite=False) -> None:
        """Writes the model file, whole or not at all.

        Raises
        ------
        FileExistsError
            Where something is, unless `overwrite`.
        """
        self._native.save(path, overwrite)

    def to_bytes(self) -> bytes:
        """The file's bytes."""
        return self._native.to_bytes()

    def __reduce__(self):
        return _of_bytes, (self.to_bytes(), self.name)

    # Pictures.

    def render(
        self,
        azimuth=0.0,
        elevation=0.0,
        distance=1.0,
        *,
        style="paraview",
        size=(1920, 1080),
        radius=None,
        opacity=None,
        center=None,
        width=None,
        depth=None,
        camera=None,
        layers=None,
        threads=None,
    ):
        """A picture of the particles.

        Parameters
        ----------
        azimuth, elevation : float
            Degrees; 0, 0 stands on +z and looks along -z, azimuth turns towards +x.
        distance : float
            Multiple of the distance from which all is seen.
        style : {"paraview", "paraview-no-fxaa", "expected", "density"}
            As ParaView draws the particles; without antialiasing; `1 - exp(-tau)` of the optical depth; surface density.
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
        looking = native_camera(camera, azimuth, elevation, distance, center, width, depth)
        names = None if layers is None else _coerce.texts(layers)
        if style == "density":
            values = self._native.density(tuple(size), looking, names, threads)
            return self._map(values, None, None)
        return self._native.render(style, tuple(size), looking, radius, opacity, names, threads)

    def _map(self, values, extent, axes):
        unit, length = self._said["surface_density_unit"], self.length_unit
        return Map._of(values, extent=extent, unit=unit, length_unit=length, axes=axes)

    def density_map(
        self, center=None, width=None, depth=None, *, axis="z", shape=(1024, 1024), layers=None, threads=None
    ) -> Map:
        """Surface density: mass, or particles, an area along an axis, averaged over each pixel.

        Parameters
        ----------
        center : array_like, shape (3,), optional
            Middle of the map; that of the box, or of the bounds, by default.
        width : float, optional
            World units across; the box, or the bounds, by default.
        depth : float, optional
            World units along the axis; one box, or everything, by default.
        axis : {"x", "y", "z"}
            The axis looked along. A map along z has x across and y up; along y, x and z; along x, y and z.
        shape : (int, int)
            Rows and columns. Pixels are square.
        layers : sequence of str, optional
            Layers that count; all by default.

        Returns
        -------
        Map
            float64, with `extent` and `unit`; a periodic box fills the window with its copies.
        """
        if axis not in _ALONG:
            raise InputError(f'axis="{axis}": there are x, y and z')
        toward, up, across, upward = _ALONG[axis]
        rows, columns = (int(n) for n in shape)
        if not (0 < rows <= 32768 and 0 < columns <= 32768):
            raise InputError("shape takes rows and columns, 1 to 32768 each")
        low, high = self._extent()
        center = np.array(0.5 * (low + high) if center is None else point(center, "center"))
        if width is None:
            width = max(high[across] - low[across], (high[upward] - low[upward]) * columns / rows)
        if not (np.isfinite(width) and width > 0) or (depth is not None and not depth > 0):
            raise InputError("width and depth must be positive")
        height = width * rows / columns
        along = "xyz".index(axis)
        periodic = self._periodic_along(along)
        # One box along the line of sight, or all there is.
        everything = 2.0 * (abs(center[along] - 0.5 * (low + high)[along]) + high[along] - low[along])
        reach = float(depth) if depth is not None else (high - low)[along] if periodic else everything
        camera = {
            "position": tuple(center + 0.5 * reach * np.array(toward)),
            "focal_point": tuple(center),
            "view_up": up,
            "fov_deg": None,
            "height": float(height),
            "clipping_range": (0.0, float(reach)),
        }
        names = None if layers is None else _coerce.texts(layers)
        values = self._native.density((columns, rows), camera, names, threads)
        x, y = center[across], center[upward]
        extent = (x - 0.5 * width, x + 0.5 * width, y - 0.5 * height, y + 0.5 * height)
        return self._map(values, tuple(float(v) for v in extent), ("xyz"[across], "xyz"[upward]))

    def _extent(self):
        """The box where it is orthogonal and repeats, else the bounds."""
        box, cell = self.box, self.metadata["cell"]
        low, high = self.bounds
        if box is not None and np.all(box == np.diag(np.diag(box))):
            for k in range(3):
                if cell["periodic"][k]:
                    low[k] = cell["origin"][k]
                    high[k] = low[k] + box[k][k]
        return low, high

    def _periodic_along(self, axis):
        box = self.box
        return box is not None and self.periodic[axis] and bool(np.all(box == np.diag(np.diag(box))))

    # Numbers.

    def density_grid(self, cells=128, *, layers=None, threads=None) -> Grid:
        """Density averaged over the cells of a grid: the mixture integrated over each, no shot noise.

        Parameters
        ----------
        cells : int
            Cells along the longest edge of the box (or of the bounds where nothing repeats).

        Returns
        -------
        Grid
            float64, shape (nx, ny, nz), mass (or particles) a volume. Sum times the volume of a cell, and what lies
            beyond open edges (`Grid.outside`), is the mass to one in a million.
        """
        names = None if layers is None else _coerce.texts(layers)
        values, origin, spacing, outside = self._native.density_grid(cells, names, threads)
        return Grid._of(
            values,
            origin=tuple(origin),
            spacing=tuple(spacing),
            unit=self._said["density_unit"],
            length_unit=self.length_unit,
            outside=outside,
        )

    def at(self, points, *, layers=None, threads=None) -> np.ndarray:
        """Density at points: the sum of the Gaussians there, with their images in a periodic box.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, float64, shape (n,)
            Mass (or particles) a volume, in the unit of `density_grid`.
        """
        names = None if layers is None else _coerce.texts(layers)
        return self._native.at(_coerce.points(points), names, threads)

    def recover(
        self, n=None, method="count", *, scale=1.0, seed=42, layers=None, threads=None, progress=None
    ) -> Snapshot:
        """Draws synthetic particles: as many as the model stands for, or `n`.

        Parameters
        ----------
        n : int, optional
            Number of particles.
        method : {"count", "volume", "ellipsoid", "grid", "stratified", "spaced"}
            How they are drawn; see docs/guide/recovery.md.
        scale : float
            Factor on the widths of the Gaussians.
        seed : int
            The same seed gives the same particles: those that the command's `recover` writes.

        Returns
        -------
        Snapshot
            Marked `synthetic`; its `notes` say what it is good for.
        """
        names = None if layers is None else _coerce.texts(layers)
        native = self._native.recover(n, method, scale, seed, names, threads, _coerce.progress(progress))
        return Snapshot._of(native)

    # What a notebook shows.

    def to_html(self) -> str:
        """A page that shows the model in any browser, offline: the whole file is inside."""
        return self._native.to_html()

    def view(self, height=600):
        """The interactive viewer in a notebook; it works offline, and in a saved page.

        Parameters
        ----------
        height : int
            Pixels.

        Returns
        -------
        View
            What the notebook shows; `View.save` writes the page.
        """
        return View(self.to_html(), int(height))

    def __repr__(self):
        return (
            f"<Model {self.name!r}: {self.count} particles in {self._said['gaussians']} Gaussians, "
            f"{self.nbytes} bytes, ratio {self.ratio:.0f}, {self.law}>"
        )

    def _rows(self):
        m, unit = self.metadata, self.length_unit or ""
        low, high = self.bounds
        size = " x ".join(f"{v:.4g}" for v in high - low)
        yield "particles", f"{self.count:,}"
        yield "Gaussians", f"{self._said['gaussians']:,}"
        yield "file", f"{self.nbytes:,} bytes, ratio {self.ratio:.0f}"
        yield "extent", f"{size} {unit}".strip()
        if len(self.layers) > 1:
            yield "layers", ", ".join(layer["name"] for layer in self.layers)
        if self.mass is not None:
            yield "mass", f"{self.mass:.4g} {self.mass_unit or ''}".strip()
        if m["scale_factor"]:
            yield "redshift", f"{1.0 / m['scale_factor'] - 1.0:.3g}"
        words = {}
        for finding in self.findings:
            words.setdefault(finding["word"], []).append(finding["use"].replace("_", " "))
        for word in ("holds", "roughly", "does not", "not measured"):
            if word in words:
                yield word, ", ".join(words[word])

    def _repr_mimebundle_(self, include=None, exclude=None):
        picture = base64.b64encode(self._native.poster((480, 270))).decode()
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
            for name, value in self._rows()
        )
        shown = (
            f"<div style='display:flex;gap:1em;align-items:flex-start;flex-wrap:wrap'>"
            f"<img width='480' height='270' alt='{html.escape(self.name)}: picture of the model' "
            f"src='data:image/png;base64,{picture}'>"
            f"<table><caption style='text-align:left;font-weight:bold'>{html.escape(self.name)}</caption>{rows}</table></div>"
        )
        return {"text/plain": repr(self), "text/html": shown}


class View:
    """A page that shows a model, in a notebook's cell.

    Attributes
    ----------
    page : str
        The page, HTML.
    height : int
        Pixels of the cell.
    """

    def __init__(self, page, height):
        self.page = page
        self.height = height

    def save(self, path, *, overwrite=False) -> None:
        """Writes the page: one file that works offline."""
        with open(path, "w" if overwrite else "x", encoding="utf-8") as file:
            file.write(self.page)

    def __repr__(self):
        return f"<View: a page of {len(self.page):,} bytes; a notebook shows it>"

    def _repr_html_(self):
        return (
            f'<iframe title="particlegs viewer" style="width:100%;height:{self.height}px;border:0" '
            f'srcdoc="{html.escape(self.page, quote=True)}"></iframe>'
        )


def read(source, *, name=None, threads=None) -> Model:
    """Opens a model file.

    Parameters
    ----------
    source : path or bytes
        The file, or its bytes.
    name : str, optional
        What to call a model of bytes.

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


def _of_bytes(data, name):
    return read(data, name=name)
