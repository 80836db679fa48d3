"""Fields of particles in models."""

import subprocess

import numpy as np
import pytest

import particlegs as pg


def flow(n=4000):
    """Two clouds that fall towards each other along x, and their temperatures."""
    draw = np.random.default_rng(3)
    side = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    place = draw.normal(size=(n, 3)) * [0.5, 1.0, 0.7] + side[:, None] * [2.0, 0.0, 0.0]
    velocity = draw.normal(size=(n, 3)) * 10.0 + side[:, None] * [-150.0, 0.0, 0.0]
    return place.astype(np.float32), velocity, 1e4 * np.exp(0.1 * draw.normal(size=n)) * (2.0 + side)


@pytest.fixture(scope="module")
def model():
    place, velocity, temperature = flow()
    fields = {"velocity": velocity, "temperature": temperature}
    return pg.compress(pg.Snapshot(place), gaussians=40, certificate="none", fields=fields)


def test_fields_are_listed(model):
    assert list(model.fields) == ["velocity", "temperature"]
    assert model.fields["velocity"] == ("vector", None, "count")
    assert model.fields["temperature"].kind == "scalar"


def test_fields_at_points_follow_the_particles(model):
    velocity = model.at([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [100.0, 0.0, 0.0]], "velocity")
    assert velocity.shape == (3, 3)
    np.testing.assert_allclose(velocity[:2, 0], [-150.0, 150.0], atol=6.0)
    assert np.isnan(velocity[2]).all()
    assert model.at([[2.0, 0.0, 0.0]], "temperature") == pytest.approx([3e4], rel=0.05)
    dispersion = model.at([[2.0, 0.0, 0.0]], "dispersion.velocity")
    np.testing.assert_allclose(dispersion, 10.0, rtol=0.3)


def test_gaussians_have_moments_of_fields(model):
    gaussians, velocity = model.gaussians, model.gaussians.fields["velocity"]
    n = len(gaussians)
    assert [v.shape for v in velocity] == [(n, 3), (n, 3, 3), (n, 3, 3)]
    assert [v.shape for v in gaussians.fields["temperature"]] == [(n,), (n, 3), (n,)]
    np.testing.assert_allclose(np.average(velocity.means, axis=0, weights=gaussians.counts), flow()[1].mean(axis=0))


def test_maps_have_the_mean_along_the_line_of_sight(model):
    seen = model.map("velocity.x", center=[0.0, 0.0, 0.0], width=12.0, shape=(40, 60))
    assert seen.shape == (40, 60)
    assert seen[20, 40] == pytest.approx(-150.0, abs=8.0)
    assert seen[20, 20] == pytest.approx(150.0, abs=8.0)
    moving = model.map("velocity.x", center=[0.0, 0.0, 0.0], width=12.0, shape=(40, 60), bulk=[-150.0, 0.0, 0.0])
    np.testing.assert_allclose(moving, seen + 150.0, rtol=1e-5, atol=1e-3)
    along = model.map("velocity.los", center=[0.0, 0.0, 0.0], width=12.0, shape=(40, 40), axis="x", bulk="mean")
    assert np.nanmax(np.abs(along)) < 200.0


def test_grids_of_fields_keep_their_sums(model, tmp_path):
    rho, velocity = model.density_grid(32), model.grid("velocity", 32)
    assert velocity.shape == (*rho.shape, 3) and velocity.field == "velocity" and np.isnan(velocity.outside)
    points = np.array([velocity.origin]) + (np.argwhere(rho > 0.1 * rho.max()) + 0.5) * velocity.spacing
    inside = velocity[rho > 0.1 * rho.max()]
    np.testing.assert_allclose(inside, model.at(points, "velocity"), atol=20.0)
    sums = np.nansum(np.asarray(velocity) * np.asarray(rho)[..., None], axis=(0, 1, 2)) / rho.sum()
    own = model.recover(20_000).fields["velocity"].mean(axis=0)
    np.testing.assert_allclose(sums, own, atol=3.0)
    assert np.nanmin(model.grid("dispersion.temperature", 16)) >= 0
    with pytest.raises(pg.InputError, match="no field 'entropy'"):
        model.grid("entropy")
    assert model.export(tmp_path / "g.vti", cells=8, fields=["velocity"]) > 0
    with pytest.raises(pg.InputError, match=r"not to \.npy"):
        model.export(tmp_path / "g.npy", cells=8, fields=["velocity"])


def test_recovered_particles_have_fields(model, tmp_path):
    drawn = model.recover(seed=1)
    assert drawn.fields["velocity"].shape == (len(drawn), 3) and drawn.fields["temperature"].shape == (len(drawn),)
    right = drawn.positions[:, 0] > 1.0
    assert drawn.fields["velocity"][right, 0].mean() == pytest.approx(-150.0, abs=3.0)
    drawn.save(tmp_path / "drawn.hdf5")
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "drawn.hdf5") as file:
        group = file["PartType1"] if "PartType1" in file else file["PartType0"]
        np.testing.assert_allclose(group["Velocities"][:], drawn.fields["velocity"])


def test_units_of_arrays_are_kept():
    units = pytest.importorskip("astropy.units")
    place, velocity, _ = flow(500)
    made = pg.compress(place, gaussians=5, certificate="none", fields={"velocity": velocity * units.Unit("km/s")})
    assert made.fields["velocity"].unit == "km/s"
    assert made.map("velocity.los", width=10.0, shape=(8, 8)).unit == "km/s"


