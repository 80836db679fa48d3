"""Catalogues of haloes."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _coerce, _particlegs
from ._model import Model
from ._snapshot import Snapshot, as_snapshot
from ._types import Names, Progress
from ._warn import warn


def haloes(
    source: Union[Snapshot, Model, ArrayLike],
    *,
    linking: float = 0.2,
    link: Names = (),
    min_particles: int = 20,
    softening: Optional[float] = None,
    sample_fraction: float = 1.0,
    particle_mass: Optional[float] = None,
    mass_unit: Optional[str] = None,
    cosmology: Optional[str] = None,
    redshift: Optional[float] = None,
    velocities: Optional[ArrayLike] = None,
    seed: int = 42,
    threads: Optional[int] = None,
    progress: Progress = None,
) -> NDArray[Any]:
    """Finds haloes: friends of friends, and spheres of given mean densities around their density peaks.

    Parameters
    ----------
    source : Snapshot, Model or array_like
        From a model, haloes are those of particles drawn from it, and masses are integrated over its Gaussians.
    linking : float
        Linking length in mean spacings of the linked particles.
    link : sequence of str
        Species to link; dark matter if there is any, else all.
    min_particles : int
        Linked particles of the smallest halo.
    softening : float, optional
        Softening length, in the unit of length; a 25th of the mean spacing by default.
    sample_fraction : float
        Fraction of the simulation's particles that the snapshot contains; masses are divided by it.
    particle_mass : float, optional
        Mass of a particle, if the snapshot states none.
    mass_unit : str, optional
        Unit of mass, such as "Msun/h".
    cosmology : str, optional
        Such as "h=0.68,Om=0.31,OL=0.69"; overrides the snapshot's.
    redshift : float, optional
        Overrides the snapshot's.
    velocities : array_like, optional
        Velocities of a snapshot's particles, shape (n, 3), km/s.
    seed : int
        Seed of particles that are drawn from a model.
    threads : int, optional
        Threads; all by default.
    progress : bool or callable, optional
        Whether to show progress, or a function that is called with it.

    Returns
    -------
    structured numpy.ndarray
        A row for each halo, by the number of particles within R200m. `dtype.metadata` has the units and descriptions of
        the columns and the remarks of the catalogue. Values are NaN for haloes of too few particles.
    """
    found = source if isinstance(source, Model) else as_snapshot(source)
    asked = {
        "linking": linking,
        "link": _coerce.texts(link),
        "min_particles": min_particles,
        "softening": softening,
        "sample_fraction": sample_fraction,
        "particle_mass": particle_mass,
        "mass_unit": mass_unit,
        "cosmology": cosmology,
        "redshift": redshift,
        "seed": seed,
    }
    given = None if velocities is None else _coerce.field(velocities, "velocity")
    fields = [] if given is None else [("velocity", given[0] or "km/s", given[1])]
    record, shown = _coerce.record(asked), _coerce.progress(progress)
    columns, remarks, notes = _particlegs.haloes(found._native, record, fields, threads, shown)
    for note in notes:
        warn(note)
    about = {
        "units": {name: unit for name, unit, *_ in columns},
        "descriptions": {name: text for name, _, text, *_ in columns},
        "remarks": remarks,
    }
    kinds = [(name, "i8" if whole and np.isfinite(values).all() else "f8") for name, _, _, whole, values in columns]
    rows = np.zeros(len(columns[0][4]), np.dtype(kinds, metadata=about))
    for name, *_, values in columns:
        rows[name] = values
    return rows
