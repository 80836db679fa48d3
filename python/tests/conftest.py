"""Shared by the tests: the bundled sample as arrays and as a snapshot, and a model of it."""

import os
import pathlib
import shutil

import numpy as np
import pytest

import particlegs as pg

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAMPLE = ROOT / "samples" / "nbody64"


@pytest.fixture(scope="session")
def sample_path():
    return SAMPLE


@pytest.fixture(scope="session")
def columns():
    """The sample's columns x, y, z."""
    return [np.fromfile(SAMPLE / f"{axis}{axis}.f32", dtype="<f4") for axis in "xyz"]


@pytest.fixture(scope="session")
def snap():
    return pg.open(SAMPLE)


@pytest.fixture(scope="session")
def model(snap):
    return pg.compress(snap, ratio=65, effort="fast")


@pytest.fixture(scope="session")
def command():
    """The program from the wheel, from $PARTICLEGS, or from target/."""
    beside = [ROOT / "target" / profile / "particlegs" for profile in ("release", "debug")]
    found = [os.environ.get("PARTICLEGS"), *(str(p) for p in beside if p.exists()), shutil.which("particlegs")]
    found = [p for p in found if p]
    assert found, "the command particlegs is not built: cargo build --release"
    return found[0]
