"""Turns particle snapshots into small files that render the picture ParaView would.

A model is a mixture of Gaussians with masses, 100 to 1000 times smaller than the particles. It renders pictures from
any side at any particle radius and opacity, and gives densities, statistics and synthetic particles.

>>> import particlegs as pg
>>> snap = pg.open("snap_099.0.hdf5", species="dm")
>>> model = pg.compress(snap, ratio=300)
>>> model.save("snap.pgs")
>>> image = model.render(azimuth=30, elevation=20)

Functions
---------
open, read, compress, stats, haloes, formats

Classes
-------
Snapshot, Model, Series, Gaussians, Camera, Map, Grid, Stats

Exceptions
----------
InputError, ModelError, UnreachableError; and the built-in MemoryError, OSError, FileExistsError and KeyboardInterrupt.
"""

from ._arrays import Grid, Map
from ._camera import Camera
from ._compress import compress, compress_series
from ._gaussians import Gaussians
from ._haloes import haloes
from ._model import Model, read
from ._open import formats, open
from ._particlegs import InputError, ModelError, UnreachableError, __version__
from ._series import Series
from ._snapshot import Snapshot
from ._stats import Stats, stats

__all__ = [
    "Camera",
    "Gaussians",
    "Grid",
    "InputError",
    "Map",
    "Model",
    "ModelError",
    "Series",
    "Snapshot",
    "Stats",
    "UnreachableError",
    "__version__",
    "compress",
    "compress_series",
    "formats",
    "haloes",
    "open",
    "read",
    "stats",
]
