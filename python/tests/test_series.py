"""Series: a run of three snapshots with a gap, read by frame and by moment."""

import json
import pathlib
import shutil
import subprocess

import numpy as np
import pytest

import particlegs as pg

FRAMES = 3


@pytest.fixture(scope="module")
def snapshots(tmp_path_factory):
    """Particles that move along x, as HDF5 of three scale factors."""
    h5py = pytest.importorskip("h5py")
    folder = tmp_path_factory.mktemp("run")
    rng = np.random.default_rng(3)
    start = rng.normal(50, 8, (4000, 3))
    for i in range(FRAMES):
        with h5py.File(folder / f"snap_{i}.hdf5", "w") as f:
            header = f.create_group("Header").attrs
            header["NumPart_ThisFile"] = header["NumPart_Total"] = np.array([0, 4000, 0, 0, 0, 0], "u4")
            header["NumPart_Total_HighWord"] = np.zeros(6, "u4")
            header["MassTable"] = np.array([0, 1.0, 0, 0, 0, 0])
            header["BoxSize"], header["NumFilesPerSnapshot"] = 100.0, 1
            header["Time"], header["Redshift"] = 0.5 + 0.1 * i, 1 / (0.5 + 0.1 * i) - 1
            header["Omega0"], header["OmegaLambda"], header["HubbleParam"] = 0.3, 0.7, 0.7
            group = f.create_group("PartType1")
            group["Coordinates"] = (start + np.array([2.0 * i, 0, 0])).astype("f4")
            group["ParticleIDs"] = np.arange(4000, dtype="u4")
    return folder


@pytest.fixture(scope="module")
def run_path(snapshots, command):
    path = snapshots / "run.pgs"
    files = sorted(snapshots.glob("snap_*.hdf5"))
    for some in (files[:1], files):
        run = pg.compress_series(some, path, size="4kB")
        assert len(run) == len(some)
    subprocess.run([command, "series", *files, "-o", snapshots / "same.pgs", "--size", "4kB", "--quiet"], check=True)
    assert path.read_bytes() == (snapshots / "same.pgs").read_bytes()
    return path


@pytest.mark.filterwarnings("ignore")
def test_a_series_that_cannot_be_made_is_refused(run_path, snapshots, tmp_path):
    files, text = sorted(snapshots.glob("snap_*.hdf5")), tmp_path / "text.pgs"
    text.write_text("not a series")
    for path, options, error, match in [
        (run_path, {"size": "5kB"}, FileExistsError, "overwrite=True"),
        (text, {}, FileExistsError, "not a series"),
        (tmp_path / "a.pgs", {"keyframe_interval": 0}, pg.InputError, "at least 1"),
        (tmp_path / "a.pgs", {"frames": "5"}, pg.InputError, "FIRST:END"),
        (tmp_path / "a.pgs", {"opacity": 2.0}, pg.InputError, "opacity must be above 0 and at most 1"),
        (tmp_path / "a.pgs", {"read": {"species": "gas"}, "size": "4kB"}, pg.InputError, "gas"),
    ]:
        with pytest.raises(error, match=match):
            pg.compress_series(files, path, **options)
    assert not (tmp_path / "a.pgs").exists()


def test_a_series_has_frames(run_path):
    run = pg.open(run_path)
    assert isinstance(run, pg.Series) and len(run) == 3 and run.clock == "scale factor"
    assert np.allclose(run.times, [0.5, 0.6, 0.7]) and np.allclose(run.redshifts, 1 / run.times - 1)
    assert run.name == "run.pgs" and run.nbytes == run_path.stat().st_size and "3 frames" in repr(run)
    models = list(run)
    assert [m.count for m in models] == [4000] * 3
    assert np.allclose(np.diff([m.bounds[0, 0] for m in models]), 2, atol=0.5)
    assert run[-1].to_bytes() == models[2].to_bytes() and run[1].name == "run.pgs, frame 1"


def test_frames_do_not_depend_on_what_was_decoded_before(run_path):
    forward = [m.to_bytes() for m in pg.Series(run_path)]
    backward = [m.to_bytes() for m in reversed(pg.Series(run_path))]
    assert forward == backward[::-1]


