"""yt: particles and densities, there and back."""

import numpy as np
import pytest

import particlegs as pg

yt = pytest.importorskip("yt")
yt.set_log_level(50)

ROWS = np.random.default_rng(1).random((500, 3)) * 10
MASSES = np.linspace(1, 2, 500) * 1e10
SNAP = {"units": "Mpc", "masses": MASSES, "mass_units": "Msun", "box": [10, 10, 20]}


def in_order(ds, field, unit):
    """Values of a field in yt's order."""
    return np.sort(ds.all_data()["io", field].to_value(unit))


def test_particles_arrive():
    ds = pg.Snapshot(ROWS, **SNAP).to_yt()
    assert np.allclose(in_order(ds, "particle_position_x", "kpc"), np.sort(ROWS[:, 0]) * 1000, rtol=1e-6)
    assert np.allclose(in_order(ds, "particle_mass", "Msun"), MASSES, rtol=1e-6)
    assert np.allclose(ds.domain_width.to_value("Mpc"), [10, 10, 20])
    assert tuple(ds.periodicity) == (True, True, True)


def test_h_is_put_in():
    known = {"units": "Mpc/h", "masses": 2e10, "mass_units": "Msun/h", "box": 10}
    ds = pg.Snapshot(ROWS, hubble=0.5, **known).to_yt()
    assert np.allclose(ds.domain_width.to_value("Mpc"), 20)
    assert np.allclose(in_order(ds, "particle_mass", "Msun"), 4e10)
    assert np.allclose(pg.Snapshot(ROWS, **known).to_yt(hubble=0.5).domain_width.to_value("Mpc"), 20)
    with pytest.raises(pg.InputError, match="hubble="):
        pg.Snapshot(ROWS, **known).to_yt()
    with pytest.raises(pg.InputError, match="yt does not know"):
        pg.Snapshot(ROWS, units="sigma").to_yt()


def test_particles_outside_the_box_are_taken_in():
    ds = pg.Snapshot(ROWS - 1, units="kpc", box=10).to_yt()
    assert len(ds.all_data()["io", "particle_ones"]) == 500


def test_particles_without_a_box():
    ds = pg.Snapshot(ROWS).to_yt()
    assert len(ds.all_data()["io", "particle_ones"]) == 500
    assert tuple(ds.periodicity) == (False, False, False)


def test_particles_come_back():
    ds = pg.Snapshot(ROWS, **SNAP).to_yt()
    back = pg.Snapshot.from_yt(ds, units="Mpc")
    order, truth = np.lexsort(back.positions.T), np.lexsort(ROWS.T)
    assert np.allclose(back.positions[order], ROWS[truth], atol=1e-5)
    assert np.allclose(back.masses[order], MASSES[truth], rtol=1e-5)
    assert (back.length_unit, back.mass_unit) == ("Mpc", "Msun")
    assert np.allclose(np.diag(back.box), [10, 10, 20])
    assert back.periodic == (True, True, True)
    assert pg.Snapshot.from_yt(ds).length_unit in ("Mpc", "kpc")
    assert np.allclose(np.sort(pg.Snapshot.from_yt(ds, mass_units="kg").masses), MASSES * 1.98841e30, rtol=1e-4)
    assert pg.Snapshot.from_yt(ds, masses=None).masses is None


def test_a_part_comes_in():
    ds = pg.Snapshot(ROWS, **SNAP).to_yt()
    ball = ds.sphere(ds.arr([5, 5, 5], "Mpc"), (3, "Mpc"))
    part = pg.Snapshot.from_yt(ball, units="Mpc")
    distance = np.linalg.norm(ROWS - 5, axis=1)
    assert len(part) == np.sum(distance < 3)
    with pytest.raises(pg.InputError, match='no particles of the type "stars"'):
        pg.Snapshot.from_yt(ds, "stars")


def test_arrays_of_yt_come_in():
    ds = pg.Snapshot(ROWS, **SNAP).to_yt()
    data = ds.all_data()
    snap = pg.Snapshot(
        data["io", "particle_position"].to("Mpc"),
        masses=data["io", "particle_mass"].to("Msun"),
        box=ds.domain_width.to("kpc"),
    )
    assert (snap.length_unit, snap.mass_unit) == ("Mpc", "Msun")
    assert np.allclose(np.diag(snap.box), [10, 10, 20])


def test_a_density_arrives():
    model = pg.compress(
        pg.Snapshot(ROWS, units="Mpc/h", masses=2e10, mass_units="Msun/h", box=10, hubble=0.5),
        gaussians=30,
        certificate="none",
    )
    rho = model.density_grid(16)
    ds = rho.to_yt()
    data = ds.all_data()
    mass = (data["stream", "density"] * data["index", "cell_volume"]).sum()
    assert mass.to_value("Msun") == pytest.approx(500 * 4e10, rel=1e-6)
    i, j, k = np.unravel_index(np.argmax(rho), rho.shape)
    point = ds.arr((np.array([i, j, k]) + 0.5) / 16 * 20, "Mpc")
    assert ds.point(point)["stream", "density"].to_value("Msun/Mpc**3")[0] == pytest.approx(rho.max() * 0.5**2)
    assert tuple(ds.periodicity) == (True, True, True)


def test_numbers_arrive():
    rho = pg.compress(pg.Snapshot(ROWS, units="kpc", box=10), gaussians=30, certificate="none").density_grid(8)
    data = rho.to_yt().all_data()
    assert (data["stream", "number_density"] * data["index", "cell_volume"]).sum().to_value("") == pytest.approx(500)


def test_species_come_in():
    data = {}
    for kind, part in (("gas", slice(0, 200)), ("stars", slice(200, 500))):
        data.update({(kind, f"particle_position_{axis}"): ROWS[part, k] for k, axis in enumerate("xyz")})
        data[kind, "particle_mass"] = MASSES[part]
    ds = yt.load_particles(data, length_unit="Mpc", mass_unit="Msun", bbox=np.array([[0, 10]] * 3))
    snap = pg.Snapshot.from_yt(ds, units="Mpc")
    counts = {name: part.stop - part.start for name, part in snap.layers.items()}
    assert counts == {"gas": 200, "stars": 300}
    assert np.sum(snap.masses[snap.layers["stars"]]) == pytest.approx(MASSES[200:].sum(), rel=1e-6)
