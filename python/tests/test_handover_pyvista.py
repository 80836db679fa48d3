"""PyVista: points, Gaussians and densities in VTK."""

import numpy as np
import pytest

import particlegs as pg

pyvista = pytest.importorskip("pyvista")

ROWS = np.random.default_rng(1).random((500, 3)).astype(np.float32) * 10


def test_points_go_and_come_back():
    masses = np.linspace(1, 2, 500)
    snap = pg.Snapshot(ROWS, units="nm", masses=masses, mass_units="Da", box=10)
    data = snap.to_pyvista()
    assert data.n_points == data.n_verts == 500
    assert np.array_equal(data.points, ROWS)
    assert data.points.dtype == np.float32
    assert np.allclose(data["mass"], masses, rtol=1e-6)
    assert set(data["layer"]) == {0}
    back = pg.Snapshot.from_pyvista(data, box=10)
    assert np.array_equal(back.positions, ROWS)
    assert np.allclose(back.masses, masses, rtol=1e-6)
    assert (back.length_unit, back.mass_unit) == ("nm", "Da")


def test_weights_by_name():
    data = pg.Snapshot(ROWS, weights=np.arange(1, 501)).to_pyvista()
    assert np.array_equal(pg.Snapshot.from_pyvista(data, weight_data="mass").weights, np.arange(1, 501))
    with pytest.raises(pg.InputError, match='no point data "charge": there are mass'):
        pg.Snapshot.from_pyvista(data, mass_data="charge")


def test_drawn_particles_stay_marked():
    model = pg.compress(ROWS, gaussians=20, certificate="none")
    assert "SYNTHETIC" in str(model.recover(100).to_pyvista().field_data["synthetic"][0])


def test_a_density_arrives():
    rho = pg.compress(pg.Snapshot(ROWS, units="nm", box=10), gaussians=20, certificate="none").density_grid(16)
    image = rho.to_pyvista()
    assert image.n_cells == 16**3
    assert np.allclose(image.bounds, (0, 10, 0, 10, 0, 10))
    assert str(image.field_data["density_unit"][0]) == "particles / nm^3"
    for cell in ((3, 1, 6), (0, 15, 7)):
        number = image.find_containing_cell((np.array(cell) + 0.5) * 10 / 16)
        assert image["density"][number] == rho[cell]
    sized = image.compute_cell_sizes(length=False, area=False)
    assert np.sum(sized["Volume"] * image["density"]) == pytest.approx(500, rel=1e-6)


def test_gaussians_arrive():
    model = pg.compress(pg.Snapshot(ROWS, masses=2.0), gaussians=20, certificate="none")
    data, g = model.gaussians.to_pyvista(), model.gaussians
    assert data.n_points == 20
    assert np.allclose(data.points, g.means)
    assert np.array_equal(data["count"], g.counts)
    assert data["mass"].sum() == pytest.approx(1000)
    axes = data["axes"].reshape(-1, 3, 3)
    assert np.allclose(axes @ axes, g.covariances, rtol=1e-9, atol=1e-12)
    assert np.array_equal(data["covariance"].reshape(-1, 3, 3), g.covariances)


def test_points_are_drawn(tmp_path):
    plotter = pyvista.Plotter(off_screen=True, window_size=(160, 90))
    plotter.set_background("black")
    plotter.add_mesh(pg.Snapshot(ROWS).to_pyvista(), style="points_gaussian", point_size=4, color="white")
    picture = plotter.screenshot(tmp_path / "points.png")
    assert picture.max() > 100
