"""Series in the plug-in's reader and picture, under plain VTK."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import particlegs
import pytest
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from series_files import series_of, snapshot
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
from vtkmodules.vtkFiltersCore import vtkCellDataToPointData
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

import particlegs_reader as plugin
import particlegs_views as views
from particlegs_reader import DENSITY, GAUSSIANS, PARTICLES, ParticlegsReader

TIMES = [0.5, 0.6, 0.7]


def reader_of(path: Path, **properties: object) -> ParticlegsReader:
    """Make a reader of a small density, and ask for its information."""
    reader = ParticlegsReader()
    reader.SetFileName(str(path))
    reader.SetResolution(8)
    for name, value in properties.items():
        getattr(reader, f"Set{name}")(value)
    reader.UpdateInformation()
    return reader


def at(reader: ParticlegsReader, time: float, port: int = GAUSSIANS) -> object:
    """Update an output at a time, as ParaView does."""
    reader.GetOutputInformation(port).Set(pipeline.UPDATE_TIME_STEP(), time)
    reader.Update(port)
    return reader.GetOutputDataObject(port)


def means(data: object) -> np.ndarray:
    """Give the points of the first block."""
    return vtk_to_numpy(data.GetBlock(0).GetPoints().GetData())


def field(data: object, name: str) -> list[float]:
    """Give the numbers of a field datum."""
    return vtk_to_numpy(data.GetFieldData().GetArray(name)).tolist()


def test_frames_are_time_steps(run: Path, sample: Path) -> None:
    """Every output has the steps; each gives the model of its frame, in any order."""
    reader, series = reader_of(run), particlegs.Series(run)
    for port in range(3):
        about = reader.GetOutputInformation(port)
        assert about.Get(pipeline.TIME_STEPS()) == pytest.approx(TIMES)
        assert about.Get(pipeline.TIME_RANGE()) == pytest.approx((0.5, 0.7))
    for frame in (0, 2, 1, 1, 0):
        data = at(reader, TIMES[frame])
        np.testing.assert_array_equal(means(data), series[frame].gaussians.means)
        assert data.GetInformation().Get(vtkDataObject.DATA_TIME_STEP()) == pytest.approx(TIMES[frame])
        for part in (data, data.GetBlock(0)):
            assert field(part, "frame") == [frame]
            assert field(part, "scale_factor") == pytest.approx([TIMES[frame]])
            assert field(part, "redshift") == pytest.approx([1.0 / TIMES[frame] - 1.0])
    reader.SetFileName(str(sample))
    reader.Update(GAUSSIANS)
    assert not reader.GetOutputInformation(GAUSSIANS).Has(pipeline.TIME_STEPS())
    single = reader.GetOutputDataObject(GAUSSIANS)
    assert not single.GetFieldData().HasArray("frame")
    assert not single.GetInformation().Has(vtkDataObject.DATA_TIME_STEP())


def test_without_a_time_the_first_frame_is_shown(run: Path) -> None:
    """A script that knows nothing of times gets the first frame."""
    reader = reader_of(run)
    reader.Update(GAUSSIANS)
    assert field(reader.GetOutputDataObject(GAUSSIANS), "frame") == [0]


def test_between_frames_the_model_is_interpolated(run: Path) -> None:
    """Between frames it is what the package gives there; beyond the ends, the frame at the end."""
    reader, series = reader_of(run), particlegs.Series(run)
    data = at(reader, 0.53)
    np.testing.assert_array_equal(means(data), series.at(0.53).gaussians.means)
    assert field(data, "frame") == [0, 1]
    assert field(data, "scale_factor") == pytest.approx([0.53])
    assert data.GetInformation().Get(vtkDataObject.DATA_TIME_STEP()) == 0.53
    for time, frame in ((-1.0, 0), (9.0, 2), (0.6 * (1.0 + 1e-9), 1)):
        data = at(reader, time)
        assert field(data, "frame") == [frame]
        np.testing.assert_array_equal(means(data), series[frame].gaussians.means)


def test_all_outputs_follow_the_time(run: Path) -> None:
    """Density and particles are those of the frame; the extent stays that of the first, which filters rely on."""
    reader, series = reader_of(run, RecoverParticles=1, NumberOfParticles=500), particlegs.Series(run)
    points = vtkCellDataToPointData()
    points.SetInputConnection(reader.GetOutputPort(DENSITY))
    shape = series[0].density_grid(8).shape
    assert len({series[frame].density_grid(8).shape for frame in range(3)}) == 3
    for frame in (2, 0, 1, 2):
        grid = series[frame].density_grid(shape)
        points.UpdateTimeStep(TIMES[frame])
        image, after = reader.GetOutputDataObject(DENSITY), points.GetOutput()
        assert image.GetDimensions() == after.GetDimensions() == tuple(n + 1 for n in shape)
        whole = reader.GetOutputInformation(DENSITY).Get(pipeline.WHOLE_EXTENT())
        assert tuple(whole) == image.GetExtent()
        far = np.add(grid.origin, np.multiply(grid.spacing, shape))
        assert after.GetBounds() == pytest.approx(np.transpose([grid.origin, far]).ravel())
        density = vtk_to_numpy(image.GetCellData().GetArray("density"))
        np.testing.assert_array_equal(density, np.asarray(grid).ravel(order="F"))
        particles = at(reader, TIMES[frame], PARTICLES)
        expected = series[frame].recover(500, seed=42)
        np.testing.assert_array_equal(vtk_to_numpy(particles.GetPoints().GetData()), expected.positions)
        assert f"frame {frame}" in particles.GetFieldData().GetAbstractArray("SYNTHETIC").GetValue(0)


def test_a_layer_may_appear_later(snapshots: list[Path], tmp_path: Path) -> None:
    """A frame has its own layers; one that is off stays off in all frames."""
    stars = np.random.default_rng(5).normal(50.0, 1.0, (1000, 3))
    dm = np.random.default_rng(6).normal(50.0, 8.0, (4000, 3))
    later = snapshot(tmp_path / "later.hdf5", 0.6, dm=dm, stars=stars)
    reader = reader_of(series_of([snapshots[0], later], tmp_path / "born.pgs"))
    assert at(reader, 0.5).GetNumberOfBlocks() == 1
    assert at(reader, 0.6).GetNumberOfBlocks() == 2
    layers = reader.GetLayers()
    names = [layers.GetArrayName(i) for i in range(layers.GetNumberOfArrays())]
    assert len(names) == 2
    layers.DisableArray(names[0])
    assert at(reader, 0.6).GetNumberOfBlocks() == 1
    assert at(reader, 0.5).GetNumberOfBlocks() == 0
    layers.EnableArray(names[0])
    layers.DisableArray(names[1])
    assert at(reader, 0.5).GetNumberOfBlocks() == 1


def test_gaps_are_no_steps(snapshots: list[Path], tmp_path: Path) -> None:
    """A frame that is missing is left out, and the others keep their times and numbers."""
    broken = tmp_path / "broken.hdf5"
    broken.write_bytes(b"broken")
    path = series_of([snapshots[0], broken, snapshots[2]], tmp_path / "gap.pgs")
    reader = reader_of(path)
    assert reader.GetOutputInformation(GAUSSIANS).Get(pipeline.TIME_STEPS()) == pytest.approx((0.5, 0.7))
    assert field(at(reader, 0.7), "frame") == [2]
    assert field(at(reader, 0.6), "frame") == [0, 2]


def test_nothing_is_read_twice(run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The series is opened once, and a frame decoded once for all outputs; a changed file is read again."""
    path = tmp_path / "now.pgs"
    path.write_bytes(run.read_bytes())
    opened, decoded = [], []
    series, frame = particlegs.Series, particlegs.Series.__getitem__
    monkeypatch.setattr(particlegs, "Series", lambda where: opened.append(where) or series(where))
    monkeypatch.setattr(series, "__getitem__", lambda self, i: decoded.append(i) or frame(self, i))
    reader = reader_of(path, RecoverParticles=1)
    for time in (0.5, 0.6, 0.7, 0.6, 0.5):
        for port in range(3):
            at(reader, time, port)
    assert len(opened) == 1
    assert decoded == [0, 1, 2]
    path.write_bytes(run.read_bytes() + b"more")
    path.write_bytes(run.read_bytes())
    reader.Refresh()
    at(reader, 0.6)
    assert len(opened) == 2


