"""Units of arrays are read, converted if they differ, and refused if they do not fit."""

import subprocess
import sys

import numpy as np
import pytest

import particlegs as pg
from particlegs import _units

ROWS = np.random.default_rng(1).random((500, 3)) * 10


def test_nothing_of_others_is_imported():
    others = ["yt", "pynbody", "swiftsimio", "pyvista", "MDAnalysis", "ase", "astropy", "unyt", "matplotlib", "tqdm"]
    script = f"import sys, particlegs; print([m for m in {others} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_a_package_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ase", None)
    with pytest.raises(ImportError, match="pip install ase"):
        pg.Snapshot(ROWS, units="Angstrom").to_ase()


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("Mpc / littleh", "Mpc/h"),
        ("Mpc a h**-1", "Mpc/h"),
        ("kpc a", "kpc"),
        ("Mpccm/h", "Mpc/h"),
        ("kpccm", "kpc"),
        ("solMass", "Msun"),
        ("Msol h**-1", "Msun/h"),
        ("cm", "cm"),
        ("angstrom", "Angstrom"),
        ("NoUnit()", None),
        ("dimensionless", None),
    ],
)
def test_names(theirs, ours):
    assert _units.text_of(theirs) == ours


def quantities():
    units = pytest.importorskip("astropy.units")
    return units, units.Quantity


def test_quantities_come_in():
    u, _ = quantities()
    snap = pg.Snapshot(ROWS * u.Mpc, masses=np.full(500, 2.0) * 1e10 * u.Msun, box=10_000 * u.kpc)
    assert snap.length_unit == "Mpc"
    assert snap.mass_unit == "Msun"
    assert snap.masses == pytest.approx(2e10)
    assert np.allclose(snap.box, 10 * np.eye(3))
    assert np.allclose(snap.positions, ROWS, atol=1e-6)


def test_float32_quantities_are_used_where_they_lie():
    u, quantity = quantities()
    rows = ROWS.astype(np.float32)
    snap = pg.Snapshot(quantity(rows, u.Mpc, copy=False), box=10 * u.Mpc)
    assert np.shares_memory(snap.positions, rows)


def test_columns_of_quantities_and_the_unit_asked_for():
    u, _ = quantities()
    columns = [ROWS[:, 0] * u.Mpc, ROWS[:, 1] * 1000 * u.kpc, ROWS[:, 2] * u.Mpc]
    snap = pg.Snapshot(columns, units="kpc", box=10 * u.Mpc, origin=(0, 0, 0) * u.Mpc)
    assert snap.length_unit == "kpc"
    assert np.allclose(snap.positions, ROWS * 1000, rtol=1e-6)
    assert np.allclose(snap.box, 10_000 * np.eye(3))


def test_chunks_in_the_unit_asked_for():
    u, _ = quantities()
    snap = pg.Snapshot.from_chunks((ROWS[i : i + 100] * u.Mpc for i in range(0, 500, 100)), units="kpc", box=10 * u.Mpc)
    assert np.allclose(snap.positions, ROWS * 1000, rtol=1e-6)
    assert np.allclose(snap.box, 10_000 * np.eye(3))
    with pytest.raises(pg.InputError, match="state by units="):
        pg.Snapshot.from_chunks([ROWS * u.Mpc])


def test_masses_in_the_unit_asked_for():
    u, _ = quantities()
    snap = pg.Snapshot(ROWS, masses=3.0 * u.kg, mass_units="g")
    assert (snap.masses[0], snap.mass_unit) == (3000.0, "g")
    scaled = pg.Snapshot(ROWS, masses=3.0 * u.Unit("1e10 Msun"))
    assert scaled.masses == pytest.approx(3e10)
    assert scaled.mass_unit == "Msun"


def test_units_that_do_not_fit_are_refused():
    u, _ = quantities()
    for known in (
        {"box": 10 * u.s},
        {"box": 10 * u.Mpc, "units": "Mpc/h"},
        {"masses": 1 * u.Mpc, "mass_units": "Msun"},
        {"units": "furlongs"},
    ):
        with pytest.raises(pg.InputError, match="cannot be converted to"):
            pg.Snapshot(ROWS * u.Mpc, **known)
    with pytest.raises(pg.InputError, match="state it by units="):
        pg.Snapshot(ROWS, box=10 * u.Mpc)
    with pytest.raises(pg.InputError, match="state it by units="):
        pg.Snapshot([ROWS[:, 0], ROWS[:, 1] * u.Mpc, ROWS[:, 2]])


