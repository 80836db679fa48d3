"""The same options give the same bytes as the command, for any kind of input."""

import subprocess

import numpy as np
import pytest

import particlegs as pg

CASES = {
    "plain": ([], {}),
    "ratio and seed": (
        ["--ratio", "100", "--seed", "7", "--effort", "fast", "--certificate", "none"],
        {"ratio": 100, "seed": 7, "effort": "fast", "certificate": "none"},
    ),
    "size and radius": (
        ["--size", "40kB", "--radius", "0.02", "--opacity", "0.1", "--effort", "fast", "--certificate", "none"],
        {"size": "40kB", "radius": 0.02, "opacity": 0.1, "effort": "fast", "certificate": "none"},
    ),
    "number": (
        ["--gaussians", "500", "--effort", "fast", "--certificate", "none"],
        {"gaussians": 500, "effort": "fast", "certificate": "none"},
    ),
    "memory": (
        ["--ratio", "200", "--blocks", "3", "--effort", "fast", "--certificate", "none"],
        {"ratio": 200, "blocks": 3, "effort": "fast", "certificate": "none"},
    ),
}


def made_by_command(command, inputs, options, folder):
    out = folder / "m.pgs"
    subprocess.run(
        [command, "compress", *map(str, inputs), "-o", str(out), "--quiet", "--force", *options],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return out.read_bytes()


@pytest.mark.parametrize("case", CASES)
def test_a_snapshot_gives_the_bytes_of_the_command(case, command, snap, sample_path, tmp_path):
    options, arguments = CASES[case]
    assert pg.compress(snap, **arguments).to_bytes() == made_by_command(command, [sample_path], options, tmp_path)


def test_a_selection_is_told_as_the_command_tells_it(command, sample_path, tmp_path):
    options = ["--center", "5,5,5", "--width", "12.5", "--every", "2", "--sample", "10000", "--gaussians", "100"]
    bare = ["--effort", "fast", "--certificate", "none"]
    snap = pg.open(sample_path, center=(5, 5, 5), width=12.5, every=2, sample=10000)
    assert len(snap) == 10000
    model = pg.compress(snap, gaussians=100, effort="fast", certificate="none")
    assert model.to_bytes() == made_by_command(command, [sample_path], options + bare, tmp_path)


@pytest.mark.parametrize("kind", ["<f4", "<f8", ">f8", "far <f8"])
def test_arrays_give_the_bytes_that_a_file_of_them_gives(kind, command, columns, tmp_path):
    rows = np.stack(columns, axis=1)
    if kind.startswith("far"):
        rows = rows.astype("<f8") + 1e6
    rows = rows.astype(kind.split()[-1])
    np.save(tmp_path / "points.npy", rows)
    options = ["--gaussians", "300", "--effort", "fast", "--certificate", "none"]
    expected = made_by_command(command, [tmp_path / "points.npy"], options, tmp_path)
    snap = pg.Snapshot(rows, name="points.npy")
    assert pg.compress(snap, gaussians=300, effort="fast", certificate="none").to_bytes() == expected


def test_threads_do_not_matter(snap):
    one, two = (pg.compress(snap, gaussians=300, effort="fast", threads=n) for n in (1, 2))
    assert one.to_bytes() == two.to_bytes()


def test_pictures_and_particles_are_those_of_the_command(command, model, tmp_path):
    model.save(tmp_path / "m.pgs")
    subprocess.run(
        [
            command,
            "render",
            tmp_path / "m.pgs",
            "--azimuth",
            "30",
            "--elevation",
            "20",
            "--size",
            "320x180",
            "-o",
            tmp_path / "p.png",
            "--quiet",
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    picture = model.render(30, 20, size=(320, 180))
    matplotlib = pytest.importorskip("matplotlib.image")
    drawn = matplotlib.imread(tmp_path / "p.png")
    drawn = np.round((drawn if drawn.ndim == 2 else drawn[..., 0]) * 255).astype(np.uint8)
    assert np.array_equal(drawn, picture)
    subprocess.run(
        [command, "recover", tmp_path / "m.pgs", "-o", tmp_path / "r", "--quiet"], check=True, stdout=subprocess.DEVNULL
    )
    parts = model.recover()
    for k, axis in enumerate("xyz"):
        written = np.fromfile(tmp_path / "r" / f"{axis}{axis}.f32", dtype="<f4")
        assert np.array_equal(written, parts.positions[:, k])
