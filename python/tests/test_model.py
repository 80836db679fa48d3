"""Results of a model: pictures, densities, particles, statistics and the notebook display."""

import pickle
import re

import numpy as np
import pytest

import particlegs as pg


def test_it_says_what_it_is(model):
    assert model.count == 262_144 and model.law == "optical-depth" and 60 < model.ratio < 70
    assert model.nbytes == len(model.to_bytes()) and model.length_unit == "Mpc/h"
    assert np.allclose(model.box, 25 * np.eye(3)) and model.periodic == (True,) * 3
    assert "pictures: " in model.verdict and model.certificate["density"]["correlation"] > 0.5
    assert "262144 particles" in repr(model)


def test_files(model, tmp_path):
    model.save(tmp_path / "m.pgs")
    again = pg.read(tmp_path / "m.pgs")
    assert again.name == "m.pgs" and again.to_bytes() == model.to_bytes()
    assert pickle.loads(pickle.dumps(model)).to_bytes() == model.to_bytes()
    assert pg.read(model.to_bytes()).count == model.count


def test_pictures(model):
    shape = {"size": (160, 90)}
    picture = model.render(20, 10, **shape)
    assert picture.shape == (90, 160) and picture.dtype == np.uint8 and picture.max() > 50
    bright = model.render(20, 10, style="expected", **shape)
    assert bright.dtype == np.float32 and bright.min() >= 0 and 0.1 < bright.max() <= 1
    density = model.render(20, 10, style="density", **shape)
    assert density.dtype == np.float64 and density.extent is None and density.unit.endswith("(Mpc/h)^2")
    more = model.render(20, 10, style="expected", opacity=0.2, **shape)
    assert more.mean() > bright.mean()
    camera = pg.Camera((12.5, 12.5, 80), (12.5, 12.5, 12.5), fov_deg=30)
    assert model.render(camera=camera, **shape).shape == (90, 160)
    assert np.array_equal(model.render(camera=pg.Camera.around(model.bounds, 20, 10), **shape), picture)
    assert model.render(width=10, depth=5, **shape).sum() < model.render(width=10, **shape).sum()


def test_the_truth_is_near(snap, model):
    view = {"azimuth": 30, "elevation": 20, "size": (320, 180), "style": "expected"}
    truth, ours = snap.render(**view), model.render(**view)
    assert np.corrcoef(truth.ravel(), ours.ravel())[0, 1] > 0.95


def test_maps_hold_the_mass(model):
    mass = model.mass or model.count
    for axis, names in (("z", ("x", "y")), ("y", ("x", "z")), ("x", ("y", "z"))):
        sigma = model.density_map(axis=axis, shape=(128, 128))
        assert sigma.axes == names and sigma.dtype == np.float64
        assert np.allclose(sigma.extent, (0, 25, 0, 25), atol=1e-6)
        assert np.isclose(sigma.sum() * (25 / 128) ** 2, mass, rtol=1e-5)
        wide = model.density_map(axis=axis, shape=(90, 160))
        assert np.isclose(wide.sum() * wide.pixel_area, mass, rtol=1e-5)
    part = model.density_map(center=(5, 5, 5), width=10, depth=10, shape=(50, 100))
    assert part.extent == (0, 10, 2.5, 7.5)


@pytest.mark.parametrize("sides", [(1, 1, 1), (2, 1, 0.5), (4, 2, 1)])
def test_maps_of_boxes_of_any_shape_hold_the_mass(sides):
    rows = np.random.default_rng(4).random((2000, 3)) * sides
    model = pg.compress(pg.Snapshot(rows, box=sides), gaussians=60, certificate="none")
    for axis in "xyz":
        for shape in ((64, 64), (90, 160)):
            sigma = model.density_map(axis=axis, shape=shape)
            assert np.isclose(sigma.sum() * sigma.pixel_area, 2000, rtol=1e-5), (axis, shape)


def test_pixels_have_an_area(model):
    sigma = model.density_map(width=10, shape=(20, 40))
    assert sigma.pixel_area == pytest.approx((10 / 40) ** 2)
    with pytest.raises(ValueError):
        _ = model.render(style="density", size=(16, 9)).pixel_area


def test_the_verdict_speaks_of_arguments(model):
    assert {f["word"] for f in model.findings} <= {"good", "fair", "poor", "not measured"}
    assert "not measured" in model.verdict
    assert "--" not in model.verdict