def test_what_a_model_is_asked_for_in_units():
    u, _ = quantities()
    model = pg.compress(pg.Snapshot(ROWS, units="Mpc", box=10), gaussians=20, certificate="none")
    point = [[5.0, 5.0, 5.0]]
    assert model.at(point * u.Mpc) == model.at(point)
    assert model.at(np.array(point) * 1000 * u.kpc) == pytest.approx(model.at(point))
    window = model.density_map(center=(5000, 5000, 5000) * u.kpc, width=4 * u.Mpc, depth=2000 * u.kpc, shape=(16, 16))
    plain = model.density_map(center=(5, 5, 5), width=4, depth=2, shape=(16, 16))
    assert window.extent == plain.extent
    assert np.allclose(window, plain)
    size = {"size": (32, 18)}
    assert np.array_equal(model.render(width=5000 * u.kpc, **size), model.render(width=5, **size))
    assert np.array_equal(model.render(radius=100 * u.kpc, **size), model.render(radius=0.1, **size))
    for asked in ({"width": 4 * u.s}, {"center": (1, 2, 3) * u.kg}):
        with pytest.raises(pg.InputError):
            model.render(**asked, **size)


def test_densities_go_out_as_quantities():
    u, _ = quantities()
    cosmology = pytest.importorskip("astropy.cosmology.units")
    snap = pg.Snapshot(ROWS, units="Mpc/h", masses=2.0, mass_units="Msun/h", box=10)
    model = pg.compress(snap, gaussians=20, certificate="none")
    sigma = model.density_map(shape=(32, 32)).to_astropy()
    cell = (10 * u.Mpc / cosmology.littleh / 32) ** 2
    assert (sigma.sum() * cell).to_value(u.Msun / cosmology.littleh) == pytest.approx(1000, rel=1e-4)
    rho = model.density_grid(16).to_astropy()
    assert rho.unit == u.Msun * cosmology.littleh**2 / u.Mpc**3
    assert rho.shape == (16, 16, 16)
    counts = pg.compress(pg.Snapshot(ROWS, units="nm", box=10), gaussians=20, certificate="none")
    assert counts.density_grid(8).to_astropy().unit == u.nm**-3
    bare = pg.compress(pg.Snapshot(ROWS, box=10), gaussians=20, certificate="none")
    strange = pg.compress(pg.Snapshot(ROWS, units="sigma", box=10), gaussians=20, certificate="none")
    for model in (bare, strange):
        with pytest.raises(pg.InputError):
            model.density_grid(8).to_astropy()


def test_particles_go_out_as_a_table_and_come_back():
    u, _ = quantities()
    masses = np.linspace(1, 2, 500)
    snap = pg.Snapshot(ROWS, units="kpc", masses=masses, mass_units="Msun", box=10, scale_factor=0.5, name="halo")
    table = snap.to_astropy()
    assert table["position"].unit == u.kpc
    assert table["mass"].unit == u.Msun
    assert table.meta["scale_factor"] == 0.5
    back = pg.Snapshot(table["position"], masses=table["mass"], box=table.meta["box"])
    assert np.allclose(back.positions, ROWS, atol=1e-6)
    assert np.allclose(back.masses, masses, rtol=1e-6)
    assert (back.length_unit, back.mass_unit) == ("kpc", "Msun")
    assert np.array_equal(back.box, snap.box)


@pytest.fixture
def gadget(tmp_path):
    """A file in kpc/h and 1e10 Msun/h with two species, and its mass in Msun."""
    masses = np.concatenate([np.full(200, 0.25), np.linspace(1, 2, 300)]).astype(np.float32)
    known = {
        "units": "kpc/h",
        "mass_units": "1e10 Msun/h",
        "box": 10,
        "comoving": True,
        "layers": {"gas": 200, "dm": 300},
    }
    snap = pg.Snapshot(ROWS, masses=masses, hubble=0.7, scale_factor=0.5, **known)
    snap.save(tmp_path / "snap.hdf5")
    return tmp_path / "snap.hdf5", masses.sum(dtype=np.float64) * 1e10 / 0.7


