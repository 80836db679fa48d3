"""ASE and MDAnalysis: atoms, cells and masses, there and back."""

import numpy as np
import pytest

import particlegs as pg

ROWS = np.random.default_rng(1).random((90, 3)) * 10
TILTED = np.array([[10.0, 0, 0], [3, 9, 0], [1, 2, 8]])


def test_atoms_of_ase_come_in():
    ase = pytest.importorskip("ase")
    atoms = ase.Atoms("OH2" * 30, positions=ROWS, cell=TILTED, pbc=(True, True, False))
    snap = pg.Snapshot.from_ase(atoms)
    assert (snap.length_unit, snap.mass_unit, snap.name) == ("Angstrom", "Da", "H60O30")
    assert np.allclose(snap.positions, ROWS, atol=1e-5)
    assert np.allclose(snap.masses, atoms.get_masses(), rtol=1e-6)
    assert np.array_equal(snap.box, TILTED)
    assert snap.periodic == (True, True, False)
    assert pg.Snapshot.from_ase(atoms, masses=None).masses is None
    assert pg.Snapshot.from_ase(ase.Atoms("H90", positions=ROWS)).box is None
    slab = pg.Snapshot.from_ase(ase.Atoms("H90", positions=ROWS, cell=[10, 10, 0], pbc=(True, True, False)))
    assert slab.periodic == (True, True, False)


def test_units_that_are_asked_for():
    ase, mda = pytest.importorskip("ase"), pytest.importorskip("MDAnalysis")
    atoms = ase.Atoms("H90", positions=ROWS, cell=TILTED, pbc=True, celldisp=(1, 0, 0))
    universe = mda.Universe.empty(90, trajectory=True)
    universe.atoms.positions = ROWS
    universe.dimensions = [10, 10, 10, 90, 90, 90]
    snap = pg.Snapshot.from_ase(atoms, units="nm", mass_units="g/mol")
    assert (snap.length_unit, snap.mass_unit) == ("nm", "g/mol")
    assert np.allclose(snap.box, TILTED / 10)
    assert np.allclose(snap.origin, [0.1, 0, 0])
    for found in (snap, pg.Snapshot.from_mdanalysis(universe, units="nm")):
        assert np.allclose(found.positions, ROWS / 10, atol=1e-6)
    assert np.allclose(found.box, np.eye(3))
    with pytest.raises(pg.InputError, match="cannot be converted"):
        pg.Snapshot.from_ase(atoms, units="Mpc")


def test_atoms_of_ase_go_and_come_back():
    pytest.importorskip("ase")
    masses = np.linspace(1, 16, 90)
    snap = pg.Snapshot(ROWS / 10, units="nm", masses=masses, mass_units="g/mol", box=TILTED / 10, origin=(-0.1, 0, 0))
    atoms = snap.to_ase("O")
    assert atoms.get_chemical_symbols() == ["O"] * 90
    assert np.allclose(atoms.positions, ROWS, atol=1e-5)
    assert np.allclose(atoms.cell, TILTED)
    assert np.allclose(atoms.get_celldisp().ravel(), [-1, 0, 0])
    assert np.allclose(atoms.get_masses(), masses, rtol=1e-6)
    back = pg.Snapshot.from_ase(atoms)
    assert np.allclose(back.positions, ROWS, atol=1e-5)
    assert np.allclose(back.origin, [-1, 0, 0])
    assert len(pg.Snapshot(ROWS).to_ase(["H"] * 90)) == 90
    for known in ({"units": "Mpc"}, {"masses": 1.0, "mass_units": "Msun"}):
        with pytest.raises(pg.InputError, match="cannot be converted"):
            pg.Snapshot(ROWS, **known).to_ase()


def test_a_universe_comes_in():
    mda = pytest.importorskip("MDAnalysis")
    universe = mda.Universe.empty(90, trajectory=True)
    universe.atoms.positions = ROWS
    universe.dimensions = [10, 11, 12, 90, 90, 60]
    universe.add_TopologyAttr("masses", np.linspace(1, 16, 90))
    snap = pg.Snapshot.from_mdanalysis(universe)
    assert (snap.length_unit, snap.mass_unit) == ("Angstrom", "Da")
    assert np.allclose(snap.positions, ROWS, atol=1e-5)
    assert np.allclose(snap.masses, np.linspace(1, 16, 90), rtol=1e-6)
    assert np.allclose(np.linalg.norm(snap.box, axis=1), [10, 11, 12])
    assert snap.periodic == (True, True, True)
    part = pg.Snapshot.from_mdanalysis(universe.atoms[:40])
    assert len(part) == 40
    universe.dimensions = None
    assert pg.Snapshot.from_mdanalysis(universe).box is None
    massless = mda.Universe.empty(90, trajectory=True)
    massless.atoms.positions = ROWS
    assert pg.Snapshot.from_mdanalysis(massless).masses is None


def test_a_universe_goes_and_comes_back():
    mda = pytest.importorskip("MDAnalysis")
    snap = pg.Snapshot(ROWS / 10, units="nm", masses=np.linspace(1, 16, 90), mass_units="Da", box=TILTED / 10)
    universe = snap.to_mdanalysis()
    assert isinstance(universe, mda.Universe)
    assert np.allclose(universe.atoms.positions, ROWS, atol=1e-4)
    assert np.allclose(universe.atoms.masses, np.linspace(1, 16, 90), rtol=1e-6)
    assert np.allclose(mda.lib.mdamath.triclinic_vectors(universe.dimensions), TILTED, atol=1e-4)
    assert set(universe.atoms.types) == {"particles"}
    back = pg.Snapshot.from_mdanalysis(universe)
    assert np.allclose(back.box, TILTED, atol=1e-4)
    assert np.allclose(back.positions, ROWS, atol=1e-4)
    assert pg.Snapshot(ROWS).to_mdanalysis().dimensions is None
    turned = TILTED[:, [1, 2, 0]]
    with pytest.raises(pg.InputError, match="first vector of a box along x"):
        pg.Snapshot(ROWS, box=turned).to_mdanalysis()
