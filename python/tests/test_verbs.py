"""Parts of snapshots, and the subcommands for models."""

from pathlib import Path

import numpy as np
import pytest

import particlegs as pg

FIXTURES = Path(__file__).resolve().parents[2] / "crates/particlegs-formats/tests/fixtures"
ROWS = np.random.default_rng(5).normal(5, 1, size=(3000, 3)).clip(0, 9.99).astype("f4")


@pytest.fixture(scope="module")
def snap():
    return pg.Snapshot(ROWS, box=10, units="Mpc/h", masses=2.0, mass_units="Msun/h")


@pytest.fixture(scope="module")
def model(snap):
    return pg.compress(snap, gaussians=60, effort="fast")


def test_species_are_slices():
    both = pg.open(FIXTURES / "species.hdf5")
    gas, dark = both["gas"], both["dm"]
    assert list(gas.layers) == ["PartType0"] and list(dark.layers) == ["PartType1"]
    assert np.array_equal(gas.positions, both.positions[both.layers["PartType0"]])
    assert np.allclose(dark.masses, both.masses[both.layers["PartType1"]])
    assert len(gas) + len(dark) == len(both) and np.array_equal(gas.box, both.box)
    assert np.array_equal(both["PartType1"].positions, both["Dark Matter"].positions)
    made = pg.compress(dark, gaussians=5, certificate="none")
    assert made.count == len(dark) and made.layers[0]["name"] == "PartType1"
    with pytest.raises(pg.InputError, match="PartType0, PartType1"):
        both["stars"]
    with pytest.raises(TypeError, match="name of a species"):
        both[0]


def test_types_share_gaussians_where_they_are_told_to():
    both = pg.Snapshot(ROWS, box=10, layers={"gas": 1500, "dm": 1500})
    made = {
        choice: pg.compress(both, gaussians=40, certificate="none", share_gaussians=choice) for choice in ("yes", "no")
    }
    layers = [[layer["name"] for layer in m.layers] for m in made.values()]
    assert layers == [["dm", "gas"]] * 2
    # Those of each type lie in the same places where they are shared.
    means = {choice: m.gaussians.means for choice, m in made.items()}
    assert len(means["yes"]) == 2 * len(means["no"])
    with pytest.raises(pg.InputError, match='share_gaussians="maybe": use `auto`, `yes` or `no`'):
        pg.compress(both, share_gaussians="maybe")
    with pytest.raises(pg.InputError, match="cannot have fields"):
        pg.compress(both, share_gaussians="yes", fields={"heat": np.ones(3000)})
    with pytest.raises(pg.InputError, match='leave out share_gaussians="yes"'):
        pg.compress(ROWS, share_gaussians="yes")


def test_regions_are_those_of_the_command(snap):
    inside = np.all((ROWS >= 4) & (ROWS < 6), axis=1)
    part = snap.region(4, (6, 6, 6))
    assert np.array_equal(part.positions, ROWS[inside]) and np.array_equal(part.masses, np.full(len(part), 2.0))
    assert part.length_unit == "Mpc/h"
    assert len(snap.region((0, 0, 0), (3, 10, 10))) == np.sum(ROWS[:, 0] < 3)
    with pytest.raises(pg.InputError):
        snap.region(6, 4)


def test_masses_are_an_array_or_none(snap):
    assert snap.masses.shape == (3000,) and (snap.masses == 2.0).all()
    assert pg.Snapshot(ROWS).masses is None


def test_models_are_simplified_and_merged(snap, model):
    assert len(model.simplify(gaussians=20).gaussians) == 20
    assert model.simplify(size=1000).nbytes <= 1000
    with pytest.raises(pg.InputError, match="one target"):
        model.simplify()
    halves = [snap.region((low, 0, 0), (low + 5, 10, 10)) for low in (0, 5)]
    parts = [pg.compress(half, gaussians=30, effort="fast", certificate="none") for half in halves]
    whole = parts[0].merge(parts[1])
    assert whole.count == 3000 and len(whole.gaussians) == sum(len(part.gaussians) for part in parts)
    assert whole.to_bytes() == parts[1].merge(parts[0]).to_bytes()


def test_models_are_scored_and_verified(snap, model):
    scores = model.eval(snap, frames=1, size=(64, 36))
    assert len(scores["views"]) == 3 and scores["mean"]["expected"]["masked_psnr"] > 20
    found = model.verify(snap)
    assert found["differing"] == [] and found["measured"]["subset"] == model.certificate["subset"]
    with pytest.raises(pg.InputError, match="not the snapshot"):
        model.verify(ROWS[::-1])


@pytest.mark.parametrize("ending", ["ply", "glb", "npy", "vti", "fits", "dx", "mrc", "npz", "csv", "html"])
def test_models_are_exported(model, tmp_path, ending):
    path = tmp_path / f"m.{ending}"
    assert model.export(path, cells=8, color="density") == path.stat().st_size
    with pytest.raises(FileExistsError):
        model.export(path)
    if ending == "npy":
        assert np.load(path).shape == (8, 8, 8)
    model.export(path, overwrite=True)


def test_layers_are_exported_by_species(tmp_path):
    both = pg.compress(pg.open(FIXTURES / "species.hdf5"), gaussians=12, certificate="none")
    both.export(tmp_path / "gas.npz", layers=["gas"])
    assert list(np.load(tmp_path / "gas.npz")["layer_names"]) == ["PartType0"]
    with pytest.raises(pg.InputError, match="no layer"):
        both.export(tmp_path / "no.npz", layers=["stars"])
