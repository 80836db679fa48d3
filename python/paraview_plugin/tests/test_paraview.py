"""The plug-in's reader and picture under plain VTK and pyvista, against the package's own numbers."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path

import numpy as np
import particlegs
import pytest
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkStringOutputWindow
from vtkmodules.vtkFiltersCore import vtkTensorGlyph
from vtkmodules.vtkFiltersSources import vtkSphereSource

import particlegs_reader as plugin
from particlegs_reader import DENSITY, GAUSSIANS, METHODS, PARTICLES, ParticlegsReader


def reader_of(path: Path, **properties: object) -> ParticlegsReader:
    """Make a reader as ParaView does: the setters of its properties, by name."""
    reader = ParticlegsReader()
    reader.SetFileName(str(path))
    for name, value in properties.items():
        getattr(reader, f"Set{name}")(value)
    return reader


def output(reader: ParticlegsReader, port: int) -> object:
    """Update an output."""
    reader.Update(port)
    return reader.GetOutputDataObject(port)


def array(data: object, name: str) -> np.ndarray:
    """Point data by name."""
    return vtk_to_numpy(data.GetPointData().GetArray(name))


def test_gaussians_are_the_packages(sample: Path) -> None:
    """Means, counts and covariances are those of the package, in VTK's order of components."""
    model = particlegs.read(sample)
    blocks = output(reader_of(sample), GAUSSIANS)
    assert blocks.GetNumberOfBlocks() == 1
    block, gaussians = blocks.GetBlock(0), model.gaussians
    assert block.GetNumberOfVerts() == block.GetNumberOfPoints() == len(gaussians.counts)
    assert array(block, "counts").sum() == model.count
    np.testing.assert_array_equal(vtk_to_numpy(block.GetPoints().GetData()), gaussians.means)
    covariance = block.GetPointData().GetArray("covariance")
    assert [covariance.GetComponentName(i) for i in range(6)] == ["XX", "YY", "ZZ", "XY", "YZ", "XZ"]
    for place, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]):
        np.testing.assert_array_equal(vtk_to_numpy(covariance)[:, place], gaussians.covariances[:, i, j])
    assert not block.GetPointData().HasArray("masses")
    assert block.GetFieldData().GetAbstractArray("length_unit").GetValue(0) == "Mpc/h"


def test_the_root_squared_is_the_covariance(sample: Path) -> None:
    """The square root is symmetric and positive, and is the active tensor array."""
    block = output(reader_of(sample), GAUSSIANS).GetBlock(0)
    assert block.GetPointData().GetTensors().GetName() == "sqrt_covariance"
    roots = array(block, "sqrt_covariance").reshape(-1, 3, 3)
    covariances = particlegs.read(sample).gaussians.covariances
    scale = np.trace(covariances, axis1=1, axis2=2)[:, None, None]
    np.testing.assert_allclose(roots @ roots / scale, covariances / scale, atol=1e-12)
    values = np.linalg.eigvalsh(roots)
    assert values.min() > -1e-12
    np.testing.assert_allclose(array(block, "standard_deviations"), values[:, ::-1], atol=1e-9)


def test_layers_are_blocks_and_can_be_left_out(folder: Path) -> None:
    """Each layer is a named block with its own masses; a layer that is off is in no output."""
    path = layered(folder)
    model = particlegs.read(path)
    names = [layer["name"] for layer in model.layers]
    assert len(names) == 2
    reader = reader_of(path, RecoverParticles=1, ComputeDensity=1, Resolution=8)
    blocks = output(reader, GAUSSIANS)
    labels = [blocks.GetMetaData(i).Get(plugin.vtkCompositeDataSet.NAME()) for i in range(2)]
    assert labels == names
    for i, layer in enumerate(model.layers):
        assert array(blocks.GetBlock(i), "counts").sum() == layer["particles"]
    counts = np.bincount(array(output(reader, PARTICLES), "layer"))
    assert counts.tolist() == [layer["particles"] for layer in model.layers]
    reader.GetLayers().DisableArray(names[0])
    assert output(reader, GAUSSIANS).GetNumberOfBlocks() == 1
    assert output(reader, PARTICLES).GetNumberOfPoints() == model.layers[1]["particles"]
    total = output(reader, DENSITY).GetFieldData().GetArray("total").GetValue(0)
    expected = model.density_grid(8, layers=[names[1]])
    assert total == pytest.approx(expected.sum() * np.prod(expected.spacing))
    reader.GetLayers().DisableArray(names[1])
    assert output(reader, GAUSSIANS).GetNumberOfBlocks() == 0
    assert output(reader, PARTICLES).GetNumberOfPoints() == 0


