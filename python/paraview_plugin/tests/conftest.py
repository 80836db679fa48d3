"""Shared by the tests of the ParaView plug-in: models, and the plug-in's folder on the path."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import particlegs
import pytest
from series_files import series_of, snapshot
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

PLUGIN = Path(__file__).resolve().parents[1]
SAMPLE = PLUGIN.parents[1] / "samples" / "nbody64"
sys.path.insert(0, str(PLUGIN))


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder for models."""
    return tmp_path_factory.mktemp("models")


@pytest.fixture(scope="session")
def sample(folder: Path) -> Path:
    """Make a model of the bundled snapshot: periodic, one layer, no masses."""
    path = folder / "sample.pgs"
    particlegs.compress(particlegs.open(SAMPLE), ratio=300, effort="fast").save(path)
    return path


@pytest.fixture(scope="session")
def flow(folder: Path) -> Path:
    """Make a model of two clouds that fall towards each other along x, with temperatures."""
    random = np.random.default_rng(3)
    side = np.where(np.arange(4000) % 2 == 0, 1.0, -1.0)
    points = random.normal(size=(4000, 3)) * 0.5 + side[:, None] * (2.0, 0.0, 0.0)
    velocities = random.normal(size=(4000, 3)) * (10.0, 5.0, 20.0) + side[:, None] * (-150.0, 0.0, 0.0)
    fields = {"velocity": velocities, "temperature": 1e4 + 1e3 * points[:, 1]}
    path = folder / "flow.pgs"
    particlegs.compress(particlegs.Snapshot(points), gaussians=10, certificate="none", fields=fields).save(path)
    return path


@pytest.fixture(scope="session")
def cloud(folder: Path) -> Path:
    """Make a model of a turned ellipsoidal cloud far from the origin, with masses and one Gaussian."""
    random = np.random.default_rng(7)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    points = random.normal(size=(20_000, 3)) * (3.0, 1.0, 0.4) @ turn + (50.0, -20.0, 10.0)
    snapshot = particlegs.Snapshot(points, masses=np.full(20_000, 2.5), units="kpc", mass_units="Msun")
    path = folder / "cloud.pgs"
    particlegs.compress(snapshot, gaussians=1).save(path)
    return path


@pytest.fixture
def messages() -> Iterator[vtkStringOutputWindow]:
    """Catch the messages that VTK would show."""
    before, window = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    yield window
    vtkOutputWindow.SetInstance(before)


@pytest.fixture(scope="session")
def snapshots(folder: Path) -> list[Path]:
    """Write a cloud that grows along x, at the scale factors 0.5, 0.6 and 0.7."""
    points = np.random.default_rng(3).normal(50.0, 8.0, (4000, 3))
    places = [(points - 50.0) * (1.0 + 0.5 * i, 1.0, 1.0) + 50.0 for i in range(3)]
    return [snapshot(folder / f"snap_{i}.hdf5", 0.5 + 0.1 * i, dm=x) for i, x in enumerate(places)]


@pytest.fixture(scope="session")
def run(folder: Path, snapshots: list[Path]) -> Path:
    """Make a series of three frames."""
    return series_of(snapshots, folder / "run.pgs")
