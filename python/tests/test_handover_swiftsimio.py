"""swiftsimio: SWIFT files that it can open, and its arrays."""

import numpy as np
import pytest

import particlegs as pg

swiftsimio = pytest.importorskip("swiftsimio")
unyt = pytest.importorskip("unyt")

ROWS = np.random.default_rng(1).random((500, 3)) * 10
MASSES = np.linspace(1, 2, 500) * 1e10


@pytest.fixture
def snap():
    return pg.Snapshot(
        ROWS, units="Mpc/h", masses=MASSES, mass_units="Msun/h", box=10, comoving=True, scale_factor=0.5, hubble=0.5
    )


def test_a_file_goes_and_comes_back(snap, tmp_path):
    path = tmp_path / "swift.hdf5"
    data = snap.to_swiftsimio(path)
    assert [p.name for p in tmp_path.iterdir()] == ["swift.hdf5"]
    coordinates = data.dark_matter.coordinates
    assert coordinates.comoving
    assert np.allclose(coordinates.to_value("Mpc"), ROWS * 2, rtol=1e-5)
    assert np.allclose(coordinates.to_physical().to_value("Mpc"), ROWS, rtol=1e-5)
    assert np.allclose(data.dark_matter.masses.to_value("Msun"), MASSES * 2, rtol=1e-5)
    assert np.allclose(data.metadata.boxsize.to_value("Mpc"), 20)
    back = pg.Snapshot.from_swiftsimio(data)
    assert np.allclose(back.positions, ROWS * 2, rtol=1e-5, atol=1e-5)
    assert np.allclose(back.masses, MASSES * 2, rtol=1e-5)
    assert np.allclose(back.box, 20 * np.eye(3))
    assert (back.length_unit, back.mass_unit, back.name) == ("Mpc", "Msun", "swift.hdf5")
    assert (back.metadata["comoving"], back.metadata["scale_factor"]) == (True, 0.5)
    # particlegs reads the same file.
    own = pg.open(path, species="dm", units="kpc")
    assert len(own) == 500


def test_its_arrays_come_in(snap, tmp_path):
    data = snap.to_swiftsimio(tmp_path / "swift.hdf5")
    part = data.dark_matter
    taken = pg.Snapshot(part.coordinates, masses=part.masses, box=data.metadata.boxsize.to("kpc"))
    assert taken.length_unit == str(part.coordinates.units)
    scale = unyt.unyt_quantity(1.0, taken.length_unit).to_value("Mpc")
    assert np.allclose(np.diag(taken.box) * scale, 20)
    assert np.allclose(taken.positions * scale, ROWS * 2, rtol=1e-5, atol=1e-5)
    assert taken.mass_unit == "Msun"
    assert np.allclose(taken.masses, MASSES * 2, rtol=1e-5)
    assert (taken.metadata["comoving"], taken.metadata["scale_factor"]) == (True, 0.5)
    with pytest.raises(pg.InputError, match="convert one of them"):
        pg.Snapshot(part.coordinates, box=data.metadata.boxsize.to_physical())


def test_what_a_file_takes(snap, tmp_path):
    path = tmp_path / "swift.hdf5"
    path.write_bytes(b"mine")
    with pytest.raises(FileExistsError):
        snap.to_swiftsimio(path)
    assert path.read_bytes() == b"mine"
    snap.to_swiftsimio(path, overwrite=True)
    known = {"units": "Mpc", "masses": 1.0, "mass_units": "Msun", "box": 10}
    for left_out in known:
        with pytest.raises(pg.InputError):
            pg.Snapshot(ROWS, **{k: v for k, v in known.items() if k != left_out}).to_swiftsimio(tmp_path / "no.hdf5")
    with pytest.raises(pg.InputError, match="converted"):
        pg.Snapshot(ROWS, **{**known, "mass_units": "Mpc"}).to_swiftsimio(tmp_path / "no.hdf5")
    assert not (tmp_path / "no.hdf5").exists()
