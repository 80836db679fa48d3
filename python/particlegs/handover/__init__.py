"""Conversion of particles, densities and Gaussians to and from other packages, one module per package.

The functions are methods of `Snapshot`, `Grid`, `Map` and `Gaussians`. A package is imported only when it is needed.
"""

from ._ase import from_ase, to_ase
from ._astropy import snapshot_to_astropy, to_astropy
from ._mdanalysis import from_mdanalysis, to_mdanalysis
from ._pynbody import from_pynbody, to_pynbody
from ._pyvista import from_pyvista, gaussians_to_pyvista, grid_to_pyvista, to_pyvista
from ._swiftsimio import from_swiftsimio, to_swiftsimio
from ._yt import from_yt, grid_to_yt, to_yt

__all__ = [
    "from_ase",
    "from_mdanalysis",
    "from_pynbody",
    "from_pyvista",
    "from_swiftsimio",
    "from_yt",
    "gaussians_to_pyvista",
    "grid_to_pyvista",
    "grid_to_yt",
    "snapshot_to_astropy",
    "to_ase",
    "to_astropy",
    "to_mdanalysis",
    "to_pynbody",
    "to_pyvista",
    "to_swiftsimio",
    "to_yt",
]