def layered(folder: Path) -> Path:
    """Make a model of two layers by merging two of the same box, each with a mass of its own."""
    path = folder / "layered.pgs"
    if not path.exists():
        random = np.random.default_rng(3)
        file = folder / "two.hdf5"
        import h5py

        with h5py.File(file, "w") as f:
            header = f.create_group("Header").attrs
            header["NumPart_ThisFile"] = header["NumPart_Total"] = np.array([3000, 5000, 0, 0, 0, 0], np.uint32)
            header["MassTable"] = np.array([1.0, 5.0, 0, 0, 0, 0])
            header["BoxSize"], header["NumFilesPerSnapshot"], header["Time"] = 10.0, 1, 1.0
            header["Redshift"], header["HubbleParam"] = 0.0, 0.7
            for kind, number in ((0, 3000), (1, 5000)):
                f[f"PartType{kind}/Coordinates"] = random.uniform(0.0, 10.0, (number, 3))
        particlegs.compress(particlegs.open(file), gaussians=60, effort="fast").save(path)
    return path


def test_masses_are_handed_over(cloud: Path) -> None:
    """Masses of Gaussians and of particles sum to the snapshot's."""
    reader = reader_of(cloud, RecoverParticles=1)
    assert array(output(reader, GAUSSIANS).GetBlock(0), "masses").sum() == pytest.approx(50_000.0, rel=1e-6)
    particles = output(reader, PARTICLES)
    assert array(particles, "masses").sum() == pytest.approx(50_000.0, rel=1e-6)
    assert particles.GetFieldData().GetAbstractArray("mass_unit").GetValue(0) == "Msun"


@pytest.mark.parametrize("method", ["count", "stratified"])
def test_recovered_particles_are_the_packages_and_marked(sample: Path, method: str) -> None:
    """The same particles as from the package, each with a vertex, marked as synthetic."""
    reader = reader_of(sample, RecoverParticles=1, NumberOfParticles=5000, Method=METHODS.index(method), Seed=5)
    particles = output(reader, PARTICLES)
    assert particles.GetNumberOfVerts() == particles.GetNumberOfPoints() == 5000
    expected = particlegs.read(sample).recover(5000, method, seed=5)
    np.testing.assert_array_equal(
        vtk_to_numpy(particles.GetPoints().GetData()), expected.positions + np.asarray(expected.origin)
    )
    mark = particles.GetFieldData().GetAbstractArray("SYNTHETIC").GetValue(0)
    assert f"method {method}" in mark
    assert "seed 5" in mark
    assert output(reader_of(sample, RecoverParticles=1), PARTICLES).GetNumberOfPoints() == 262_144


def test_density_is_the_packages(sample: Path) -> None:
    """Cell data, x fastest, whose sum over cells is the number of particles."""
    grid = particlegs.read(sample).density_grid(24)
    image = output(reader_of(sample, ComputeDensity=1, Resolution=24), DENSITY)
    assert image.GetDimensions() == (25, 25, 25)
    assert image.GetBounds() == pytest.approx((0.0, 25.0) * 3)
    values = vtk_to_numpy(image.GetCellData().GetArray("density"))
    np.testing.assert_array_equal(values.reshape(24, 24, 24).transpose(2, 1, 0), np.asarray(grid))
    assert values.sum() * np.prod(image.GetSpacing()) == pytest.approx(262_144, rel=1e-6)
    assert image.GetFieldData().GetArray("total").GetValue(0) == pytest.approx(262_144, rel=1e-6)
    assert image.GetFieldData().GetAbstractArray("unit").GetValue(0) == grid.unit