def test_a_moment_between_frames_is_interpolated(run_path):
    run = pg.Series(run_path, threads=1)
    assert run.at("a=0.6").to_bytes() == run[1].to_bytes() == run.at(0.6).to_bytes()
    x = [m.gaussians.means[:, 0] @ m.gaussians.counts / m.count for m in (run[0], run.at("a=0.55"), run[1])]
    assert abs(x[1] - 0.5 * (x[0] + x[2])) < 0.2 and x[2] - x[0] > 1.5
    assert run.at("z=0.6").certificate is None


def test_statistics_over_time_are_those_of_the_command(run_path, command, tmp_path):
    run = pg.Series(run_path)
    found = run.statistics(spectrum_grid=np.int64(32))
    subprocess.run([command, "stats", run_path, "-o", tmp_path, "--spectrum-grid", "32", "--no-plots"], check=True)
    written = json.loads((tmp_path / "stats.json").read_text())
    assert found == {**written, "series": found["series"]}
    assert found["clock"] == "scale factor" and [f["particles"] for f in found["frames"]] == [4000] * FRAMES
    powers = [[shell["power"] for shell in f["spectrum"]] for f in found["frames"]]
    assert np.shape(powers)[0] == FRAMES and np.isfinite(powers).all()
    alone = run.statistics(only="groups", linking_length="0.5Mpc/h" if found["length_unit"] else 0.5)
    assert all(f["spectrum"] == [] and f["groups"][0]["from"] == 20 for f in alone["frames"])
    for wrong in ({"only": "density"}, {"spectrum_grid": 1}, {"layers": "gas"}, {"spectrum_assignment": "best"}):
        with pytest.raises(pg.InputError):
            run.statistics(**wrong)
    with pytest.raises(TypeError):
        run.statistics(linking="far")


def test_faults_are_named(run_path, tmp_path):
    run = pg.Series(run_path)
    with pytest.raises(IndexError, match="3 frames"):
        run[3]
    for when in ("a=0.9", "500ps", "soon", float("nan")):
        with pytest.raises(pg.InputError):
            run.at(when)
    with pytest.raises(FileNotFoundError):
        pg.Series(tmp_path / "none.pgs")
    (tmp_path / "short.pgs").write_bytes(run_path.read_bytes()[:-5])
    with pytest.raises(pg.ModelError):
        pg.open(tmp_path / "short.pgs")


def test_a_gap_is_a_frame_without_a_model(snapshots, command, tmp_path):
    for i in range(3):
        shutil.copy(snapshots / f"snap_{i}.hdf5", tmp_path / f"snap_{i}.hdf5")
    pathlib.Path(tmp_path / "snap_1.hdf5").write_bytes(b"broken")
    files = [str(tmp_path / f"snap_{i}.hdf5") for i in range(3)]
    subprocess.run([command, "series", *files, "-o", tmp_path / "run.pgs", "--size", "4kB", "--quiet"])
    run = pg.Series(tmp_path / "run.pgs")
    assert np.isnan(run.times[1]) and len(list(run)) == 2
    with pytest.raises(pg.InputError, match="missing"):
        run[1]


def test_a_film_is_that_of_the_command(run_path, command, tmp_path):
    ours, theirs = tmp_path / "a.gif", tmp_path / "b.gif"
    options = {"center": "all", "style": "density", "width": 40, "orthographic": True, "size": (64, 48)}
    record = pg.Series(run_path).film(ours, **options)
    words = "--frames all --center all --style density --width 40 --projection orthographic --size 64x48 --quiet"
    subprocess.run([command, "render", run_path, *words.split(), "--video", theirs], check=True)
    assert ours.read_bytes() == theirs.read_bytes() and len(record["views"]) == FRAMES
    for wrong, match in [
        ({"follow": "haloes"}, "FILE:NUMBER"),
        ({"frames": 0}, "or all"),
        ({"fps": 1000}, "1000"),
    ]:
        with pytest.raises(pg.InputError, match=match):
            pg.Series(run_path).film(tmp_path / "c.gif", **wrong)
    assert not (tmp_path / "c.gif").exists()
