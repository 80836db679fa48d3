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
    """Takes the atoms of ASE: positions, cell and periodic axes (Angstrom), masses (Da).

    Parameters
    ----------
    atoms : ase.Atoms
        Vectors of length 0 of its cell, along which nothing repeats, become unit vectors.
    **known
        As for `Snapshot`; in place of what the atoms say. ``masses=None`` counts all atoms alike.

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
    """Hands the particles to ASE.

    Parameters
    ----------
    symbols : str or sequence of str
        Chemical symbol of all atoms, or of each; ``"X"`` is no element.

    Returns
    -------
    ase.Atoms
        Positions and cell in Angstrom (from Angstrom, nm, pm or Bohr; plain numbers are taken as they are), masses in
        Da where they are known.

    Raises
    ------
    InputError
        For units that are none of molecules.
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
