"""Catalogues of haloes."""

import numpy as np
import pytest

import particlegs as pg


def box(n=12000):
    """Three clouds at rest in a periodic box of 10 Mpc/h, one across its edge, and a background."""
    draw = np.random.default_rng(5)
    centers = np.array([[0.05, 5.0, 5.0], [3.0, 3.0, 3.0], [7.0, 7.0, 3.0]])
    which = draw.choice(3, n, p=[0.5, 0.3, 0.2])
    clouds = centers[which] + draw.normal(size=(n, 3)) * 0.05
    place = np.concatenate([clouds, draw.uniform(0.0, 10.0, (n, 3))]) % 10.0
    return place, np.concatenate([100.0 * draw.normal(size=(n, 3)) + [0, 0, 300], np.zeros((n, 3))]), centers


STATED = {"particle_mass": 1e10, "mass_unit": "Msun/h", "cosmology": "h=0.7,Om=0.3", "redshift": 0.0}


def test_haloes_are_a_structured_array():
    place, velocity, centers = box()
    snap = pg.Snapshot(place, box=10, units="Mpc/h")
    found = pg.haloes(snap, velocities=velocity, **STATED)
    assert found["id"].dtype == np.int64
    assert found["m200m"].dtype == np.float64
    np.testing.assert_allclose([[h[k] for k in "xyz"] for h in found[:3]], centers, atol=0.03)
    np.testing.assert_allclose(found["vz"][:3], 300.0, atol=30.0)
    np.testing.assert_allclose(found["m200m"][:3], 1e10 * found["n200m"][:3])
    assert found.dtype.metadata["units"]["m200m"] == "Msun/h"
    model = pg.compress(snap, gaussians=200, certificate="none")
    of_model = pg.haloes(model, **STATED)
    np.testing.assert_allclose(of_model["m200m"][:3], found["m200m"][:3], rtol=0.1)
    assert (of_model["m200m_err"][:3] > 0).all()


def test_what_is_missing_is_a_warning_and_what_is_wrong_an_error():
    place, _, _ = box(2000)
    snap = pg.Snapshot(place, box=10)
    with pytest.warns(UserWarning, match="masses"):
        found = pg.haloes(snap)
    assert "m200m" not in found.dtype.names
    with pytest.raises(pg.InputError, match="there are h"):
        pg.haloes(snap, cosmology="w=1")
