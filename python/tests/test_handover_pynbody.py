"""pynbody: particles there and back."""

import numpy as np
import pytest

import particlegs as pg

pynbody = pytest.importorskip("pynbody")

ROWS = np.random.default_rng(1).random((500, 3)) * 10
MASSES = np.linspace(1, 2, 500)


def test_particles_go_and_come_back():
    snap = pg.Snapshot(
        ROWS, units="Mpc/h", masses=MASSES, mass_units="Msun/h", box=10, comoving=True, scale_factor=0.5, hubble=0.7
    )
    sim = snap.to_pynbody()
    assert len(sim.dm) == 500
    assert np.allclose(sim["pos"].in_units("kpc", **sim.conversion_context()), ROWS * 1000 * 0.5 / 0.7, rtol=1e-5)
    assert np.allclose(sim["mass"].in_units("Msol", **sim.conversion_context()), MASSES / 0.7, rtol=1e-5)
    assert sim.properties["boxsize"].in_units("Mpc a h**-1") == pytest.approx(10)
    back = pg.Snapshot.from_pynbody(sim)
    assert np.allclose(back.positions, ROWS, atol=1e-5)
    assert np.allclose(back.masses, MASSES, rtol=1e-6)
    assert np.allclose(back.box, snap.box)
    assert (back.length_unit, back.mass_unit) == ("Mpc/h", "Msun/h")
    said = ("comoving", "scale_factor", "hubble")
    assert [back.metadata[key] for key in said] == [True, 0.5, 0.7]


def test_powers_of_ten_are_taken_out():
    sim = pynbody.new(gas=500)
    sim["pos"] = pynbody.array.SimArray(ROWS, "kpc")
    sim["mass"] = pynbody.array.SimArray(MASSES, "1e10 Msol h**-1")
    snap = pg.Snapshot.from_pynbody(sim.gas)
    assert (snap.length_unit, snap.mass_unit) == ("kpc", "Msun/h")
    assert np.allclose(snap.masses, MASSES * 1e10, rtol=1e-6)
    assert snap.box is None
    assert snap.metadata["comoving"] is False


def test_a_wrapped_box_begins_at_minus_half():
    sim = pg.Snapshot(ROWS - 5, units="kpc", box=10, origin=(-5, -5, -5)).to_pynbody("star")
    assert len(sim.star) == 500
    assert np.allclose(pg.Snapshot.from_pynbody(sim).origin, -5)


def test_arrays_of_pynbody_come_in():
    positions = pynbody.array.SimArray(ROWS, "Mpc")
    snap = pg.Snapshot(positions, box=pynbody.array.SimArray([10_000.0] * 3, "kpc"))
    assert snap.length_unit == "Mpc"
    assert np.allclose(snap.box, 10 * np.eye(3))


def test_units_that_are_asked_for():
    sim = pg.Snapshot(ROWS, units="kpc", box=10, masses=2.0, mass_units="Msun").to_pynbody()
    snap = pg.Snapshot.from_pynbody(sim, units="Mpc", mass_units="kg")
    assert np.allclose(snap.positions, ROWS / 1000, rtol=1e-6)
    assert np.allclose(snap.box, 0.01 * np.eye(3))
    assert snap.masses == pytest.approx(2 * 1.98841e30, rel=1e-3)
    with pytest.raises(pg.InputError, match="cannot be converted"):
        pg.Snapshot.from_pynbody(sim, units="kg")


def test_what_pynbody_does_not_know():
    for box in ([10, 10, 20], [10, 10, 10, 90, 90, 60]):
        with pytest.raises(pg.InputError):
            pg.Snapshot(ROWS, box=box).to_pynbody()
    bare = pg.Snapshot(ROWS, weights=MASSES).to_pynbody()
    assert np.allclose(bare["mass"], MASSES)
    assert pg.Snapshot.from_pynbody(bare).length_unit is None


def test_files_that_state_their_units_come_in(tmp_path):
    known = {
        "units": "kpc/h",
        "mass_units": "1e10 Msun/h",
        "box": 10,
        "comoving": True,
        "scale_factor": 0.5,
        "hubble": 0.7,
    }
    snap = pg.Snapshot(ROWS, masses=MASSES, layers={"gas": 100, "stars": 400}, **known)
    snap.save(tmp_path / "snap.hdf5")
    sim = pynbody.load(str(tmp_path / "snap.hdf5"))
    # pynbody has 1.989e43 g and 3.086e21 cm.
    assert "g h" in str(sim["mass"].units)
    back = pg.Snapshot.from_pynbody(sim)
    assert (back.length_unit, back.mass_unit) == ("kpc/h", "Msun/h")
    assert np.sum(back.masses) == pytest.approx(MASSES.sum() * 1e10, rel=1e-6)
    assert np.allclose(back.box, snap.box)


@pytest.mark.parametrize(
    ("unit", "scale"), [("1.989e43 g", 1e10), ("1e10 Msol", 1e10), ("2e33 g", 2e33), ("5.5e40 kg", 5.5e40)]
)
def test_masses_beyond_float32_come_in(unit, scale):
    sim = pynbody.new(dm=500)
    sim["pos"] = pynbody.array.SimArray(ROWS.astype(np.float32), "3.085678e24 cm")
    sim["mass"] = pynbody.array.SimArray(MASSES.astype(np.float32), unit)
    snap = pg.Snapshot.from_pynbody(sim)
    assert snap.length_unit == "Mpc"
    assert np.sum(snap.masses) == pytest.approx(MASSES.sum() * scale, rel=1e-6)


def test_species_survive():
    layers = {"gas": 100, "dm": 250, "stars": 50, "others": 100}
    snap = pg.Snapshot(ROWS, masses=MASSES, layers=layers, units="kpc", mass_units="Msun")
    sim = snap.to_pynbody()
    assert {f.name: len(sim[f]) for f in sim.families()} == {"gas": 100, "dm": 350, "star": 50}
    assert np.allclose(sim.star["mass"], MASSES[350:400])
    back = pg.Snapshot.from_pynbody(sim)
    assert {name: part.stop - part.start for name, part in back.layers.items()} == {"dm": 350, "star": 50, "gas": 100}
    assert np.allclose(np.sort(back.masses), MASSES, rtol=1e-6)
    assert len(snap.to_pynbody("bh").bh) == 500
    with pytest.raises(pg.InputError, match="the layers have 3 particles in all, but there are 500"):
        pg.Snapshot(ROWS, layers={"gas": 3})