def test_fields_are_vectors_and_scalars_of_every_output(flow: Path) -> None:
    """Means and dispersions of Gaussians and of cells, and the values of particles."""
    model = particlegs.read(flow)
    reader = reader_of(flow, RecoverParticles=1, Resolution=16, ComputeFields=1)
    block = output(reader, GAUSSIANS).GetBlock(0)
    velocity = block.GetPointData().GetArray("velocity")
    assert [velocity.GetComponentName(i) for i in range(3)] == ["X", "Y", "Z"]
    np.testing.assert_array_equal(vtk_to_numpy(velocity), model.gaussians.fields["velocity"].means)
    counts = array(block, "counts")
    dispersion = np.sqrt(np.average(array(block, "dispersion_velocity") ** 2, axis=0, weights=counts))
    np.testing.assert_allclose(dispersion, (10.0, 5.0, 20.0), rtol=0.15)
    particles = output(reader, PARTICLES)
    # Means and dispersions are those of the particles drawn; temperature changes along y alone, by 500 K over a cloud.
    squares = (array(block, "temperature") - 1e4) ** 2 + array(block, "dispersion_temperature") ** 2
    rms = np.sqrt(np.average(squares, weights=counts))
    assert rms == pytest.approx(np.sqrt(np.mean((array(particles, "temperature") - 1e4) ** 2)), rel=0.03)
    assert rms == pytest.approx(500.0, rel=0.2)
    assert array(particles, "velocity").shape == (4000, 3)
    np.testing.assert_array_equal(array(particles, "temperature"), model.recover().fields["temperature"])
    image = output(reader, DENSITY)
    cells = vtk_to_numpy(image.GetCellData().GetArray("velocity"))
    grid = np.asarray(model.grid("velocity", 16))
    np.testing.assert_array_equal(cells.reshape(*grid.shape[2::-1], 3).transpose(2, 1, 0, 3), grid)
    assert image.GetCellData().GetScalars().GetName() == "contrast"
    assert image.GetCellData().GetArray("dispersion_temperature").GetNumberOfComponents() == 1


def test_grids_of_boxes_that_are_no_cubes(cloud: Path) -> None:
    """The announced extent equals that of the data, along every axis."""
    grid = particlegs.read(cloud).density_grid(20)
    image = output(reader_of(cloud, ComputeDensity=1, Resolution=20), DENSITY)
    assert len(set(grid.shape)) > 1
    assert image.GetDimensions() == tuple(n + 1 for n in grid.shape)
    cell = image.ComputeCellId((1, 2, 3))
    assert image.GetCellData().GetArray("density").GetValue(cell) == grid[1, 2, 3]
    np.testing.assert_allclose(image.GetOrigin(), grid.origin)


def test_what_is_shown_first_has_a_range_that_shows_it(sample: Path) -> None:
    """The active scalars cover the denser half of the mass without the densest cells, for any contrast."""
    image = output(reader_of(sample, Resolution=24), DENSITY)
    assert image.GetCellData().GetScalars().GetName() == "contrast"
    rng = np.random.default_rng(2)
    for values in (rng.lognormal(0.0, 2.0, (9, 9, 9)), 1.0 + 0.01 * rng.random((9, 9, 9)), np.zeros((2, 2, 2))):
        contrast = plugin.contrast_of(values)
        assert contrast.shape == values.shape
        shown = values[contrast > contrast.min()].sum() / max(values.sum(), 1e-30)
        assert np.isfinite(contrast).all()
        assert values.sum() == 0.0 or 0.45 < shown < 0.95