def test_a_bad_frame_is_one_line(
    run: Path, tmp_path: Path, messages: vtkStringOutputWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame or file that cannot be read gives one line and no data; other frames are shown."""
    series, frame = particlegs.Series, particlegs.Series.__getitem__

    def bad(self: particlegs.Series, number: int) -> particlegs.Model:
        if number == 1:
            raise particlegs.ModelError("run.pgs, frame 1: corrupt model file")
        return frame(self, number)

    plugin._read.cache_clear()
    monkeypatch.setattr(series, "__getitem__", bad)
    reader = reader_of(run)
    assert at(reader, 0.5).GetNumberOfPoints() > 0
    assert messages.GetOutput() == ""
    for port in range(3):
        assert at(reader, 0.6, port).GetNumberOfPoints() == 0
    assert messages.GetOutput().count("\n") == 1
    assert "frame 1" in messages.GetOutput()
    assert at(reader, 0.7).GetNumberOfPoints() > 0
    short = tmp_path / "short.pgs"
    short.write_bytes(run.read_bytes()[:-5])
    before = len(messages.GetOutput())
    assert at(reader_of(short), 0.5).GetNumberOfPoints() == 0
    words = messages.GetOutput()[before:]
    assert words.count("\n") == 1
    assert "short.pgs" in words


def test_a_picture_follows_the_time(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture of a series is that of the frame at the view's time."""
    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetSize(64, 48)
    window.AddRenderer(renderer)
    renderer.GetActiveCamera().SetPosition(50.0, 50.0, 250.0)
    renderer.GetActiveCamera().SetFocalPoint(50.0, 50.0, 50.0)
    proxy = SimpleNamespace(GetRenderer=lambda: renderer, GetGlobalID=lambda: 1)
    view = SimpleNamespace(SMProxy=proxy, ViewTime=0.5, ListProperties=list)
    picture = views.show_picture(str(run), view, radius=1.0)
    series, drawn = particlegs.Series(run), []
    for frame, time in enumerate(TIMES):
        view.ViewTime = time
        window.Render()
        camera = views.camera_of(renderer.GetActiveCamera())
        expected = series[frame].render(camera=camera, size=(64, 48), radius=1.0, opacity=picture.opacity)
        np.testing.assert_array_equal(picture.pixels, expected)
        drawn.append(picture.pixels.copy())
    assert (drawn[0] != drawn[2]).any()
    window.Finalize()
