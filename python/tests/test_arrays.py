"""Arrays in and out: shapes, types, byte orders, units and copies."""

import gc
import weakref

import numpy as np
import pytest

import particlegs as pg


@pytest.fixture
def rows():
    return np.random.default_rng(1).random((1000, 3)).astype(np.float32)


def same(snap, rows):
    return np.array_equal(np.asarray(snap.positions, dtype=np.float32), np.asarray(rows, dtype=np.float32))


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8", ">f8", "<f2", "<i4", ">i8", "u1", "bool"])
def test_every_kind_and_order_is_read(rows, kind):
    given = (rows * 100).astype(kind)
    assert same(pg.Snapshot(given), given.astype(np.float64))


def test_strides_are_followed(rows):
    wide = np.zeros((1000, 7), dtype=np.float64)
    wide[:, 1:6:2] = rows
    for given in (
        wide[:, 1:6:2],
        np.asfortranarray(rows),
        rows[::-1],
        rows[::3],
        np.broadcast_to(rows[0], (5, 3)),
        rows.T.copy().T,
    ):
        assert same(pg.Snapshot(given), given)


def test_three_columns_are_taken(rows):
    columns = [rows[:, k].copy() for k in range(3)]
    assert same(pg.Snapshot(columns), rows)
    assert same(pg.Snapshot(tuple(c.astype(np.float64) for c in columns)), rows)
    assert same(pg.Snapshot([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [1.0, 1.0, 1.0]]), [[0, 1, 2], [3, 4, 5], [1, 1, 1]])


def test_float32_rows_are_used_where_they_lie(rows):
    snap = pg.Snapshot(rows)
    seen = snap.positions
    assert np.shares_memory(seen, rows) and not seen.flags.writeable
    with pytest.raises(ValueError):
        seen[0, 0] = 1.0
    frozen = rows.copy()
    frozen.flags.writeable = False
    assert np.shares_memory(pg.Snapshot(frozen).positions, frozen)


def test_arrays_live_as_long_as_they_are_used():
    rows = np.random.default_rng(1).random((1000, 3)).astype(np.float32)
    copy, alive = rows.copy(), weakref.ref(rows)
    snap = pg.Snapshot(rows)
    seen = snap.positions
    del rows, snap
    gc.collect()
    assert alive() is not None and np.array_equal(seen, copy)
    del seen
    gc.collect()
    assert alive() is None


def test_positions_far_from_zero_keep_their_digits():
    near = np.random.default_rng(2).random((100, 3))
    snap = pg.Snapshot(near + 1e9)
    assert snap.positions.dtype == np.float64
    assert np.abs(snap.positions - 1e9 - near).max() < 1e-6


def test_masses_and_weights(rows):
    each = pg.Snapshot(rows, masses=2.5, mass_units="Msun")
    assert np.array_equal(each.masses, np.full(1000, 2.5)) and each.weights is None and each.mass_unit == "Msun"
    own = np.linspace(1, 2, 1000)
    several = pg.Snapshot(rows, masses=own)
    assert np.allclose(several.masses, own) and several.weights.dtype == np.float32
    assert np.array_equal(pg.Snapshot(rows, masses=np.full(1000, 3.0)).masses, np.full(1000, 3.0))
    relative = pg.Snapshot(rows, weights=own, masses=10.0)
    assert np.allclose(relative.masses, 10 * own, rtol=1e-6)
    assert pg.Snapshot(rows).masses is None


def test_masses_that_float32_cannot_hold(rows):
    for scale in (1e43, 1e-44):
        own = np.linspace(1, 2, 1000) * scale
        assert np.allclose(pg.Snapshot(rows, masses=own).masses, own, rtol=1e-6, atol=0)
    with pytest.raises(pg.InputError):
        pg.Snapshot(rows, masses=np.append(np.full(999, 1e43), -1.0))


def test_boxes(rows):
    boxes = {
        "a length": (2.0, np.diag([2.0] * 3)),
        "three": ([1, 2, 3], np.diag([1.0, 2.0, 3.0])),
        "angles": ([1, 2, 3, 90, 90, 90], np.diag([1.0, 2.0, 3.0])),
        "vectors": ([[1, 0, 0], [0.2, 1, 0], [0, 0.1, 1]], [[1, 0, 0], [0.2, 1, 0], [0, 0.1, 1]]),
    }
    for name, (box, vectors) in boxes.items():
        assert np.allclose(pg.Snapshot(rows, box=box).box, vectors), name
    tilted = pg.Snapshot(rows, box=[2, 2, 2, 90, 90, 60])
    assert np.allclose(np.linalg.norm(tilted.box, axis=1), 2) and np.isclose(tilted.box[1] @ tilted.box[0], 2.0)
    part = pg.Snapshot(rows, box=1, pbc=(True, False, True), origin=(-0.1, 0, 0))
    assert part.periodic == (True, False, True) and np.allclose(part.origin, [-0.1, 0, 0])
    slab = pg.Snapshot(rows, box=[1, 1, 0])
    assert slab.periodic == (True, True, False) and np.allclose(slab.box, np.diag([1.0, 1.0, 0.0]))
    downwards = pg.Snapshot(rows - 1, box=-np.eye(3))
    assert np.allclose(downwards.box, -np.eye(3))


def test_chunks_are_the_whole(rows, tmp_path):
    given = rows.astype(np.float64)
    snap = pg.Snapshot.from_chunks((given[i : i + 300] for i in range(0, 1000, 300)), folder=tmp_path, box=1)
    assert same(snap, rows) and np.allclose(snap.box, np.eye(3)) and not list(tmp_path.iterdir())
    weighted = pg.Snapshot.from_chunks([(rows[:500], np.arange(1, 501)), (rows[500:], np.arange(501, 1001))])
    assert np.array_equal(weighted.weights, np.arange(1, 1001, dtype=np.float32))
    assert len(pg.compress(weighted, gaussians=20).gaussians) == 20
    with pytest.raises(pg.InputError):
        pg.Snapshot.from_chunks([])
    with pytest.raises(pg.InputError):
        pg.Snapshot.from_chunks([rows, (rows, np.ones(1000))])


def test_gaussians_are_views(model):
    g = model.gaussians
    assert g.means.shape == (len(g), 3) and g.covariances.shape == (len(g), 3, 3)
    assert np.shares_memory(g.means, model.gaussians.means) and not g.means.flags.writeable
    assert np.array_equal(g.covariances, np.swapaxes(g.covariances, 1, 2))
    assert g.counts.sum() == model.count == 262144
    assert [len(range(*s.indices(len(g)))) for s in g.layers.values()] == [len(g)]


def test_saved_particles_are_read_again(rows, tmp_path):
    snap = pg.Snapshot(rows, box=1, masses=2.0)
    for name in ("p.hdf5", "p.npy", "p.vtp", "folder"):
        assert snap.save(tmp_path / name) > 0
        assert same(pg.open(tmp_path / name), rows), name
        with pytest.raises(FileExistsError):
            snap.save(tmp_path / name)
