"""Snapshots of particles."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Optional, Union, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _coerce, _particlegs, _units, handover
from ._camera import Camera
from ._camera import native as native_camera
from ._particlegs import InputError
from ._types import Bytes8, Drawing, Float32, Float64, Floats, Known, Numbers, Path, PictureStyle, Progress

if TYPE_CHECKING:
    from typing_extensions import Self, Unpack


def _refuse_mixed(moment: dict[str, Any], box: Any) -> None:
    """Refuses physical positions in a comoving box and vice versa."""
    other = _units.moment_of(box)
    if moment and other and moment["comoving"] != other["comoving"] and moment["scale_factor"] != 1.0:
        said = ["physical", "comoving"]
        raise InputError(
            f"positions are {said[moment['comoving']]} and the box is {said[other['comoving']]}: convert one of them"
        )


def _within_float32(masses: Any) -> tuple[Any, Optional[float]]:
    """Masses as weights, relative to their mean if float32 cannot hold them (haloes in grams)."""
    numbers = _units.plain(masses, "masses")
    reach = np.finfo(np.float32)
    if numbers.size == 0 or (numbers.max() <= reach.max and numbers.min() >= reach.tiny):
        return numbers, None
    mean = float(numbers.mean(dtype=np.float64))
    return (numbers / mean, mean) if np.isfinite(mean) and numbers.min() > 0 else (numbers, None)


class Snapshot:
    """Particles from arrays, from a file, or drawn from a model.

    Parameters
    ----------
    positions : array_like, shape (n, 3), or three arrays of shape (n,)
        Positions of any real type, byte order and strides. Contiguous float32, (n, 3) or three columns, is not copied
        and must not change while the snapshot is in use. Values with more digits that are far from 0 are stored
        relative to an origin near the data. Arrays with units (astropy, unyt, yt, swiftsimio, pynbody) set the unit
        of length; those of swiftsimio also set `comoving` and `scale_factor`.
    weights : array_like, shape (n,), optional
        Positive weights of the particles, relative to `masses` if that is one number.
    masses : float or array_like, shape (n,), optional
        One mass for all particles, or one for each.
    box : float, array_like of 3, 6 or (3, 3), optional
        Simulation cell: one length, three lengths, three lengths and three angles (degrees), or cell vectors as rows.
        A box or an origin with another unit is converted to the unit of the positions.
    pbc : bool or three of them
        Whether the box is periodic along its vectors.
    origin : array_like, shape (3,), optional
        Lowest corner of the box; 0 by default.
    units, mass_units : str, optional
        Units of length and mass as text, such as ``"Mpc/h"`` and ``"Msun/h"``. Arrays of other units are converted.
    name : str
        Name in pictures and files.
    comoving, scale_factor, hubble, time : optional
        Cosmology and time of the snapshot; stored in model files.
    layers : dict of int, optional
        Names of species and their numbers of particles, in the order of the particles.
    skip_invalid : bool
        Leave out particles with NaN or infinite values, or weights that are not positive, instead of raising an error.

    Raises
    ------
    InputError
        For wrong shapes, no particles, values that are not finite, a box without volume, or units that do not fit.
    """

    def __init__(
        self,
        positions: Any,
        *,
        weights: Optional[ArrayLike] = None,
        masses: Any = None,
        box: Any = None,
        pbc: Union[bool, Sequence[bool]] = True,
        origin: Any = None,
        units: Optional[str] = None,
        mass_units: Optional[str] = None,
        name: str = "particles",
        comoving: Optional[bool] = None,
        scale_factor: Optional[float] = None,
        hubble: Optional[float] = None,
        time: Optional[float] = None,
        layers: Optional[Mapping[str, int]] = None,
        skip_invalid: bool = False,
        threads: Optional[int] = None,
    ) -> None:
        moment = _units.moment_of(positions)
        _refuse_mixed(moment, box)
        places, unit = _coerce.positions(positions, units)
        if masses is not None and mass_units is None:
            masses, mass_units = _units.named(masses)
        each = None
        if masses is not None:
            masses = _units.bare_in(masses, mass_units, "masses")
            if np.ndim(masses) == 0:
                each = float(masses)
            elif weights is not None:
                raise InputError("give either weights or a mass for each particle, not both")
            else:
                weights, each = _within_float32(masses)
        known = {
            "name": str(name),
            "cell": _coerce.cell(box, pbc, origin, unit),
            "length_unit": units if units is not None or unit is None else _units.text_of(unit),
            "mass_unit": mass_units,
            "particle_mass": each,
            "comoving": moment.get("comoving") if comoving is None else bool(comoving),
            "scale_factor": moment.get("scale_factor") if scale_factor is None else float(scale_factor),
            "hubble": hubble,
            "time": time,
            "layers": [] if layers is None else [(str(name), int(count)) for name, count in layers.items()],
        }
        column = None if weights is None else _coerce.column(_units.bare(weights), "weights")
        self._native = _particlegs.Snapshot(places, column, known, skip_invalid, threads)
        if box is not None:
            self._check_box(threads)

    def _check_box(self, threads: Optional[int]) -> None:
        """Refuses an orthogonal box if the particles extend over 1.5 times its length: most likely a wrong unit."""
        vectors, (low, high) = self.box, np.array(self._native.bounds(threads))
        if vectors is None or not _coerce.is_right(vectors):
            return
        for axis, extent, length, repeats in zip("xyz", high - low, np.diag(vectors), self.periodic):
            if repeats and extent > 1.5 * abs(length):
                raise InputError(
                    f"the particles extend over {extent:g} along {axis}, but the box is {length:g} long: "
                    "check the unit of length and the box"
                )

    @classmethod
    def _of(cls, native: _particlegs.Snapshot) -> Self:
        snapshot = cls.__new__(cls)
        snapshot._native = native
        return snapshot

    @classmethod
    def from_chunks(cls, chunks: Iterable[Any], *, folder: Optional[Path] = None, **known: Unpack[Known]) -> Self:
        """Particles from chunks, which together need not fit into memory.

        Parameters
        ----------
        chunks : iterable of array_like
            Positions of shape (n, 3), or pairs of positions and weights. They are stored as float32.
        folder : path, optional
            Folder for scratch files, 12 bytes per particle (16 with weights); by default the system's folder for
            temporary files. They have no names and vanish with the snapshot, even if the program crashes.
        **known
            As for `Snapshot`: box, units, ...

        Returns
        -------
        Snapshot
        """
        files: list[Any] = []
        weighted, rows = False, 0
        for chunk in chunks:
            pair = isinstance(chunk, tuple) and len(chunk) == 2
            given, weights = chunk if pair else (chunk, None)
            if not files:
                weighted = weights is not None
                files = [tempfile.TemporaryFile(dir=folder) for _ in range(4 if weighted else 3)]  # noqa: SIM115
            if weighted != (weights is not None):
                raise InputError("either all chunks must have weights, or none")
            places, unit = _coerce.positions(given, known.get("units"))
            if unit is not None and known.get("units") is None:
                raise InputError("the chunks carry a unit of length: state by units= which unit to convert them to")
            columns = list(places) if isinstance(places, tuple) else [places[:, k] for k in range(3)]
            if weighted:
                columns.append(_coerce.column(_units.bare(weights), "weights"))
                if len(columns[3]) != len(columns[0]):
                    raise InputError(f"there are {len(columns[3])} weights for {len(columns[0])} particles")
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

    def __len__(self) -> int:
        return len(self._native)

    @property
    def metadata(self) -> dict[str, Any]:
        """Name, cell, units and epoch of the particles."""
        metadata: dict[str, Any] = json.loads(self._native.metadata)
        return metadata

    @property
    def name(self) -> str:
        """The name."""
        return str(self.metadata["name"])

    @property
    def positions(self) -> Numbers:
        """Positions, (n, 3): read-only float32 if stored relative to 0, otherwise float64."""
        local, origin = self._native.local_positions, np.array(self._native.origin)
        return local if not origin.any() else local.astype(np.float64) + origin

    @property
    def fields(self) -> dict[str, Floats]:
        """Fields that all layers have, (n,) or (n, 3) each: those of the files, which are read now, or those that were
        drawn with the particles of a model. `save` writes drawn ones.

        They are float32, or float64 where that does not hold the values.
        """
        return {name: values for name, _, values in self._native.fields}

    @property
    def weights(self) -> Optional[Float32]:
        """Weights, float32, (n,), read-only; None if all are equal."""
        return self._native.weights

    @property
    def masses(self) -> Optional[Float64]:
        """Masses, float64, (n,), read-only if all are equal; None if they are unknown."""
        weights, layers = self.weights, self._native.layers
        if any(unit is None and not weighted for _, _, _, unit, weighted in layers):
            return None
        if weights is None and len({unit for _, _, _, unit, _ in layers}) == 1:
            return np.broadcast_to(np.float64(layers[0][3] or 0.0), (len(self),))
        masses = np.empty(len(self))
        for _, first, end, unit, weighted in layers:
            if weighted and weights is not None:
                masses[first:end] = np.multiply(weights[first:end], unit or 1.0, dtype=np.float64)
            else:
                masses[first:end] = unit
        return masses

    def __getitem__(self, species: str) -> Self:
        """The particles of a species, such as ``snap["gas"]``, by the layer's name, an alias (``dm``) or a number."""
        if not isinstance(species, str):
            raise TypeError("index a snapshot by the name of a species, and its positions or masses by numbers")
        return self._of(self._native.of_species(species))

    def region(self, low: Any, high: Any, *, threads: Optional[int] = None) -> Self:
        """The particles inside a box, as with the command's ``--region``.

        Parameters
        ----------
        low, high : float or array_like, shape (3,)
            Corners, in world units or with a unit of their own.

        Returns
        -------
        Snapshot

        Raises
        ------
        InputError
            If the corners are in the wrong order, or the box has no particles.
        """
        corners = [_coerce.lengths(corner, self.length_unit, "a corner") for corner in (low, high)]
        return self._of(self._native.region(corners[0], corners[1], threads))

    @property
    def layers(self) -> dict[str, slice]:
        """Names of the species or mass classes, and the slice of particles of each."""
        return {name: slice(first, end) for name, first, end, _, _ in self._native.layers}

    @property
    def bounds(self) -> Float64:
        """The lowest and the highest corner, (2, 3)."""
        return np.array(self._native.bounds())

    @property
    def box(self) -> Optional[Float64]:
        """Cell vectors as rows, (3, 3), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["vectors"])

    @property
    def origin(self) -> Optional[Float64]:
        """Lowest corner of the box, (3,), or None."""
        cell = self.metadata["cell"]
        return None if cell is None else np.array(cell["origin"])

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
    def synthetic(self) -> bool:
        """Whether the particles were drawn from a model."""
        return self._native.drawn is not None

    @property
    def notes(self) -> dict[str, Any]:
        """For drawn particles: their model and what they are good for. Empty for others."""
        notes: dict[str, Any] = json.loads(self._native.drawn or "{}")
        return notes

    @overload
    def render(
        self,
        azimuth: float = ...,
        elevation: float = ...,
        distance: float = ...,
        *,
        style: PictureStyle = ...,
        **drawing: Unpack[Drawing],
    ) -> Bytes8: ...
    @overload
    def render(
        self,
        azimuth: float = ...,
        elevation: float = ...,
        distance: float = ...,
        *,
        style: Literal["expected"],
        **drawing: Unpack[Drawing],
    ) -> Float32: ...
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
        threads: Optional[int] = None,
    ) -> Numbers:
        """Renders all particles: the reference for pictures of a model.

        Takes the same arguments as `Model.render`. The default radius is 0.0406 of the mean spacing, the default
        opacity 0.05.

        Returns
        -------
        numpy.ndarray, shape (height, width)
            uint8, or float32 in [0, 1] for style ``"expected"``.
        """
        unit = self.length_unit
        looking = native_camera(camera, (azimuth, elevation, distance), center, width, depth, unit)
        radius = None if radius is None else _units.number_in(radius, unit, "radius")
        return self._native.render(style, _coerce.size_of(size), looking, radius, opacity, threads)

    def save(
        self,
        path: Path,
        *,
        overwrite: bool = False,
        threads: Optional[int] = None,
        progress: Progress = None,
    ) -> int:
        """Writes the particles in the format of the file name's ending.

        Parameters
        ----------
        path : path
            ``.hdf5``, ``.npy``, ``.vtp``, ``.dump``, ...; a name without an ending makes a folder of float32 columns.
            Only the folder also stores that particles are synthetic: tell the people you pass other files to.
        overwrite : bool
            Replace an existing file.

        Returns
        -------
        int
            Bytes written.
        """
        return self._native.save(path, overwrite, threads, _coerce.progress(progress))

    from_ase = classmethod(handover.from_ase)
    from_mdanalysis = classmethod(handover.from_mdanalysis)
    from_pynbody = classmethod(handover.from_pynbody)
    from_pyvista = classmethod(handover.from_pyvista)
    from_swiftsimio = classmethod(handover.from_swiftsimio)
    from_yt = classmethod(handover.from_yt)
    to_ase = handover.to_ase
    to_astropy = handover.snapshot_to_astropy
    to_mdanalysis = handover.to_mdanalysis
    to_pynbody = handover.to_pynbody
    to_pyvista = handover.to_pyvista
    to_swiftsimio = handover.to_swiftsimio
    to_yt = handover.to_yt

    def __repr__(self) -> str:
        unit = f" {self.length_unit}" if self.length_unit else ""
        what = "synthetic particles" if self.synthetic else "particles"
        box = self.box
        if box is None:
            where = "no box"
        elif _coerce.is_right(box):
            where = "box " + " x ".join(f"{v:g}" for v in np.diag(box)) + unit
        else:
            where = "tilted box"
        layers = ", ".join(f"{name}: {part.stop - part.start}" for name, part in self.layers.items())
        return f"<Snapshot {self.name!r}: {len(self)} {what}, {where}; {layers}>"


def as_snapshot(given: Union[Snapshot, ArrayLike], box: Any = None) -> Snapshot:
    """The snapshot itself, or one made from positions."""
    return given if isinstance(given, Snapshot) else Snapshot(given, box=box)