def test_wrong_fields_are_refused(model):
    place, velocity, temperature = flow(500)
    for fields, what in [
        ({"velocity": velocity[:10]}, "must have the shape"),
        ({"velocity": velocity[:, :2]}, "must have the shape"),
        ({"temperature": np.where(np.arange(500) == 7, np.nan, temperature)}, "particle 7 has the value NaN"),
    ]:
        with pytest.raises(pg.InputError, match=what):
            pg.compress(place, gaussians=5, certificate="none", fields=fields)
    with pytest.raises(pg.InputError, match="choose a component"):
        model.map("velocity")
    with pytest.raises(pg.InputError, match="no field"):
        model.at([[0.0, 0.0, 0.0]], "entropy")
    with pytest.raises(pg.InputError, match="bulk"):
        model.map("velocity.x", bulk="median")


def test_velocities_are_compared_with_a_models(model):
    place, velocity, _ = flow()
    options = {"spectrum_grid": 16, "centers": [[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]], "halo_radius": 1.0}
    measures = ["multipoles", "momentum", "dispersion"]
    found = pg.stats(pg.Snapshot(place), model, only=measures, velocities=(velocity, None), **options)
    assert found.data["dispersion"]["compared"] == 2
    assert found.summary["halo_dispersion"] == pytest.approx(1.0, abs=0.15)
    assert found.data["momentum"]["shells"][0]["r"] > 0.9
    assert found.data["multipoles"] is None
    assert any("the box is not periodic" in note for note in found.notes)
    without = pg.stats(pg.Snapshot(place), model, only=["momentum"])
    assert without.data["momentum"] is None and "the truth has no velocities" in without.notes[-1]


def test_a_map_is_drawn_on_its_scale(model):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib.colors import LogNorm, Normalize

    flow, heat = model.map("velocity.x", shape=(60, 40)), model.map("temperature", shape=(60, 40))
    assert (flow.scale, flow.title, heat.scale) == ("signed", "velocity along x", "linear")
    image = flow.plot()
    assert type(image.norm) is Normalize and image.norm.vmin == -image.norm.vmax
    np.testing.assert_array_equal(np.ma.getmaskarray(image.get_array()), np.isnan(flow))
    heat.scale = "log"
    assert isinstance(heat.plot(vmin=1e4).norm, LogNorm)
    with pytest.raises(pg.InputError, match="no field `dust` to weigh"):
        model.map("temperature", weight="dust")


def test_joint_histograms_compare_two_fields():
    place, _, temperature = flow(20_000)
    given = {"temperature": temperature, "metals": temperature**0.5}
    snap = pg.Snapshot(place)
    model = pg.compress(snap, gaussians=60, certificate="none", fields=given)
    found = pg.stats(snap, model, only=["joint"], joint_bins=10, fields=(given, None)).joint
    assert [j.fields for j in found] == [("temperature", "metals")]
    joint = found[0]
    assert joint.truth.shape == (10, 10) and joint.x.shape == (11,) and joint.truth.sum() == pytest.approx(1.0)
    assert joint.correlation[0] > 0.99 and joint.correlation[1] > 0.9 and 0.0 < joint.noise < 0.1
    edges = [joint.x, joint.y]
    plain = np.histogram2d(temperature, temperature**0.5, bins=edges)[0] / len(place)
    np.testing.assert_allclose(joint.truth, plain, atol=2e-4)
    recovered = pg.stats(model, model.recover(), only=["joint"], joint=["metals", "temperature"]).joint[0]
    assert recovered.fields == ("metals", "temperature") and recovered.difference < 2.0 * recovered.noise
    assert pg.stats(snap, model, only=["joint"]).joint == []
    with pytest.raises(pg.InputError, match="two different fields"):
        pg.stats(snap, model, only=["joint"], joint=["metals", "Metals"], fields=(given, None))


def test_fields_of_files_are_stored_by_name(command, tmp_path):
    rng = np.random.default_rng(4)
    rows = np.hstack([rng.normal(5, 1, (500, 3)), rng.normal(0, 3, (500, 3))])
    head = '500\nLattice="10 0 0 0 10 0 0 0 10" Properties=species:S:1:pos:R:3:velo:R:3\n'
    file = tmp_path / "in.xyz"
    file.write_text(head + "".join("A " + " ".join(f"{v:.5f}" for v in row) + "\n" for row in rows))
    snap = pg.open(file)
    model = pg.compress(snap, gaussians=20, fields=["velo"])
    options = ["--gaussians", "20", "--fields", "velo", "--quiet"]
    subprocess.run([command, "compress", file, "-o", tmp_path / "m.pgs", *options], check=True)
    assert model.to_bytes() == (tmp_path / "m.pgs").read_bytes() and list(model.fields) == ["velo"]
    assert np.allclose(model.at([[5.0, 5.0, 5.0]], "velo"), 0, atol=2)
    small = pg.compress(snap, size_total="2kB", fields="all", certificate="none")
    assert 1500 < len(small.to_bytes()) <= 2000
    for options, match in [
        ({"fields": ["heat"]}, "heat"),
        ({"size_total": "2kB"}, "no field is stored"),
        ({"size_total": "2kB", "size": "1kB", "fields": "all"}, "only one target"),
    ]:
        with pytest.raises(pg.InputError, match=match):
            pg.compress(snap, **options)
    with pytest.raises(pg.InputError, match="give arrays by name"):
        pg.compress(rows[:, :3], gaussians=5, fields=["velo"])
    file.write_text(head.replace("500", "1") + "A 1 2 3 4 5 6\n")
    with pytest.raises(pg.InputError, match="changed"):
        pg.compress(snap, gaussians=5, fields=["velo"])
