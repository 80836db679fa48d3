"""Snapshots and series from files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Literal, Optional, Union, cast

from numpy.typing import ArrayLike

from . import _coerce, _particlegs
from ._particlegs import InputError
from ._series import Series, is_series
from ._snapshot import Snapshot
from ._types import Path, Progress


def open(  # noqa: A001
    paths: Union[Path, Sequence[Path]],
    *,
    species: Union[str, int, Sequence[Union[str, int]], None] = None,
    format: Optional[str] = None,  # noqa: A002
    positions: Optional[str] = None,
    mass_field: Optional[str] = "auto",
    frame: Optional[int] = None,
    topology: Optional[Path] = None,
    select: Optional[str] = None,
    layers_by: Literal["species", "mass"] = "species",
    box: Any = None,
    units: Optional[str] = None,
    mass_units: Optional[str] = None,
    skip_invalid: bool = False,
    strict: bool = False,
    unwrapped: Literal["wrap", "keep"] = "wrap",
    blocks: Union[str, Sequence[str], None] = None,
    region: Optional[Sequence[float]] = None,
    center: Optional[ArrayLike] = None,
    width: Optional[ArrayLike] = None,
    every: int = 1,
    sample: Optional[int] = None,
    left_out: bool = False,
    seed: int = 42,
    scratch: Optional[Path] = None,
    memory: bool = False,
    threads: Optional[int] = None,
    progress: Progress = None,
    weights: Optional[str] = "auto",
) -> Snapshot:
    """Opens a snapshot in any format that the command reads, or a series.

    Parameters
    ----------
    paths : path or several
        The snapshot's first file, its folder, or files of raw columns x, y, z (and weights).
    species : str, int or several, optional
        Particle types by name, number or alias (``"dm"``, ``1``); all by default. Each becomes a layer.
    format : str, optional
        Name of the format, if the content does not show it; `formats` lists them.
    positions, mass_field : str, optional
        Fields of positions and of masses (or other additive weights). ``mass_field=None`` gives all particles the same
        weight; ``"auto"`` reads the masses of a species if they differ. ``weights`` is the old name of `mass_field`.
    frame : int, optional
        Frame of a trajectory, from 0, or from the end (-1); the last by default.
    topology : path, optional
        File that names the atoms of a trajectory without names (XTC, TRR, DCD, H5MD): GRO, PDB, PSF or LAMMPS data.
    select : str, optional
        Atoms to read, such as ``"name OW"`` or ``"protein and not name H*"``.
    layers_by : {"species", "mass"}
        Make a layer for each species, or for each particle mass.
    box : float or three, optional
        Lengths of the periodic box; replaces those in the file.
    units, mass_units : str, optional
        Units of length and mass, such as ``"kpc/h"``. If the file states its units, values are converted; otherwise
        these are the file's units.
    skip_invalid : bool
        Leave out particles with NaN or infinite values instead of refusing the file.
    strict : bool
        Refuse files whose header gives a wrong number of particles, instead of warning.
    unwrapped : {"wrap", "keep"}
        Unwrapped positions of a trajectory (``xu yu zu``): wrap them into the box, or keep them and drop the box.
    blocks : several str, optional
        Names of the blocks of a Gadget file of format 1 after its header, in order: ``["POS", "VEL", "ID"]``;
        guessed from their lengths and values by default.
    region : six floats, optional
        Keep ``x0 <= x < x1, y0 <= y < y1, z0 <= z < z1``, given as ``(x0, x1, y0, y1, z0, z1)``.
    center, width : array_like, optional
        Keep a window about a point; it may cross the periodic boundary.
    every : int
        Then keep every n-th particle.
    sample : int, optional
        Then keep this number of particles, chosen at random with `seed`; with `left_out`, keep the others.
    scratch : path, optional
        Folder for converted columns, which are otherwise kept in memory.
    memory : bool
        Copy the particles into memory. By default columns that lie in a file as they are used (raw float32, some HDF5)
        are mapped, not copied: while the snapshot is in use, another program must not make such a file shorter. What
        was cut is refused when the particles are next used, but reading an array such as `positions` of a file that
        is cut at that moment ends the process.
    threads : int, optional
        Number of threads; all that the process may use by default. Results do not depend on it.
    progress : bool or callable, optional
        True for a progress bar, or a function of (phase, done, total). If it raises an exception, the work stops.

    Returns
    -------
    Snapshot
        Of the file of a series a `Series`, as ``Series(path, threads=threads)`` gives it also to type checkers.
    """
    if isinstance(paths, (str, os.PathLike)) and is_series(paths):
        return cast(Snapshot, Series(paths, threads=threads))
    asked = options(
        species=species,
        format=format,
        positions=positions,
        mass_field=mass_field,
        frame=frame,
        topology=topology,
        select=select,
        layers_by=layers_by,
        box=box,
        units=units,
        mass_units=mass_units,
        skip_invalid=skip_invalid,
        strict=strict,
        unwrapped=unwrapped,
        blocks=blocks,
        region=region,
        center=center,
        width=width,
        every=every,
        sample=sample,
        left_out=left_out,
        seed=seed,
        weights=weights,
    )
    folder = None if scratch is None else os.fspath(scratch)
    native = _particlegs.open(_coerce.paths(paths), asked, folder, memory, threads, _coerce.progress(progress))
    return Snapshot._of(native)


def options(
    *,
    species: Union[str, int, Sequence[Union[str, int]], None] = None,
    format: Optional[str] = None,  # noqa: A002
    positions: Optional[str] = None,
    mass_field: Optional[str] = "auto",
    frame: Optional[int] = None,
    topology: Optional[Path] = None,
    select: Optional[str] = None,
    layers_by: Literal["species", "mass"] = "species",
    box: Any = None,
    units: Optional[str] = None,
    mass_units: Optional[str] = None,
    skip_invalid: bool = False,
    strict: bool = False,
    unwrapped: Literal["wrap", "keep"] = "wrap",
    blocks: Union[str, Sequence[str], None] = None,
    region: Optional[Sequence[float]] = None,
    center: Optional[ArrayLike] = None,
    width: Optional[ArrayLike] = None,
    every: int = 1,
    sample: Optional[int] = None,
    left_out: bool = False,
    seed: int = 42,
    weights: Optional[str] = "auto",
) -> dict[str, Any]:
    """What `open` reads, and how, as the native module takes it."""
    if (center is None) != (width is None):
        raise InputError("a window needs both center and width")
    if region is not None and center is not None:
        raise InputError("give either region or center and width, not both")
    if weights != "auto":
        if mass_field != "auto":
            raise InputError("weights= is the old name of mass_field=: give only one of them")
        mass_field = weights
    if layers_by not in ("species", "mass"):
        raise InputError(f'layers_by must be "species" or "mass", not "{layers_by}"')
    if unwrapped not in ("wrap", "keep"):
        raise InputError(f'unwrapped must be "wrap" or "keep", not "{unwrapped}"')
    return {
        "format": format,
        "species": _coerce.texts(species),
        "positions": positions,
        "mass_field": "none" if mass_field is None else str(mass_field),
        "frame": frame,
        "topology": None if topology is None else os.fspath(topology),
        "select": select,
        "by_mass": layers_by == "mass",
        "box_lengths": None if box is None else _coerce.lengths(box, units, "the box"),
        "length_unit": units,
        "mass_unit": mass_units,
        "skip_invalid": skip_invalid,
        "strict": strict,
        "keep_unwrapped": unwrapped == "keep",
        "blocks": _coerce.texts(blocks.split(",") if isinstance(blocks, str) else blocks),
        "region": None if region is None else [float(v) for v in region],
        "center": None if center is None else _coerce.lengths(center, units, "center"),
        "width": None if width is None else _coerce.lengths(width, units, "width"),
        "every": every,
        "sample": sample,
        "left_out": left_out,
        "seed": seed,
    }


def formats() -> list[str]:
    """Names of the formats that `open` reads."""
    return _particlegs.formats()
