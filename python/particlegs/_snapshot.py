"""Snapshots of particles."""

from __future__ import annotations

import json
import tempfile

import numpy as np

from . import _coerce, _particlegs
from ._camera import native as native_camera
from ._particlegs import InputError
from ._particlegs import formats as _formats


class Snapshot:
    """Particles: arrays, a file that was opened, or what was drawn from a model.

    Parameters
    ----------
    positions : array_like, shape (n, 3), or three arrays of shape (n,)
        Positions in any real type, byte order and strides. float32 is used where it lies: (n, 3) contiguous, or three
        contiguous columns; the memory must not change while the snapshot is in use. Values of more digits are kept
        relative to an origin near the data where they lie far from 0. Arrays with units (astropy, unyt, yt,
        swiftsimio) bring their unit of length.
    weights : array_like, shape (n,), optional
        Weights of the particles, above 0, relative to `masses` where that is one number.
    masses : float or array_like, shape (n,), optional
        The mass of every particle, or of each.
    box : float, array_like of 3, 6 or (3, 3), optional
        Simulation cell: its length, three lengths, three lengths and three angles (degrees), or cell vectors by rows.
    pbc : bool or three of them
        Does the box repeat, along which of its vectors?
    origin : array_like, shape (3,), optional
        Lowest corner of the box; 0 by default.
    units, mass_units : str, optional
        Units of length and mass as text, such as ``"Mpc/h"`` and ``"Msun/h"``.
    name : str
        What pictures and files call it.
    comoving, scale_factor, hubble, time : optional
        What is known of the moment; kept in model files.
    skip_invalid : bool
        Leave out particles with NaN or infinite values (or weights that are not positive) instead of refusing all.

    Raises
    ------
    InputError
        For wrong shapes, no particles, values that are not finite, a box without volume.
    """

    def __init__(
        self,
        positions,
        *,
        weights=None,
        masses=None,
        box=None,
        pbc=True,
        origin=None,
        units=None,
        mass_units=None,
        name="particles",
        comoving=None,
        scale_factor=None,
        hubble=None,
        time=None,
        skip_invalid=False,
        threads=None,
    ):
        places, unit = _coerce.positions(positions)
        each = None
        if masses is not None:
            mass_units = mass_units or _coerce.unit_of(masses)
            if np.ndim(masses) == 0:
                each = float(getattr(masses, "value", masses))
            elif weights is not None:
                raise InputError("give weights, or a mass for each particle, not both")
            else:
                weights = masses
        known = {
            "name": str(name),
            "cell": _coerce.cell(box, pbc, origin),
            "length_unit": units or unit,
            "mass_unit": mass_units,
            "particle_mass": each,
            "comoving": comoving,
            "scale_factor": scale_factor,
            "hubble": hubble,
            "time": time,
        }
        column = None if weights is None else _coerce.column(weights, "weights")
        self._native = _particlegs.Snapshot(places, column, known, skip_invalid, threads)
        if box is not None:
            self._check_box(threads)

    def _check_box(self, threads):
        """Refuses an orthogonal box that the particles are half as long again as: one of another unit, most likely."""
        vectors, (low, high) = self.box, np.array(self._native.bounds(threads))
        if not np.all(vectors == np.diag(np.diag(vectors))):
            return
        for axis, extent, length, repeats in zip("xyz", high - low, np.diag(vectors), self.periodic):
            if repeats and extent > 1.5 * length:
                raise InputError(
                    f"the particles reach over {extent:g} along {axis}, and the box is {length:g} long: check the unit of "
                    "length and the box"
                )

    @classmethod
    def _of(cls, native):
        snapshot = cls.__new__(cls)
        snapshot._native = native
        return snapshot

    @classmethod
    def from_chunks(cls, chunks, *, folder=None, **known):
        """Particles that come chunk by chunk and need not fit into memory.

        Parameters
        ----------
        chunks : iterable of array_like
            Positions of shape (n, 3), or pairs of positions and weights. Kept as float32 about 0.
        folder : path, optional
            Where scratch files go, 12 bytes a particle (16 with weights); the system's place for temporary files by
            default. They have no names and are gone when the snapshot is, however the program ends.
        **known
            As for `Snapshot`: box, units, ...

        Returns
        -------
        Snapshot
        """
        files, weighted, rows = [], None, 0
        for chunk in chunks:
            pair = isinstance(chunk, tuple) and len(chunk) == 2
            places, weights = chunk if pair else (chunk, None)
            if weighted is None:
                weighted = weights is not None
                files = [tempfile.TemporaryFile(dir=folder) for _ in range(4 if weighted else 3)]
            if weighted != (weights is not None):
                raise InputError("every chunk has weights, or none has")
            places, _ = _coerce.positions(places)
            columns = list(places) if isinstance(places, tuple) else [places[:, k] for k in range(3)]
            if weighted:
                columns.append(_coerce.column(weights, "weights"))
                if len(columns[3]) != len(columns[0]):
                    raise InputError(f"{len(columns[3])} weights of {len(columns[0])} particles")
            for file, column in zip(files, columns):
                file.write(np.ascontiguousarray(column, dtype=np.float32).data)
            rows += len(columns[0])
        if rows == 0:
            raise InputError("no particles")
        for file in files:
            file.flush()
        maps = [np.memmap(file, dtype=np.float32, mode="r", shape=(rows,)) for file in files]
        for file in files:
            file.close()
        return cls(tuple(maps[:3]), weights=maps[3] if weighted else None, **known)

    def __len__(self):
        return len(self._native)

    @property
    def metadata(self) -> dict:
        """What is known of the particles: name, cell, units, moment."""
        return json.loads(self._native.metadata)

    @property
    def name(self) -> str:
        """What it is called."""
        return self.metadata["name"]

    @property
    def positions(self) -> np.ndarray:
        """Positions, (n, 3): a read-only float32 array where they lie so, float64 where they are kept about an origin."""
        local, origin = self._native.local_positions, np.array(self._native.origin)
        return local if not origin.any() else local.astype(np.float64) + origin

    @property
    def weights(self):
        """Weights, float32, (n,), read-only; None where all particles count alike."""
        return self._native.weights

    @property
    def masses(self):
        """Masses: one number, an array (n,) of float64, or None where they are not known."""
        weights, layers = self.weights, self._native.layers
        if any(unit is None and not weighted for _, _, _, unit, weighted in layers):
            return None
        if weights is None and len({unit for _, _, _, unit, _ in layers}) == 1:
            return layers[0][3]
        masses = np.empty(len(self))
        for _, first, end, unit, weighted in layers:
            masses[first:end] = (weights[first:end] * (unit or 1.0)) if weighted else unit
        return masses

    @property
    def layers(self) -> dict:
        """Species or classes of mass: names and the particles of each, as slices."""
        return {name: slice(first, end) for name, first, end, _, _ in self._native.layers}

    @property
    def bounds(self) -> np.ndarray:
        """The lowest and the highest corner, (2, 3)."""
        return np.array(self._native.bounds())

    @property
    def box(self):
        """Cell vectors by rows, (3, 3), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["vectors"])

    @property
    def origin(self):
        """Lowest corner of the box, (3,), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["origin"])

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
    def synthetic(self) -> bool:
        """Was it drawn from a model, not simulated?"""
        return self._native.drawn is not None

    @property
    def notes(self) -> dict:
        """What drawn particles are, of which model, and what they are good for; empty of others."""
        return json.loads(self._native.drawn or "{}")

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
        threads=None,
    ):
        """The picture of all particles: the reference that a model's picture is measured by.

        Takes the same arguments as `Model.render`. The default radius is 0.0406 of the mean spacing, the default
        opacity 0.05.

        Returns
        -------
        numpy.ndarray, shape (height, width)
            uint8, or float32 in [0, 1] of the style ``"expected"``.
        """
        looking = native_camera(camera, azimuth, elevation, distance, center, width, depth)
        return self._native.render(style, tuple(size), looking, radius, opacity, threads)

    def save(self, path, *, overwrite=False, threads=None, progress=None) -> int:
        """Writes the particles in the format that the name's ending means.

        Parameters
        ----------
        path : path
            ``.hdf5``, ``.npy``, ``.vtp``, ``.dump``, ...; a name without an ending becomes a folder of float32
            columns. What drawn particles are is written beside those alone: say so where you hand them on.
        overwrite : bool
            Replace what is there.

        Returns
        -------
        int
            Bytes written.
        """
        return self._native.save(path, overwrite, threads, _coerce.progress(progress))

    def __repr__(self):
        unit = f" {self.length_unit}" if self.length_unit else ""
        what = "synthetic particles" if self.synthetic else "particles"
        box = self.box
        if box is None:
            where = "no box"
        elif np.all(box == np.diag(np.diag(box))):
            where = "box " + " x ".join(f"{v:g}" for v in np.diag(box)) + unit
        else:
            where = "tilted box"
        layers = ", ".join(f"{name}: {part.stop - part.start}" for name, part in self.layers.items())
        return f"<Snapshot {self.name!r}: {len(self)} {what}, {where}; {layers}>"


