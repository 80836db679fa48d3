"""Tests that need ParaView, run by pvbatch (test.sh).

pvbatch in_paraview.py SNAPSHOT FOLDER
"""

from __future__ import annotations

import json
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import particlegs
from paraview import servermanager, simple
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand, vtkOutputWindow
from vtkmodules.vtkIOImage import vtkPNGReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

PLUGIN = Path(__file__).resolve().parents[1]


def levels(path: str) -> np.ndarray:
    """Read the first colour of a picture, the top row first."""
    reader = vtkPNGReader()
    reader.SetFileName(path)
    reader.Update()
    image = reader.GetOutput()
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1, :, 0].astype(float)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio of two pictures, dB."""
    return float(10.0 * np.log10(255.0**2 / max(np.mean((a - b) ** 2), 1e-12)))


def messages_of(work: object) -> list[str]:
    """Collect the error messages that ParaView shows during some work."""
    lines: list[str] = []
    window = vtkOutputWindow.GetInstance()

    def note(_window: object, _event: str, text: str) -> None:
        lines.append(text)

    note.CallDataType = "string0"
    observers = [window.AddObserver(e, note) for e in (vtkCommand.ErrorEvent, vtkCommand.WarningEvent)]
    work()
    for observer in observers:
        window.RemoveObserver(observer)
    return lines


def check_reader(model_file: str) -> None:
    """Check that `OpenDataFile` gives the reader, and that its outputs agree with the package."""
    model = particlegs.read(model_file)
    reader = simple.OpenDataFile(model_file)
    assert reader.SMProxy.GetXMLName() == "ParticlegsReader"
    assert [reader.SMProxy.GetOutputPortName(i) for i in range(3)] == ["Density", "Recovered particles", "Gaussians"]
    view = simple.CreateView("RenderView")
    for port in range(3):
        simple.Show(simple.OutputPort(reader, port), view)
    simple.Render(view)
    sizes = [reader.GetDataInformation(port).GetNumberOfPoints() for port in range(3)]
    assert sizes == [129**3, 0, len(model.gaussians.counts)], sizes
    shown = simple.GetRepresentation(reader, view)
    assert shown.Representation == "Volume"
    assert list(shown.ColorArrayName) == ["CELLS", "contrast"]
    shown = simple.GetRepresentation(simple.OutputPort(reader, 1), view)
    assert shown.Representation == "Point Gaussian"
    assert abs(shown.GaussianRadius / model.radius - 1.0) < 1e-6
    assert abs(shown.Opacity / model.opacity - 1.0) < 1e-6
    reader.RecoverParticles, reader.NumberOfParticles, reader.Method = 1, 4000, "stratified"
    reader.Resolution = 20
    simple.Render(view)
    particles = servermanager.Fetch(reader, idx=1)
    found = vtk_to_numpy(particles.GetPoints().GetData())
    np.testing.assert_array_equal(found, model.recover(4000, "stratified").positions)
    assert "stratified" in particles.GetFieldData().GetAbstractArray("SYNTHETIC").GetValue(0)
    image = servermanager.Fetch(reader, idx=0)
    total = vtk_to_numpy(image.GetCellData().GetArray("density")).sum() * np.prod(image.GetSpacing())
    assert abs(total / model.count - 1.0) < 1e-6
    assert reader.Layers == ["particles"] or list(reader.Layers)[:1] == ["particles"]
    reader.Layers = []
    reader.UpdatePipeline()
    assert reader.GetDataInformation(2).GetNumberOfPoints() == 0
    simple.Delete(view)
    simple.Delete(reader)


def check_errors(folder: Path) -> None:
    """Check that errors have one line each."""
    broken = folder / "broken.pgs"
    broken.write_text("no model")
    for path, words in ((folder / "missing.pgs", "No such file"), (broken, "corrupt model file")):
        lines = messages_of(lambda path=path: simple.ParticlegsReader(FileName=str(path)).UpdatePipeline())
        assert len(lines) == 1, lines
        assert words in lines[0], lines
        assert len(lines[0].strip().splitlines()) == 1, lines
    for source in simple.GetSources().values():
        simple.Delete(source)


def check_macros(model_file: str, truth_file: str, folder: Path) -> None:
    """Run the macros with various selections."""
    lines = messages_of(lambda: runpy.run_path(str(PLUGIN / "point_gaussian.py"), run_name="__main__"))
    assert len(lines) == 1, lines
    assert "no source is selected" in lines[0], lines
    truth = simple.OpenDataFile(truth_file)
    simple.SetActiveSource(truth)
    runpy.run_path(str(PLUGIN / "point_gaussian.py"), run_name="__main__")
    shown = simple.GetRepresentation(truth, simple.GetActiveView())
    model = particlegs.read(model_file)
    assert shown.Representation == "Point Gaussian"
    assert abs(shown.GaussianRadius / model.radius - 1.0) < 1e-6
    assert shown.Opacity == 0.05
    runpy.run_path(str(PLUGIN / "vtp_to_pgs.py"), run_name="__main__")
    made = folder / "truth.pgs"
    assert particlegs.read(made).count == model.count
    assert simple.GetActiveSource().FileName == str(made)
    simple.SetActiveSource(truth)
    before = made.read_bytes()
    lines = messages_of(lambda: runpy.run_path(str(PLUGIN / "vtp_to_pgs.py"), run_name="__main__"))
    assert "exists already" in lines[0], lines
    assert made.read_bytes() == before
    simple.SetActiveSource(truth)
    runpy.run_path(str(PLUGIN / "compare.py"), run_name="__main__")
    left, right = simple.GetRenderViews()[-2:]
    left.CameraPosition = [40.0, 30.0, 60.0]
    simple.Render(left)
    assert list(right.CameraPosition) == [40.0, 30.0, 60.0]


def check_picture(model_file: str, truth_file: str, folder: Path) -> None:
    """Compare the view with `Model.render`, pixel by pixel, for any size, radius and opacity."""
    import particlegs_views as views

    truth_view, picture_view = simple.CreateView("RenderView"), simple.CreateView("RenderView")
    truth, reader = simple.OpenDataFile(truth_file), simple.OpenDataFile(model_file)
    picture = views.compare(reader, truth, truth_view, picture_view)
    for view in (truth_view, picture_view):
        views.place_camera(view, picture.model.bounds, 30.0, 20.0, 0.8)
        view.ViewSize = [640, 480]
    path = str(folder / "picture.png")
    for size in ((640, 480), (2600, 1400)):
        simple.SaveScreenshot(path, picture_view, ImageResolution=list(size))
        options = {"size": size, "radius": picture.radius, "opacity": picture.opacity}
        expected = picture.model.render(30.0, 20.0, 0.8, **options)
        assert np.abs(levels(path) - expected).max() <= 1.0
    simple.SaveScreenshot(path, picture_view, ImageResolution=[960, 720])
    ours = levels(path)
    simple.SaveScreenshot(path, truth_view, ImageResolution=[960, 720])
    score = psnr(ours, levels(path))
    print(f"model's picture against Point Gaussian of all particles: {score:.1f} dB")
    assert score > 30.0
    assert psnr(np.zeros_like(ours), levels(path)) < score - 3.0
    simple.GetRepresentation(truth, truth_view).Opacity = 0.4
    simple.SaveScreenshot(path, picture_view, ImageResolution=[960, 720])
    assert picture.opacity == 0.4
    assert levels(path).mean() > 1.5 * ours.mean()


def check_series(snapshot: str, folder: Path) -> None:
    """Check that the frames of a series are time steps, and that a picture follows the time."""
    import particlegs_views as views

    for frame, redshift in enumerate((1.0, 0.0)):
        shutil.copytree(snapshot, folder / f"frame_{frame}")
        about = folder / f"frame_{frame}" / "meta.json"
        about.write_text(json.dumps({**json.loads(about.read_text()), "redshift": redshift}))
        column = about.with_name("xx.f32")
        ((np.fromfile(column, np.float32) + 5.0 * frame) % 25.0).astype(np.float32).tofile(column)
    series_file = str(folder / "run.pgs")
    # The wheel's command lies beside the package.
    command = os.environ.get("PARTICLEGS", str(Path(particlegs.__file__).parents[1] / "bin" / "particlegs"))
    frames = [folder / f"frame_{frame}" for frame in range(2)]
    subprocess.run([command, "series", *frames, "-o", series_file, "--ratio", "300", "--quiet"], check=True)
    series = particlegs.Series(series_file)
    reader = simple.OpenDataFile(series_file)
    assert list(reader.TimestepValues) == [0.5, 1.0]
    reader.Resolution = 20
    view = simple.CreateView("RenderView")
    simple.Show(reader, view)
    gaussians = simple.Show(simple.OutputPort(reader, 2), view)
    gaussians.SetRepresentationType("Points")
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    picture = views.show_picture(series_file, view)
    for time, model in ((1.0, series[1]), (0.5, series[0]), (0.75, series.at(0.75)), (1.0, series[1])):
        scene.AnimationTime = time
        simple.Render(view)
        block = servermanager.Fetch(reader, idx=2).GetBlock(0)
        np.testing.assert_array_equal(vtk_to_numpy(block.GetPoints().GetData()), model.gaussians.means)
        density = vtk_to_numpy(servermanager.Fetch(reader, idx=0).GetCellData().GetArray("density"))
        np.testing.assert_array_equal(density, np.asarray(model.density_grid(20)).ravel(order="F"))
        np.testing.assert_array_equal(picture.model.gaussians.means, model.gaussians.means)
    views.hide_picture(view)
    simple.Delete(view)
    simple.Delete(reader)


def main() -> None:
    """Make a model and its particles as VTP, then check."""
    snapshot, folder = sys.argv[1], Path(sys.argv[2])
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    truth_file, model_file = str(folder / "truth.vtp"), str(folder / "sample.pgs")
    particles = particlegs.open(snapshot)
    particlegs.compress(particles, ratio=65, effort="fast").save(model_file)
    # As a user does: with the plug-in manager if PYTHONPATH has this folder, otherwise as a script.
    if "usercustomize" in sys.modules:
        simple.LoadPlugin(str(PLUGIN / "particlegs_reader.py"), remote=False, ns=vars(simple))
    else:
        runpy.run_path(str(PLUGIN / "particlegs_reader.py"), run_name="__main__")
    import particlegs_reader

    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(truth_file)
    writer.SetInputData(particlegs_reader.vertices(particles.positions))
    writer.Write()
    check_reader(model_file)
    check_errors(folder)
    check_macros(model_file, truth_file, folder)
    check_picture(model_file, truth_file, folder)
    check_series(snapshot, folder)
    print("in ParaView: all as it should be", flush=True)


try:
    main()
except BaseException:
    import traceback

    traceback.print_exc()
    sys.stderr.flush()
    os._exit(1)
