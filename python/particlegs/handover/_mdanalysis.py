"""MDAnalysis: groups of atoms and universes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._particlegs import InputError
from .._types import Float64
from ._common import factor, from_molecules, mass_of_each, needed

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._snapshot import Snapshot
    from .._types import Known


def from_mdanalysis(cls: type[Snapshot], /, group: Any, **known: Unpack[Known]) -> Snapshot:
    """Converts the current frame of MDAnalysis: positions and box (Angstrom), masses (Da), time (ps).

    Parameters
    ----------
    group : MDAnalysis.AtomGroup or MDAnalysis.Universe
        A group of atoms, or all atoms of a universe.
    **known
        As for `Snapshot`; these override values of the atoms. ``masses=None`` gives all atoms the same mass; so does a
        group in which some atoms have no mass.

    Returns
    -------
    Snapshot
        Periodic along all vectors of the box, as always in MDAnalysis.
    """
    atoms = group.atoms
    scale, heavier = from_molecules(known)
    step = atoms.universe.trajectory.ts
    said: dict[str, Any] = {"units": "Angstrom", "time": float(step.time)}
    if atoms.dimensions is not None:
        said["box"] = np.asarray(atoms.dimensions, dtype=np.float64) * ([scale] * 3 + [1.0] * 3)
    each = getattr(atoms, "masses", None)
    if each is not None and np.all(each > 0):
        said.update(masses=each * heavier, mass_units="Da")
    return cls(atoms.positions * np.float32(scale), **{**said, **known})


def to_mdanalysis(snapshot: Snapshot) -> Any:
    """Converts the particles to MDAnalysis.

    Returns
    -------
    MDAnalysis.Universe
        One frame: positions and box in Angstrom (converted from nm, pm or Bohr; numbers without a unit are not
        converted), masses in Da if known, layers as types.

    Raises
    ------
    InputError
        If the units are not molecular units, or lengths and angles cannot describe the box as MDAnalysis needs it.
    """
    mda = needed("MDAnalysis")
    scale = factor(snapshot.length_unit, "length", "Angstrom")
    universe = mda.Universe.empty(len(snapshot), trajectory=True)
    universe.atoms.positions = np.asarray(snapshot.positions, dtype=np.float64) * scale
    each = mass_of_each(snapshot)
    if each is not None:
        universe.add_TopologyAttr("masses", each * factor(snapshot.mass_unit, "mass", "Da"))
    types = np.empty(len(snapshot), dtype=object)
    for name, part in snapshot.layers.items():
        types[part] = name
    universe.add_TopologyAttr("types", types)
    if any(snapshot.periodic):
        universe.dimensions = _dimensions(snapshot, scale)
    return universe


def _dimensions(snapshot: Snapshot, scale: float) -> Optional[Float64]:
    """Lengths and angles of the box."""
    vectors = snapshot.box
    if vectors is None:
        return None
    mdamath = needed("MDAnalysis.lib.mdamath")
    dimensions = np.asarray(mdamath.triclinic_box(*(vectors * scale)), dtype=np.float64)
    rebuilt = mdamath.triclinic_vectors(dimensions, dtype=np.float64)
    if not np.allclose(rebuilt, vectors * scale, atol=1e-4 * np.abs(vectors * scale).max()):
        raise InputError(
            "MDAnalysis needs the first vector of a box along x, the second in the xy plane: rotate box and particles"
        )
    return dimensions