def open(  # noqa: A001
    paths,
    *,
    species=None,
    format=None,  # noqa: A002
    positions=None,
    weights="auto",
    frame=None,
    layers_by="species",
    box=None,
    units=None,
    mass_units=None,
    skip_invalid=False,
    region=None,
    center=None,
    width=None,
    every=1,
    sample=None,
    left_out=False,
    seed=42,
    scratch=None,
    threads=None,
    progress=None,
) -> Snapshot:
    """Opens a snapshot of any format that the command reads.

    Parameters
    ----------
    paths : path or several
        The snapshot's first file, its folder, or raw columns x, y, z (and weights).
    species : str, int or several, optional
        Particle types by name, number or alias (``"dm"``, ``1``); all by default, each a layer.
    format : str, optional
        Name of the format where the content does not tell; `formats` lists them.
    positions, weights : str, optional
        Fields of positions and weights; ``weights=None`` counts particles alike, ``"auto"`` takes the masses of a
        species whose masses differ.
    frame : int, optional
        Frame of a trajectory, from 0; the last by default.
    layers_by : {"species", "mass"}
        What becomes a layer.
    box : float or three, optional
        Lengths of the periodic box; replaces those in the file.
    units, mass_units : str, optional
        Units of length and mass; replace those in the file.
    skip_invalid : bool
        Leave out particles with NaN or infinite values instead of refusing the file.
    region : six floats, optional
        Keep ``x0 <= x < x1, y0 <= y < y1, z0 <= z < z1``, given as ``(x0, x1, y0, y1, z0, z1)``.
    center, width : array_like, optional
        Keep a window about a point, across the periodic boundary.
    every : int
        Then keep the first of every so many.
    sample : int, optional
        Then keep so many, drawn at random by `seed`; with `left_out` those that the draw leaves out.
    scratch : path, optional
        Folder for columns that have to be converted, instead of memory.
    threads : int, optional
        Threads; all that the process may use by default. Results do not depend on them.
    progress : bool or callable, optional
        True for a bar of tqdm's, or a function of (phase, done, total). An exception that it raises stops the work.

    Returns
    -------
    Snapshot
    """
    lengths = None
    if box is not None:
        lengths = np.broadcast_to(np.asarray(box, dtype=np.float64), (3,)).tolist()
    if (center is None) != (width is None):
        raise InputError("a window takes center and width")
    if region is not None and center is not None:
        raise InputError("give a region, or a window about a centre, not both")
    if layers_by not in ("species", "mass"):
        raise InputError(f'layers_by="{layers_by}": there are species and mass')
    asked = {
        "format": format,
        "species": _coerce.texts(species),
        "positions": positions,
        "weights": "none" if weights is None else str(weights),
        "frame": frame,
        "by_mass": layers_by == "mass",
        "box_lengths": lengths,
        "length_unit": units,
        "mass_unit": mass_units,
        "skip_invalid": skip_invalid,
        "region": None if region is None else [float(v) for v in region],
        "center": None if center is None else [float(v) for v in center],
        "width": None if width is None else np.broadcast_to(np.asarray(width, dtype=np.float64), (3,)).tolist(),
        "every": every,
        "sample": sample,
        "left_out": left_out,
        "seed": seed,
    }
    native = _particlegs.open(_coerce.paths(paths), asked, scratch, threads, _coerce.progress(progress))
    return Snapshot._of(native)


def formats() -> list:
    """Names of the formats that `open` reads."""
    return _formats()


def as_snapshot(given, **known) -> Snapshot:
    """A snapshot, or one of positions."""
    return given if isinstance(given, Snapshot) else Snapshot(given, **known)