def test_maps_lie_the_right_way_round():
    # One clump at the upper right of the xy plane, another at small x.
    rng = np.random.default_rng(1)
    rows = np.concatenate([rng.normal([8, 9, 2], 0.1, (1000, 3)), rng.normal([1, 5, 5], 0.1, (500, 3))])
    model = pg.compress(pg.Snapshot(rows, box=10), gaussians=50, certificate="none")
    brightest = {"z": (8, 9), "y": (8, 2), "x": (9, 2)}
    for axis, (across, up) in brightest.items():
        sigma = model.density_map(axis=axis, shape=(100, 100))
        row, column = np.unravel_index(np.argmax(sigma), sigma.shape)
        assert abs((column + 0.5) / 10 - across) < 0.3 and abs(10 - (row + 0.5) / 10 - up) < 0.3, axis


def test_maps_behave_as_arrays(model):
    sigma = model.density_map(shape=(8, 16))
    assert (2 * sigma).unit == sigma.unit and np.log10(sigma).extent == sigma.extent
    assert type(sigma.sum()) is np.float64 and type(sigma[0]) is np.ndarray and type(sigma[:2]) is np.ndarray
    assert type(sigma.mean(axis=0)) is np.ndarray
    again = pickle.loads(pickle.dumps(sigma))
    assert again.extent == sigma.extent and np.array_equal(again, sigma)


def test_the_grid_sums_to_the_mass(model):
    mass = model.mass or model.count
    for cells in (16, 64):
        rho = model.density_grid(cells)
        assert rho.shape == (cells,) * 3 and rho.dtype == np.float64 and rho.spacing == (25 / cells,) * 3
        assert abs(rho.sum() * rho.cell_volume / mass - 1) < 1e-6 and rho.outside == 0
    open_one = pg.compress(np.random.default_rng(1).normal(size=(3000, 3)), gaussians=30, certificate="none")
    rho = open_one.density_grid(32)
    assert abs((rho.sum() * rho.cell_volume + rho.outside) / 3000 - 1) < 1e-6


def test_cells_along_each_axis(model):
    rho = model.density_grid((8, 16, 32))
    assert rho.shape == (8, 16, 32) and np.allclose(rho.spacing, (25 / 8, 25 / 16, 25 / 32))
    fine = model.density_grid(32)
    assert np.allclose(fine.reshape(8, 4, 16, 2, 32).mean(axis=(1, 3)), rho, rtol=1e-3, atol=0.01 * rho.mean())
    for wrong in ((8, 0, 8), (8, 8), 1.5, -1, "many"):
        with pytest.raises(pg.InputError, match="cells must be"):
            model.density_grid(wrong)
    with pytest.raises(pg.InputError, match="cells per edge"):
        model.density_grid((8, 8, 65_537))


def test_the_grid_is_the_average_of_points(model):
    rho = model.density_grid(8)
    rng = np.random.default_rng(4)
    cell = np.array([3, 1, 6])
    points = (cell + rng.random((20_000, 3))) * rho.spacing + rho.origin
    values = model.at(points)
    error = values.std() / np.sqrt(len(values))
    assert abs(values.mean() - rho[tuple(cell)]) < 5 * error


def test_density_at_points_is_the_sum_of_the_gaussians(model):
    g = model.gaussians
    point = g.means[10] + 0.01
    d = point - g.means
    d -= 25 * np.round(d / 25)
    inverse = np.linalg.inv(g.covariances)
    peak = g.counts / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(g.covariances))
    weight = g.masses / g.counts if g.masses is not None else 1.0
    expected = np.sum(weight * peak * np.exp(-0.5 * np.einsum("ni,nij,nj->n", d, inverse, d)))
    assert np.isclose(model.at(point)[0], expected, rtol=1e-4)
    assert model.at(np.zeros((0, 3))).shape == (0,)


def test_particles_come_back_and_are_marked(model):
    parts = model.recover()
    assert len(parts) == 262_144 and parts.synthetic and "SYNTHETIC" in parts.notes["synthetic"]
    assert parts.positions.min() >= 0 and parts.positions.max() <= 25 and np.allclose(parts.box, model.box)
    few = model.recover(1000, "spaced", seed=1)
    assert len(few) == 1000 and not np.array_equal(few.positions, model.recover(1000, "spaced", seed=2).positions)
    assert "synthetic" in repr(parts)


