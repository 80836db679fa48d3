"""Invalid input raises the right exception with one line of text, and nothing is written."""

import io

import numpy as np
import pytest

import particlegs as pg

GOOD = np.random.default_rng(3).random((2000, 3)).astype(np.float32)


def with_nan():
    bad = GOOD.copy()
    bad[7, 1] = np.nan
    return bad


@pytest.mark.parametrize(
    ("given", "kind"),
    {
        "none": (np.zeros((0, 3), np.float32), pg.InputError),
        "nan": (with_nan(), pg.InputError),
        "infinite": (np.full((3, 3), np.inf), pg.InputError),
        "two columns": (np.zeros((5, 2)), pg.InputError),
        "one dimension": (np.zeros(6), pg.InputError),
        "three dimensions": (np.zeros((2, 3, 3)), pg.InputError),
        "columns of two lengths": ((np.zeros(3), np.zeros(3), np.zeros(4)), pg.InputError),
        "objects": (np.array([[object()] * 3]), TypeError),
        "text": (np.array([["a", "b", "c"]]), TypeError),
        "complex": (np.zeros((3, 3), complex), TypeError),
        "masked": (np.ma.masked_array(GOOD, GOOD > 0.5), pg.InputError),
        "nothing": (None, TypeError),
        "beyond float32": (np.full((3, 3), 1e300) * [[1], [2], [3]], pg.InputError),
    }.values(),
)
def test_positions(given, kind):
    with pytest.raises(kind) as raised:
        pg.Snapshot(given)
    assert "\n" not in str(raised.value) and "--" not in str(raised.value)


def test_invalid_particles_can_be_left_out():
    assert len(pg.Snapshot(with_nan(), skip_invalid=True)) == 1999


@pytest.mark.parametrize(
    "known",
    [
        {"weights": np.ones(3)},
        {"weights": np.zeros(2000)},
        {"weights": -np.ones(2000)},
        {"weights": np.full(2000, np.nan)},
        {"weights": np.ones((2000, 1))},
        {"masses": 0.0},
        {"masses": np.inf},
        {"masses": np.ones(2000), "weights": np.ones(2000)},
        {"box": 0},
        {"box": -1},
        {"box": np.nan},
        {"box": [1, 2]},
        {"box": np.zeros((3, 3))},
        {"box": [1, 1, 1, 10, 10, 170]},
        {"origin": (0, 0, 0)},
        {"box": 1, "pbc": (True, False)},
        {"threads": 0},
    ],
)
def test_what_is_known(known):
    with pytest.raises(pg.InputError):
        pg.Snapshot(GOOD, **known)


def test_a_box_smaller_than_the_particles():
    with pytest.raises(pg.InputError, match="along x, but the box is 5 long"):
        pg.Snapshot(GOOD * 10, box=5)
    with pytest.raises(pg.InputError, match="box length outside"):
        pg.compress(pg.Snapshot(GOOD * 10 + 20, box=12), gaussians=10)


def test_one_particle_is_a_model():
    model = pg.compress(np.array([[1.0, 2.0, 3.0]]), gaussians=1)
    assert model.count == 1 and np.allclose(model.gaussians.means, [[1, 2, 3]])


@pytest.mark.parametrize(
    "asked",
    [
        {"ratio": 0},
        {"ratio": np.nan},
        {"ratio": 10, "gaussians": 5},
        {"gaussians": 0},
        {"size": "five"},
        {"size": "3 parsecs"},
        {"effort": "much"},
        {"train": "always"},
        {"law": "alpha-blend"},
        {"certificate": "golden"},
        {"radius": -1},
        {"opacity": 1.5},
        {"max_pk_error": "1%"},
        {"min_correlation": 0.9, "cell": 1, "groups_within": 0.1, "from_size": 20},
        {"threads": 0},
        {"threads": 5000},
    ],
)
def test_targets(asked):
    with pytest.raises(pg.InputError) as raised:
        pg.compress(GOOD, **asked)
    assert "--" not in str(raised.value)


def test_what_cannot_be_reached():
    with pytest.raises(pg.UnreachableError, match="ratio="):
        pg.compress(GOOD, ratio=1e6)