def test_masses_by_h_and_powers_of_ten_arrive(gadget, tmp_path):
    path, mass = gadget
    snap = pg.open(path)
    assert (snap.length_unit, snap.mass_unit) == ("kpc/h", "1e10 Msun/h")
    table = snap.to_astropy()
    table.write(tmp_path / "particles.fits")
    fits = type(table).read(tmp_path / "particles.fits")
    assert fits["mass"].sum().to_value("Msun") == pytest.approx(mass, rel=1e-6)
    assert fits["position"].max().to_value("kpc") == pytest.approx(snap.positions.max() / 0.7)
    yt = pytest.importorskip("yt")
    yt.set_log_level(50)
    ds = snap.to_yt()
    assert float(ds.all_data()["all", "particle_mass"].sum().to("Msun")) == pytest.approx(mass, rel=1e-6)
    data = snap.to_swiftsimio(tmp_path / "swift.hdf5")
    assert float(data.dark_matter.masses.sum().to_value("Msun")) == pytest.approx(mass, rel=1e-6)
    pytest.importorskip("pynbody")
    sim = snap.to_pynbody()
    assert float(sim["mass"].sum().in_units("Msol", **sim.conversion_context())) == pytest.approx(mass, rel=1e-6)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("Mpc", 1e-3 / 0.7), ("kpccm/h", 1.0), ("physical kpc", 0.5 / 0.7), ("10 kpc/h", 0.1)],
)
def test_files_are_converted_to_the_units_that_are_asked_for(gadget, unit, factor):
    path, mass = gadget
    own, snap = pg.open(path), pg.open(path, units=unit, mass_units="Msun")
    assert snap.length_unit == unit
    assert np.allclose(snap.positions, own.positions * factor, rtol=1e-6)
    assert np.allclose(snap.box, own.box * factor)
    assert np.sum(snap.masses) == pytest.approx(mass, rel=1e-6)
    sigma = pg.compress(snap, gaussians=20, certificate="none").density_map(shape=(32, 32))
    assert sigma.sum() * sigma.pixel_area == pytest.approx(mass, rel=1e-4)
    with pytest.raises(pg.InputError, match="kpc/h cannot be converted to furlong"):
        pg.open(path, units="furlong")


def test_notes_are_warnings(tmp_path):
    np.save(tmp_path / "p.npy", ROWS.astype(np.float32))
    truth = pg.Snapshot(ROWS, units="kpc", box=10)
    other = pg.open(tmp_path / "p.npy", units="no unit at all")
    with pytest.warns(UserWarning, match="is not a known unit of length") as caught:
        pg.open(tmp_path / "p.npy", units="no unit at all")
    assert caught[0].filename == __file__
    with pytest.raises(pg.InputError, match="no unit at all cannot be converted to kpc"):
        pg.stats(truth, other, only=["moments"])


def test_statistics_are_in_the_units_of_the_truth():
    asked = {"only": ["density"], "grid": 8}
    truth, scaled = pg.Snapshot(ROWS, units="Mpc", box=10), pg.Snapshot(ROWS / 1024, units="1024 Mpc", box=10 / 1024)
    found, own = pg.stats(truth, scaled, **asked), pg.stats(truth, truth, **asked)
    assert found.data["density"] == own.data["density"]
    assert "converted from 1024 Mpc to Mpc" in str(found.notes)
    with pytest.raises(pg.InputError, match="its box is"):
        pg.stats(truth, pg.Snapshot(ROWS, units="kpc", box=10), **asked)


def test_comoving_units_of_arrays_are_known():
    yt = pytest.importorskip("unyt")
    registry = yt.UnitRegistry()
    registry.add("Mpccm", 3.0856775e22 * 0.5, yt.dimensions.length)
    snap = pg.Snapshot(yt.unyt_array(ROWS, "Mpccm", registry=registry))
    assert snap.metadata["comoving"] is True


def test_grams_fit():
    u, _ = quantities()
    masses = np.linspace(1, 2, 500).astype(np.float32) * u.Unit("1.989e43 g")
    snap = pg.Snapshot(ROWS, masses=masses)
    assert snap.mass_unit == "g"
    assert np.allclose(snap.masses, np.linspace(1, 2, 500) * 1.989e43)
