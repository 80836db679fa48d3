"""Compares the picture of a model in a VTK window with `Model.render`, pixel by pixel."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import particlegs
import pytest
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow, vtkWindowToImageFilter

import particlegs_views as views

CENTRE = (12.5, 12.5, 12.5)


@pytest.fixture
def window() -> Iterator[vtkRenderWindow]:
    """Make an offscreen window with a camera on the sample."""
    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(320, 200)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(30.0, 25.0, 70.0)
    camera.SetFocalPoint(*CENTRE)
    yield window
    window.Finalize()


def grab(window: vtkRenderWindow, scale: int = 1) -> np.ndarray:
    """Read the window's pixels, the top row first; in tiles if it is enlarged."""
    window.Render()
    taker = vtkWindowToImageFilter()
    taker.SetInput(window)
    taker.SetScale(scale)
    taker.ReadFrontBufferOff()
    taker.Update()
    image = taker.GetOutput()
    width, height, _ = image.GetDimensions()
    colours = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1]
    assert (colours[..., :1] == colours).all()
    return colours[..., 0]


def picture(window: vtkRenderWindow, path: Path, **options: object) -> views.Picture:
    """Put a model's picture into a window."""
    return views.Picture(particlegs.read(path), window.GetRenderers().GetFirstRenderer(), **options)


CAMERA = {"position": (30.0, 25.0, 70.0), "focal_point": CENTRE, "view_up": (0.0, 1.0, 0.0)}


def test_the_picture_is_the_packages(window: vtkRenderWindow, sample: Path) -> None:
    """All pixels equal those of `Model.render` for the current camera, radius, opacity and style."""
    shown = picture(window, sample)
    model = shown.model
    camera = particlegs.Camera(**CAMERA, fov_deg=30.0)
    expected = model.render(camera=camera, size=(320, 200))
    assert expected.max() > 100
    np.testing.assert_array_equal(grab(window), expected)
    shown.radius, shown.opacity, shown.style = 0.05, 0.3, "paraview-no-fxaa"
    expected = model.render(camera=camera, size=(320, 200), radius=0.05, opacity=0.3, style="paraview-no-fxaa")
    np.testing.assert_array_equal(grab(window), expected)
    shown.style = "expected"
    levels = 255.0 * model.render(camera=camera, size=(320, 200), radius=0.05, opacity=0.3, style="expected")
    np.testing.assert_allclose(grab(window), levels, atol=0.51)


def test_the_picture_follows_the_camera(window: vtkRenderWindow, sample: Path) -> None:
    """The picture follows another camera, parallel projection and another size of the window."""
    shown = picture(window, sample)
    first = grab(window)
    looking = window.GetRenderers().GetFirstRenderer().GetActiveCamera()
    looking.Azimuth(40.0)
    turned = grab(window)
    assert (turned != first).any()
    camera = particlegs.Camera(looking.GetPosition(), looking.GetFocalPoint(), looking.GetViewUp(), fov_deg=30.0)
    np.testing.assert_array_equal(turned, shown.model.render(camera=camera, size=(320, 200)))
    looking.ParallelProjectionOn()
    looking.SetParallelScale(9.0)
    window.SetSize(200, 240)
    camera = particlegs.Camera(looking.GetPosition(), looking.GetFocalPoint(), looking.GetViewUp(), height=18.0)
    np.testing.assert_array_equal(grab(window), shown.model.render(camera=camera, size=(200, 240)))


def test_enlarged_pictures_are_drawn_whole(window: vtkRenderWindow, sample: Path) -> None:
    """Pictures in tiles, as ParaView saves them if they are larger than the screen."""
    shown = picture(window, sample)
    camera = particlegs.Camera(**CAMERA, fov_deg=30.0)
    expected = shown.model.render(camera=camera, size=(960, 600)).astype(float)
    found = grab(window, scale=3)
    assert found.shape == expected.shape
    # VTK changes the view angle for tiles and changes it back.
    assert np.abs(found - expected).max() <= 1.0


def test_it_is_drawn_once_for_each_view(window: vtkRenderWindow, sample: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing again without a change renders nothing; slow pictures are coarser during rotation."""
    shown = picture(window, sample)
    sizes: list[tuple[int, int]] = []
    model = shown.model

    class Counted:
        def __getattr__(self, name: str) -> object:
            return getattr(model, name)

        def render(self, **options: object) -> np.ndarray:
            sizes.append(options["size"])
            return model.render(**options)

    shown.model = Counted()
    window.Render()
    window.Render()
    assert sizes == [(320, 200)]
    monkeypatch.setattr(views, "TURNING", 1e-9)
    window.SetDesiredUpdateRate(15.0)
    found = grab(window)
    assert sizes[-1] == (40, 25)
    assert (found[:8, :8] == found[0, 0]).all()
    window.SetDesiredUpdateRate(0.002)
    window.Render()
    assert sizes[-1] == (320, 200)


def test_errors_in_the_picture_are_one_line(window: vtkRenderWindow, sample: Path) -> None:
    """An invalid opacity gives one line of error and no picture."""
    before, messages = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(messages)
    try:
        shown = picture(window, sample, opacity=7.0)
        assert grab(window).max() == 0
        words = messages.GetOutput()
        assert words.startswith("particlegs: ")
        assert words.count("\n") == 1
        shown.opacity = 0.05
        assert grab(window).max() > 100
        shown.remove()
        assert grab(window).max() == 0
    finally:
        vtkOutputWindow.SetInstance(before)


def test_the_papers_radius() -> None:
    """0.0406 of the mean spacing of HACC's box: the published 0.01."""
    radius = views.default_radius(np.array([[0.0, 0.0, 0.0], [64.0, 256.0, 256.0]]), 280_953_867)
    assert radius == pytest.approx(0.0099970, rel=1e-4)
    flat = views.default_radius(np.array([[0.0, 0.0, 5.0], [2.0, 1.0, 5.0]]), 4)
    assert flat == pytest.approx(0.0406)


def test_particles_of_vtk_become_a_snapshot(sample: Path) -> None:
    """Positions, masses, box and units are read; data without points are refused."""
    from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData

    import particlegs_reader as plugin

    points = np.random.default_rng(1).uniform(0.0, 4.0, (1000, 3)).astype(np.float32)
    data = plugin.vertices(points)
    data.GetPointData().AddArray(plugin.column("masses", np.arange(1.0, 1001.0)))
    plugin.annotate(data, {"box": [4.0, 4.0, 4.0], "length_unit": "kpc", "mass_unit": "Msun"})
    snapshot = views.snapshot_of(data, name="points")
    assert len(snapshot) == 1000
    np.testing.assert_allclose(snapshot.positions + np.asarray(snapshot.origin), points, atol=1e-6)
    assert np.sum(snapshot.masses) == pytest.approx(500_500.0)
    assert (snapshot.length_unit, snapshot.mass_unit) == ("kpc", "Msun")
    np.testing.assert_allclose(np.diag(snapshot.box), 4.0)
    for empty in (vtkPolyData(), vtkImageData()):
        with pytest.raises(ValueError, match="points"):
            views.snapshot_of(empty, name="nothing")