def test_statistics(snap, model):
    found = pg.stats(snap, model, only=["spectrum", "likelihood", "density"], grid=32, spectrum_grid=64)
    assert np.all(np.diff(found.power.k) > 0) and abs(found.power.ratio[0] - 1) < 0.01
    assert found.likelihood.bits > 3 and found.summary["density_correlation"] > 0.9 and found.xi is None
    both = pg.stats(snap, model.recover(), only=["groups", "pairs", "rdf"], pairs=1_000_000)
    assert both.groups.truth.sum() > 100 and len(both.xi.r) == len(both.xi.truth) == len(both.xi.edges) - 1
    assert len(both.rdf.r) == 200 and "groups" in repr(both)
    assert len(found.notes) > 0


def test_plots(snap, model, tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = pg.stats(snap, model, only=["spectrum"], spectrum_grid=64)
    figure = found.plot()
    figure.savefig(tmp_path / "stats.png")
    assert [axis.get_xlabel() for axis in figure.axes][1] == "k (h/Mpc)"
    sigma = model.density_map(shape=(64, 64))
    _, ax = plt.subplots()
    image = sigma.plot(ax)
    assert image.get_extent() == list(sigma.extent) and ax.get_xlabel() == "x (Mpc/h)"
    with pytest.raises(ValueError):
        pg.stats(snap, model, only=["moments"]).plot()
    # Empty pixels have their own colour and do not affect the range.
    sigma[:, :8] = 0
    image = sigma.plot(ax)
    low, high = image.get_clim()
    occupied = np.asarray(sigma)[np.asarray(sigma) > 0]
    assert (occupied < low).mean() <= 0.05 and abs((occupied > high).mean() - 0.005) < 0.005
    empty, lowest = image.to_rgba(np.ma.masked_equal([0.0, low], 0))
    assert np.abs(empty - lowest).max() > 0.2
    plt.close("all")


def test_what_a_notebook_shows(model, tmp_path):
    shown = model._repr_mimebundle_()
    assert shown["text/plain"] == repr(model)
    assert "data:image/png;base64," in shown["text/html"] and "262,144" in shown["text/html"]
    view = model.view(height=400)
    cell = view._repr_html_()
    assert cell.startswith("<iframe") and "height:400px" in cell and len(re.findall("<iframe", cell)) == 1
    view.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text().startswith("<!doctype html>")
    with pytest.raises(FileExistsError):
        view.save(tmp_path / "page.html")


def test_units_are_those_of_the_layers_that_count(tmp_path):
    for name in ("xx", "yy", "zz"):
        np.random.default_rng(ord(name[0])).random(3000, dtype=np.float32).tofile(tmp_path / f"{name}.f32")
    layers = '[{"name": "dm", "particles": 2000, "particle_mass": 2.0}, {"name": "tracers", "particles": 1000}]'
    (tmp_path / "meta.json").write_text(f'{{"layers": {layers}}}')
    model = pg.compress(pg.open(tmp_path, units="kpc", mass_units="Msun"), gaussians=40, certificate="none")
    assert model.density_map(shape=(4, 4), layers=["dm"]).unit == "Msun / kpc^2"
    assert model.density_grid(4, layers=["tracers"]).unit == "particles / kpc^3"
    with pytest.raises(pg.InputError, match="so they cannot be added; choose only layers"):
        model.density_grid(4)


def test_several_layers(tmp_path):
    rng = np.random.default_rng(6)
    for name in ("xx", "yy", "zz"):
        rng.random(3000, dtype=np.float32).tofile(tmp_path / f"{name}.f32")
    (tmp_path / "meta.json").write_text(
        '{"layers": [{"name": "dm", "particles": 2000, "particle_mass": 2.0},'
        ' {"name": "gas", "particles": 1000, "particle_mass": 1.0}]}'
    )
    snap = pg.open(tmp_path)
    assert list(snap.layers) == ["dm", "gas"], snap.layers
    model = pg.compress(snap, gaussians=40, certificate="none")
    assert [layer["name"] for layer in model.layers] == ["dm", "gas"] and model.mass == 5000
    gas = model.density_grid(8, layers=["gas"])
    assert abs((gas.sum() * gas.cell_volume + gas.outside) / 1000 - 1) < 1e-6
    assert list(model.gaussians.layers) == ["dm", "gas"]
    whole, part = (
        model.render(style="expected", size=(64, 36)),
        model.render(style="expected", size=(64, 36), layers=["gas"]),
    )
    assert part.sum() < whole.sum()
