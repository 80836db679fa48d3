"""Type checks of the package, of user code and of the notebooks; the stub against the native module."""

import json
import os
import pathlib
import subprocess
import sys

import pytest

import particlegs as pg

pytest.importorskip("mypy")

PYTHON = pathlib.Path(__file__).resolve().parents[1]

#: User code and its types.
FACE = """
from typing import Any, Optional, Union
import numpy as np
from numpy.typing import NDArray
from typing_extensions import assert_type
import particlegs as pg
from matplotlib.figure import Figure

snap = pg.open("x.hdf5", species="dm", center=(1, 2, 3), width=4)
assert_type(snap, pg.Snapshot)
assert_type(pg.Snapshot(np.zeros((3, 3)), box=50, pbc=(True, True, False), units="Mpc/h"), pg.Snapshot)
assert_type(pg.Snapshot.from_chunks([np.zeros((3, 3))], units="kpc"), pg.Snapshot)
assert_type(pg.Snapshot.from_ase(None, box=3.0), pg.Snapshot)
assert_type(snap.masses, Optional[NDArray[np.float64]])

model = pg.compress(snap, ratio=300, progress=lambda phase, done, total: None)
assert_type(model, pg.Model)
assert_type(pg.read(b"", name="x"), pg.Model)
assert_type(model.render(30, 20), NDArray[np.uint8])
assert_type(model.render(style="paraview-no-fxaa", size=(640, 360)), NDArray[np.uint8])
assert_type(model.render(style="expected", radius=0.1, layers=["gas"]), NDArray[np.float32])
assert_type(model.render(style="density", camera=pg.Camera((0, 0, 9), (0, 0, 0))), pg.Map)
assert_type(snap.render(style="expected"), NDArray[np.float32])
assert_type(model.density_map(axis="x").extent, Optional[tuple[float, float, float, float]])
assert_type(model.density_grid(64).cell_volume, float)
assert_type(model.at([[1.0, 2.0, 3.0]]), NDArray[np.float64])
assert_type(model.recover(100, "spaced"), pg.Snapshot)
assert_type(model.gaussians.masses, Optional[NDArray[np.float64]])
assert_type(model.certificate, Union[dict[str, Any], Any])
assert_type(pg.stats(snap, model, only="spectrum").power.k, Union[NDArray[np.float64], Any])
assert_type(pg.stats(snap, model).plot(labels=("all", "ours")), "Figure")
"""

#: Mistakes that a type checker must find.
MISTAKES = """
import particlegs as pg
model = pg.read("x.pgs")
model.render(style="oil")
model.render(size="large")
model.recover(method="magic")
pg.compress("x.hdf5", ratios=3)
pg.compress(model, effort="much")
pg.Snapshot.from_chunks([], units=3)
model.density_map(axis="w").colour
"""


def mypy(*arguments):
    """Checks with the package's own settings."""
    command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", *arguments]
    done = subprocess.run(command, cwd=PYTHON, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_the_package_and_what_users_write(tmp_path):
    face = tmp_path / "face.py"
    face.write_text(FACE)
    code, said = mypy("-p", "particlegs")
    assert code == 0, said
    code, said = mypy(str(face))
    assert code == 0, said


def test_mistakes_are_found(tmp_path):
    wrong = tmp_path / "mistakes.py"
    wrong.write_text(MISTAKES)
    _, said = mypy(str(wrong))
    found = {int(line.split(":")[1]) for line in said.splitlines() if ": error:" in line}
    assert found == set(range(4, 11)), said


def test_the_notebooks(tmp_path):
    files = []
    for notebook in sorted((PYTHON / "notebooks").glob("*.ipynb")):
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        code = "\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "code")
        files.append(tmp_path / f"{notebook.stem}.py")
        files[-1].write_text(code, encoding="utf-8")
    assert len(files) == 3
    code, said = mypy(*map(str, files))
    assert code == 0, said


def test_the_stub_of_the_native_half(tmp_path):
    # The native module may be missing in the source folder, so the installed one is checked.
    folder = pathlib.Path(pg.__file__).resolve().parents[1]
    known = {} if folder.name == "site-packages" else {"MYPYPATH": str(folder)}
    command = [sys.executable, "-m", "mypy.stubtest", "particlegs._particlegs", "--ignore-missing-stub"]
    done = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, **known}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