def test_model_files(model, tmp_path):
    with pytest.raises(FileNotFoundError):
        pg.read(tmp_path / "none.pgs")
    with pytest.raises(pg.InputError, match="folder"):
        pg.read(tmp_path)
    data = bytearray(model.to_bytes())
    newer = bytes(data[:4]) + bytes([200]) + bytes(data[5:])
    for bad in (b"", b"text", bytes(data[: len(data) // 2]), newer):
        with pytest.raises(ValueError):
            pg.read(bad)
    data[len(data) // 2] ^= 0xFF
    with pytest.raises(pg.ModelError):
        pg.read(bytes(data))
    with pytest.raises(TypeError):
        pg.read(io.BytesIO(b""))
    with pytest.raises(TypeError):
        pg.Model()


def test_nothing_is_replaced(model, tmp_path):
    path = tmp_path / "m.pgs"
    path.write_bytes(b"mine")
    with pytest.raises(FileExistsError):
        model.save(path)
    assert path.read_bytes() == b"mine"
    model.save(path, overwrite=True)
    assert path.read_bytes() == model.to_bytes()
    with pytest.raises(OSError):
        model.save(tmp_path / "no" / "folder.pgs")
    assert [p.name for p in tmp_path.iterdir()] == ["m.pgs"]


@pytest.mark.parametrize(
    "asked",
    [
        {"style": "oil"},
        {"size": (0, 5)},
        {"size": (40000, 5)},
        {"radius": -1},
        {"opacity": 2},
        {"distance": 0},
        {"distance": np.nan},
        {"azimuth": np.inf},
        {"center": (1, 2)},
        {"width": -1},
        {"layers": ["gas"]},
        {"camera": pg.Camera((0, 0, 0), (0, 0, 0))},
        {"camera": pg.Camera((0, 0, 0), (0, 1, 0), (0, 1, 0))},
    ],
)
def test_pictures(model, asked):
    with pytest.raises(ValueError):
        model.render(**{"size": (32, 18), **asked})


@pytest.mark.parametrize(
    ("asked", "idle"),
    [
        ({"style": "density", "radius": 0.1}, "radius"),
        ({"style": "density", "opacity": 0.5}, "opacity"),
        ({"depth": 5}, "depth"),
        ({"width": 5, "distance": 2.0}, "distance"),
        ({"camera": pg.Camera((0, 0, 50), (0, 0, 0)), "width": 5}, "width"),
        ({"camera": pg.Camera((0, 0, 50), (0, 0, 0)), "azimuth": 30}, "azimuth"),
    ],
)
def test_what_would_do_nothing_is_refused(model, asked, idle):
    with pytest.raises(pg.InputError, match=f"{idle} does nothing"):
        model.render(**{"size": (32, 18), **asked})


def test_densities(model):
    for asked in ({"axis": "w"}, {"shape": (0, 5)}, {"width": 0}, {"depth": -1}, {"center": (0, np.nan, 0)}):
        with pytest.raises(ValueError):
            model.density_map(**{"shape": (8, 8), **asked})
    for cells in (0, 70_000):
        with pytest.raises(ValueError) as raised:
            model.density_grid(cells)
        assert "--" not in str(raised.value)
    for bad in (np.zeros((4, 2)), [[0, 0, np.nan]]):
        with pytest.raises(ValueError):
            model.at(bad)
    for asked in ({"n": 0}, {"method": "magic"}, {"scale": -1}, {"layers": ["gas"]}):
        with pytest.raises(ValueError):
            model.recover(**asked)


def test_statistics(snap, model):
    for asked in ({"only": ["taste"]}, {"grid": 1}, {"assignment": "best"}, {"convention": "mine"}, {"linking": -1}):
        with pytest.raises(ValueError):
            pg.stats(snap, model, **asked)
    with pytest.raises(TypeError):
        pg.stats(snap, "model.pgs")


def test_snapshots(sample_path, tmp_path):
    with pytest.raises(FileNotFoundError):
        pg.open(tmp_path / "none.hdf5")
    (tmp_path / "text.bin").write_text("no snapshot")
    with pytest.raises(pg.InputError):
        pg.open(tmp_path / "text.bin")
    for asked in (
        {"species": "stars"},
        {"format": "word"},
        {"frame": 3},
        {"region": (0, 0, 0, 1, 0, 1)},
        {"center": (1, 1, 1)},
        {"every": 0},
        {"sample": 10**9},
        {"box": -1},
        {"layers_by": "colour"},
    ):
        with pytest.raises(ValueError) as raised:
            pg.open(sample_path, **asked)
        assert "--" not in str(raised.value), asked


def test_names_of_other_types_are_refused(model, tmp_path):
    for name in ["m.txt", "m.png"]:
        with pytest.raises(pg.InputError, match="does not write"):
            model.save(tmp_path / name)
    with pytest.raises(pg.InputError, match="does not write"):
        pg.Snapshot(GOOD).save(tmp_path / "p.vdb")
    assert not list(tmp_path.iterdir())


def test_a_file_that_was_cut_since_it_was_opened_is_refused(tmp_path):
    for name, column in zip(["xx.f32", "yy.f32", "zz.f32"], GOOD.T):
        (tmp_path / name).write_bytes(np.ascontiguousarray(column).tobytes())
    mapped, copied = pg.open(tmp_path), pg.open(tmp_path, memory=True)
    with open(tmp_path / "yy.f32", "r+b") as file:
        file.truncate(100)
    for use in [lambda s: pg.compress(s, gaussians=10), lambda s: s.positions, lambda s: s.bounds]:
        with pytest.raises(pg.InputError, match="cut to 100 bytes"):
            use(mapped)
        use(copied)


def test_scores_say_whether_the_particles_are_the_models_own(model):
    with pytest.warns(UserWarning, match="is not the snapshot that"):
        scores = model.eval(GOOD, frames=1, size=(64, 36))
    assert scores["source_matches"] is False


def test_maps_of_other_units_are_not_subtracted():
    densities = [pg.compress(pg.Snapshot(GOOD, units=u), gaussians=10).density_map() for u in ("kpc", "Mpc")]
    assert (densities[0] - densities[0]).unit == densities[0].unit
    with pytest.raises(pg.InputError, match="Mpc"):
        densities[0] - densities[1]
