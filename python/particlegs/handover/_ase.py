"""ASE: atoms with a cell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._common import factor, from_molecules, mass_of_each, needed

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._snapshot import Snapshot
    from .._types import Known


def from_ase(cls: type[Snapshot], /, atoms: Any, **known: Unpack[Known]) -> Snapshot:
    """Converts ASE atoms: positions, cell and periodic axes (Angstrom), masses (Da).

    Parameters
    ----------
    atoms : ase.Atoms
        Cell vectors of length 0 become unit vectors without periodicity.
    **known
        As for `Snapshot`; these override values of the atoms. ``masses=None`` gives all atoms the same mass.

    Returns
    -------
    Snapshot
    """
    scale, heavier = from_molecules(known)
    said: dict[str, Any] = {"units": "Angstrom", "name": atoms.get_chemical_formula()}
    if atoms.cell.rank > 0:
        lengths = atoms.cell.lengths()
        said.update(box=np.asarray(atoms.cell.complete()) * scale, pbc=[bool(p) for p in atoms.pbc & (lengths > 0)])
        said["origin"] = atoms.get_celldisp().ravel() * scale
    said.update(masses=atoms.get_masses() * heavier, mass_units="Da")
    return cls(atoms.get_positions() * scale, **{**said, **known})


def to_ase(snapshot: Snapshot, symbols: Any = "X") -> Any:
    """Converts the particles to ASE atoms.

    Parameters
    ----------
    symbols : str or sequence of str
        One chemical symbol for all atoms, or one for each; ``"X"`` is unknown.

    Returns
    -------
    ase.Atoms
        Positions and cell in Angstrom (converted from nm, pm or Bohr; numbers without a unit are not converted), masses
        in Da if known.

    Raises
    ------
    InputError
        If the units are not molecular units.
    """
    ase = needed("ase")
    scale = factor(snapshot.length_unit, "length", "Angstrom")
    each = mass_of_each(snapshot)
    if each is not None:
        each = each * factor(snapshot.mass_unit, "mass", "Da")
    box, origin = snapshot.box, snapshot.origin
    return ase.Atoms(
        [symbols] * len(snapshot) if isinstance(symbols, str) else symbols,
        positions=np.asarray(snapshot.positions, dtype=np.float64) * scale,
        masses=each,
        cell=None if box is None else box * scale,
        pbc=snapshot.periodic,
        celldisp=None if origin is None else origin * scale,
    )