def test_nothing_is_computed_that_is_not_asked_for(sample: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only requested outputs are computed, and only once."""
    made: list[int] = []
    compute = ParticlegsReader._compute

    def counted(self: ParticlegsReader, port: int, *rest: object) -> object:
        made.append(port)
        return compute(self, port, *rest)

    monkeypatch.setattr(ParticlegsReader, "_compute", counted)
    calls: list[str] = []
    read = plugin.read_model
    monkeypatch.setattr(plugin, "read_model", lambda *where: Watched(read(*where), calls))
    reader = reader_of(sample, ComputeDensity=0)
    for port in (GAUSSIANS, PARTICLES, DENSITY):
        reader.Update(port)
    assert calls == ["gaussians"]
    reader.SetRecoverParticles(1)
    reader.SetNumberOfParticles(100)
    reader.Update(GAUSSIANS)
    assert calls == ["gaussians"]
    reader.Update(PARTICLES)
    reader.Update(GAUSSIANS)
    reader.SetSeed(1)
    reader.Update(PARTICLES)
    assert calls == ["gaussians", "recover", "recover"]
    assert made.count(GAUSSIANS) == 1


class Watched:
    """A model that records calls."""

    def __init__(self, model: object, calls: list[str]) -> None:
        self._model, self._calls = model, calls

    def __getattr__(self, name: str) -> object:
        if name in ("gaussians", "recover", "density_grid"):
            self._calls.append(name)
        return getattr(self._model, name)


def test_a_file_that_changes_is_read_again(sample: Path, cloud: Path, tmp_path: Path) -> None:
    """Refresh reads the current file."""
    path = tmp_path / "now.pgs"
    path.write_bytes(sample.read_bytes())
    reader = reader_of(path)
    assert output(reader, GAUSSIANS).GetNumberOfPoints() > 1000
    path.write_bytes(cloud.read_bytes())
    reader.Refresh()
    assert output(reader, GAUSSIANS).GetNumberOfPoints() == 1


def test_errors_are_one_line(
    sample: Path, tmp_path: Path, messages: vtkStringOutputWindow, capfd: pytest.CaptureFixture[str]
) -> None:
    """Invalid files and numbers give one line of error, no traceback and no data."""
    broken, half = tmp_path / "broken.pgs", tmp_path / "half.pgs"
    broken.write_text("no model\nat all\n")
    half.write_bytes(sample.read_bytes()[: sample.stat().st_size // 2])
    for path in (tmp_path / "missing.pgs", broken, half, tmp_path):
        reader = reader_of(path, RecoverParticles=1, ComputeDensity=1)
        before = len(messages.GetOutput())
        for port in range(3):
            assert output(reader, port).GetNumberOfPoints() == 0
        words = messages.GetOutput()[before:]
        assert words.count("\n") == 1, words
        assert words.startswith("particlegs: ")
        assert path.name in words
    reader = reader_of(sample, RecoverParticles=1, NumberOfParticles=-3)
    before = len(messages.GetOutput())
    assert output(reader, PARTICLES).GetNumberOfPoints() == 0
    assert messages.GetOutput()[before:].count("\n") == 1
    before = len(messages.GetOutput())
    reader = ParticlegsReader()
    reader.Update(GAUSSIANS)
    assert "no file is chosen" in messages.GetOutput()[before:]
    said = capfd.readouterr()
    assert "Traceback" not in said.err + said.out


def test_a_missing_package_is_said(
    sample: Path, messages: vtkStringOutputWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error says which Python lacks the package and what to do."""
    plugin._read.cache_clear()
    monkeypatch.setitem(sys.modules, "particlegs", None)
    reader_of(sample).Update(GAUSSIANS)
    words = messages.GetOutput()
    assert "pip install --target" in words
    assert f"{sys.version_info[0]}.{sys.version_info[1]}" in words
    assert words.count("\n") == 1


def test_progress_is_told_and_work_can_be_stopped(sample: Path, messages: vtkStringOutputWindow) -> None:
    """ParaView gets the progress, and its abort stops the work without an error."""
    reader = reader_of(sample, RecoverParticles=1)
    reader._progress("draw", 1, 4)
    assert reader.GetProgress() == 0.25
    shares: list[float] = []

    def stop(share: float) -> None:
        shares.append(share)
        reader.AbortExecuteOn()

    reader.UpdateProgress = stop
    assert output(reader, PARTICLES).GetNumberOfPoints() == 0
    assert len(shares) == 1
    assert messages.GetOutput() == ""


def test_ellipsoids_have_the_right_extent(cloud: Path) -> None:
    """Glyphs of the square root have the size of the covariance, and so does their picture."""
    model = particlegs.read(cloud)
    blocks = output(reader_of(cloud), GAUSSIANS)
    sphere = vtkSphereSource()
    sphere.SetThetaResolution(200)
    sphere.SetPhiResolution(200)
    glyph = vtkTensorGlyph()
    glyph.SetSourceConnection(sphere.GetOutputPort())
    glyph.SetInputData(blocks.GetBlock(0))
    # The radius of VTK's sphere is 0.5: one standard deviation.
    glyph.SetScaleFactor(2.0)
    glyph.Update()
    deviations = np.sqrt(np.diag(model.gaussians.covariances[0]))
    center = model.gaussians.means[0]
    low, high = np.reshape(glyph.GetOutput().GetBounds(), (3, 2)).T
    np.testing.assert_allclose(high - center, deviations, rtol=1e-3)
    np.testing.assert_allclose(center - low, deviations, rtol=1e-3)
    plotter = pyvista.Plotter(off_screen=True, window_size=(400, 400))
    plotter.set_background("black")
    plotter.add_mesh(pyvista.wrap(glyph.GetOutput()), color="white", lighting=False)
    plotter.camera.parallel_projection = True
    plotter.camera.focal_point = tuple(center)
    plotter.camera.position = tuple(center + (0.0, 0.0, 50.0))
    plotter.camera.up = (0.0, 1.0, 0.0)
    plotter.camera.parallel_scale = 2.0
    plotter.camera.clipping_range = (1.0, 100.0)
    lit = plotter.screenshot(return_img=True)[..., 0] > 127
    plotter.close()
    # 100 pixels per unit.
    columns, rows = np.flatnonzero(lit.any(axis=0)), np.flatnonzero(lit.any(axis=1))
    assert abs(np.ptp(columns) + 1 - 2 * deviations[0] * 100.0) < 1.5
    assert abs(np.ptp(rows) + 1 - 2 * deviations[1] * 100.0) < 1.5
    assert abs(lit.sum() / 1e4 - area(model.gaussians.covariances[0])) < 0.02 * area(model.gaussians.covariances[0])


def area(covariance: np.ndarray) -> float:
    """Area of an ellipsoid's outline along z."""
    return float(np.pi * np.sqrt(np.linalg.det(covariance[:2, :2])))


def test_pyvista_takes_the_outputs(sample: Path) -> None:
    """PyVista can read the outputs, with named blocks and arrays."""
    blocks = pyvista.wrap(output(reader_of(sample), GAUSSIANS))
    assert blocks.keys() == ["particles"]
    assert blocks[0]["sqrt_covariance"].shape == (blocks[0].n_points, 9)
    image = pyvista.wrap(output(reader_of(sample, ComputeDensity=1, Resolution=16), DENSITY))
    assert image.cell_data["density"].shape == (16**3,)


def test_old_plugins_find_getargspec() -> None:
    """`inspect.getargspec`, which ParaView 5.11 needs, exists and gives the arguments."""
    assert inspect.getargspec(reader_of).args == ["path"]
    import usercustomize

    assert usercustomize.inspect is inspect
