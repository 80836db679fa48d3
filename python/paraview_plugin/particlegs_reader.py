"""ParaView plug-in: shows `.pgs` models and series as a density, as synthetic particles and as Gaussians.

Load this file in ParaView (Tools, Manage Plugins, Load New), or run it there as a script. A script also works if
the plug-in manager cannot load plug-ins (ParaView 5.11 with Python 3.11 or newer). ParaView's Python must be able
to import the package `particlegs`. Everything except the registration also runs under plain VTK.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import (
    vtkCommand,
    vtkDataArray,
    vtkDataArraySelection,
    vtkOutputWindow,
    vtkPoints,
    vtkStringArray,
)
from vtkmodules.vtkCommonDataModel import (
    vtkCellArray,
    vtkCompositeDataSet,
    vtkDataObject,
    vtkImageData,
    vtkMultiBlockDataSet,
    vtkPolyData,
)
from vtkmodules.vtkCommonExecutionModel import (
    vtkAlgorithm,
    vtkDemandDrivenPipeline,
    vtkStreamingDemandDrivenPipeline,
)

Method = Literal["count", "volume", "ellipsoid", "grid", "stratified", "spaced"]

if TYPE_CHECKING:
    from particlegs import Grid, Model, Series, Snapshot

if not hasattr(inspect, "getargspec"):
    # ParaView 5.11's decorators need it, but Python 3.11 removed it. They use only `args`.
    inspect.getargspec = inspect.getfullargspec  # type: ignore[attr-defined]

try:
    from paraview.util.vtkAlgorithm import smhint, smproperty, smproxy
except ImportError:

    class _Undecorated:
        """Replaces ParaView's decorators under plain VTK, without any effect."""

        def __getattr__(self, _name: str) -> Callable[..., Callable[[Any], Any]]:
            return lambda *_args, **_options: lambda decorated: decorated

    smhint = smproperty = smproxy = _Undecorated()

paraview_plugin_name = "particlegs"
paraview_plugin_version = "0.1.0"

# ParaView shows the first output when it opens a model.
DENSITY, PARTICLES, GAUSSIANS = range(3)
PORTS = ("vtkImageData", "vtkPolyData", "vtkMultiBlockDataSet")
METHODS: tuple[Method, ...] = ("count", "volume", "ellipsoid", "grid", "stratified", "spaced")

# VTK's order of components of symmetric and of general tensors.
SYMMETRIC = ("XX", "YY", "ZZ", "XY", "YZ", "XZ")
TENSOR = ("XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ")

# Keeps the density of Gaussians without extent finite.
LEAST_VOLUME = 1e-30


# Models


def read_model(path: str, time: float | None = None) -> Model:
    """Read a model, alone in its file or of a series; it is cached until the file changes.

    Parameters
    ----------
    path : str
        A `.pgs` file.
    time : float, optional
        A time of a series; see `moment_of`.

    Returns
    -------
    particlegs.Model

    Raises
    ------
    RuntimeError
        If this Python does not have the package.
    OSError, particlegs.InputError, particlegs.ModelError
        If the file cannot be read or is not a model.
    """
    series = read_series(path)
    return _read(os.fspath(path), *stamp(path), None if series is None else moment_of(series, time))


def read_series(path: str) -> Series | None:
    """Read a series; it is cached until the file changes.

    Parameters
    ----------
    path : str
        A `.pgs` file.

    Returns
    -------
    particlegs.Series or None
        None if the file does not begin like a series.

    Raises
    ------
    RuntimeError
        If this Python does not have the package.
    OSError, particlegs.ModelError
        If the file cannot be read or is corrupt.
    """
    package()
    return _read_series(os.fspath(path), *stamp(path))


def times_of(series: Series) -> np.ndarray:
    """Give what the clock of a series shows for each frame that is there, (n,), rising; there is at least one."""
    times = series.times[np.isfinite(series.times)]
    if times.size == 0:
        raise ValueError(f"{series.name}: all frames of the series are missing")
    return times


def moment_of(series: Series, time: float | None) -> float:
    """Give the time at which a series is shown.

    Parameters
    ----------
    series : particlegs.Series
    time : float or None
        What the clock of the series shows; None for the first frame.

    Returns
    -------
    float
        The time of the first or the last frame where it would lie outside the series, and that of a frame where it
        differs from that by rounding alone.
    """
    times = times_of(series)
    if time is None:
        return float(times[0])
    near = times[np.abs(times - time).argmin()]
    return float(near if np.isclose(near, time, rtol=1e-6, atol=0.0) else np.clip(time, times[0], times[-1]))


def frames_of(series: Series, moment: float) -> list[int]:
    """Give the number of the frame at a time of `moment_of`; between frames those of both."""
    before, after = np.flatnonzero(series.times <= moment)[-1], np.flatnonzero(series.times >= moment)[0]
    return sorted({int(before), int(after)})


def package() -> Any:
    """Import the package `particlegs`.

    Raises
    ------
    RuntimeError
        If this Python does not have it; the message says what to do.
    """
    try:
        import particlegs
    except ImportError as missing:
        version = ".".join(map(str, sys.version_info[:2]))
        raise RuntimeError(
            f"ParaView's Python {version} cannot import the package particlegs ({missing}): "
            "run pip install --target DIR particlegs, and start ParaView with PYTHONPATH=DIR"
        ) from None
    return particlegs


def cells_of(path: str, cells: int) -> int | tuple[int, int, int]:
    """Give the number of cells of grids of a model, or of all frames of a series.

    Parameters
    ----------
    path : str
        A `.pgs` file.
    cells : int
        Cells along the longest edge.

    Returns
    -------
    int or three
        `cells`; of a series those along x, y and z in its first frame. VTK's filters keep the extent of the first time
        that they see, and would cut off what lies beyond it later.
    """
    return cells if read_series(path) is None else _shape(os.fspath(path), *stamp(path), cells)


def stamp(path: str) -> tuple[int, int]:
    """Give the time of the last change (ns) and length (bytes) of a file, to detect changes."""
    about = os.stat(path)
    return about.st_mtime_ns, about.st_size


@functools.lru_cache(maxsize=2)
def _read_series(path: str, _changed: int, _length: int) -> Series | None:
    from particlegs._series import is_series

    return package().Series(path) if is_series(path) else None


@functools.lru_cache(maxsize=4)
def _read(path: str, changed: int, length: int, moment: float | None) -> Model:
    series = _read_series(path, changed, length)
    if series is None or moment is None:
        return package().read(path)
    frames = frames_of(series, moment)
    return series[frames[0]] if len(frames) == 1 else series.at(moment)


@functools.lru_cache(maxsize=4)
def _shape(path: str, changed: int, length: int, cells: int) -> tuple[int, int, int]:
    series = _read_series(path, changed, length)
    assert series is not None
    nx, ny, nz = _read(path, changed, length, moment_of(series, None)).density_grid(cells).shape
    return nx, ny, nz


def one_line(error: BaseException) -> str:
    """Format an error in one line, with its type if the message alone is not clear."""
    words = " ".join(str(error).split())
    if isinstance(error, OSError) and error.filename and error.strerror:
        words = f"{error.filename}: {error.strerror}"
    plain = isinstance(error, (OSError, RuntimeError, ValueError, MemoryError)) and words
    return f"particlegs: {words if plain else f'{type(error).__name__}: {words}'}"


def report(error: BaseException) -> None:
    """Show an error as one line in the message window of ParaView or VTK."""
    try:
        from paraview import print_error
    except ImportError:
        vtkOutputWindow.GetInstance().DisplayErrorText(one_line(error))
    else:
        print_error(one_line(error))


# From models to data sets


def column(name: str, values: np.ndarray, components: Iterable[str] = ()) -> vtkDataArray:
    """Copy (n,) or (n, c) numbers to a named VTK array."""
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    for index, component in enumerate(components):
        array.SetComponentName(index, component)
    return array


def annotate(data: vtkDataObject, facts: Mapping[str, object]) -> None:
    """Add texts and numbers to the field data, except None."""
    for name, fact in facts.items():
        if fact is None:
            continue
        if isinstance(fact, str):
            text = vtkStringArray()
            text.SetName(name)
            text.InsertNextValue(fact)
            data.GetFieldData().AddArray(text)
        else:
            numbers = np.atleast_1d(np.asarray(fact, dtype=np.float64))
            data.GetFieldData().AddArray(column(name, numbers))


def free_name(data: vtkDataObject, name: str) -> str:
    """Give a name for an array of a field that no other point or cell data have."""
    taken = data.GetPointData().HasArray(name) or data.GetCellData().HasArray(name)
    return f"field_{name}" if taken else name


def add_field(data: vtkDataObject, field: str, values: Iterable[np.ndarray], unit: str | None) -> None:
    """Add a field to point data, or to the cell data of an image, with its unit as field data.

    Parameters
    ----------
    data : vtkDataObject
    field : str
        Its name.
    values : one or two ndarrays, (n,) or (n, 3)
        Means and dispersions; of a sum over particles its totals alone.
    unit : str or None
        Unit of the means. Dispersions of logarithmic fields are in dex.
    """
    name = free_name(data, field)
    to = data.GetCellData() if isinstance(data, vtkImageData) else data.GetPointData()
    for label, numbers in zip((name, f"dispersion_{name}"), values):
        to.AddArray(column(label, numbers, "XYZ" if numbers.ndim == 2 else ()))
    annotate(data, {f"{name}_unit": unit})


def facts_of(model: Model) -> dict[str, object]:
    """List the field data that every output has."""
    about = model.metadata
    return {
        "model": model.name,
        "length_unit": model.length_unit,
        "mass_unit": model.mass_unit,
        "particles": model.count,
        "box": model.box,
        "default_radius": model.radius,
        "default_opacity": model.opacity,
        "verdict": str(model.verdict),
        "scale_factor": about["scale_factor"],
        "redshift": about["redshift"],
        "time": about["time"],
        "time_step": about["step"],
    }


def vertices(points: np.ndarray) -> vtkPolyData:
    """Make points, each with a vertex.

    Parameters
    ----------
    points : ndarray, (n, 3)
        World units; float32 stays float32.

    Returns
    -------
    vtkPolyData
    """
    positions, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    positions.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    n = len(points)
    if n < 2**31 - 1:
        offsets, ids = (numpy_to_vtk(np.arange(n + more, dtype=np.int32), deep=True) for more in (1, 0))
    else:
        offsets, ids = (numpy_to_vtkIdTypeArray(np.arange(n + more), deep=True) for more in (1, 0))
    cells.SetData(offsets, ids)
    data.SetPoints(positions)
    data.SetVerts(cells)
    return data


def square_roots(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Take the symmetric square roots of covariances.

    Parameters
    ----------
    covariances : ndarray, (n, 3, 3)
        Symmetric; world units squared.

    Returns
    -------
    roots : ndarray, (n, 3, 3)
        Symmetric; `root @ root` is the covariance; world units.
    deviations : ndarray, (n, 3)
        Standard deviations along the principal axes (eigenvalues of the roots), the largest first.
    """
    values, axes = np.linalg.eigh(covariances)
    deviations = np.sqrt(np.clip(values, 0.0, None))
    return np.einsum("nik,nk,njk->nij", axes, deviations, axes), deviations[:, ::-1]


def has_field(model: Model, name: str, layers: list[str] | None) -> bool:
    """Tell whether any of the layers has a field."""
    gaussians = model.gaussians
    means = gaussians.fields[name].means
    return any(
        np.isfinite(means[rows]).any() for layer, rows in gaussians.layers.items() if layers is None or layer in layers
    )


def gaussians_of(
    model: Model, layers: list[str] | None = None, facts: Mapping[str, object] | None = None
) -> vtkMultiBlockDataSet:
    """Make a block of points for each layer, with a point for each Gaussian.

    Parameters
    ----------
    model : particlegs.Model
    layers : list of str, optional
        Names of the layers to use; all by default.
    facts : mapping, optional
        Field data, see `annotate`; those of `facts_of` by default.

    Returns
    -------
    vtkMultiBlockDataSet
        Named blocks with the point data `counts`, `masses` (if known), `covariance` (`SYMMETRIC`), `sqrt_covariance`
        (`TENSOR`, the active tensors), `standard_deviations`, `number_density` at the mean, and of each field its mean
        there, by its name, and its `dispersion_NAME` over the Gaussian; vectors have three components.
    """
    gaussians = model.gaussians
    blocks = vtkMultiBlockDataSet()
    facts = facts_of(model) if facts is None else facts
    annotate(blocks, facts)
    for name, rows in gaussians.layers.items():
        if layers is not None and name not in layers:
            continue
        covariances, counts = gaussians.covariances[rows], gaussians.counts[rows]
        roots, deviations = square_roots(covariances)
        block = vertices(np.asarray(gaussians.means[rows], dtype=np.float64))
        annotate(block, {"layer": name, **facts})
        of_points = block.GetPointData()
        of_points.AddArray(column("counts", counts))
        if gaussians.masses is not None:
            of_points.AddArray(column("masses", gaussians.masses[rows]))
        six = covariances[:, (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)]
        of_points.AddArray(column("covariance", six, SYMMETRIC))
        of_points.AddArray(column("sqrt_covariance", roots.reshape(-1, 9), TENSOR))
        of_points.AddArray(column("standard_deviations", deviations, ("1", "2", "3")))
        volumes = (2.0 * np.pi) ** 1.5 * deviations.prod(axis=1)
        of_points.AddArray(column("number_density", counts / np.maximum(volumes, LEAST_VOLUME)))
        for field, moments in gaussians.fields.items():
            means, slopes, spreads = (values[rows] for values in moments)
            # One more axis for the components of a vector.
            shape = covariances if means.ndim == 1 else covariances[:, None]
            own = spreads if means.ndim == 1 else np.diagonal(spreads, axis1=1, axis2=2)
            # Of all particles of the Gaussian: the change across it counts.
            variances = np.einsum("...i,...ij,...j->...", slopes, shape, slopes) + own
            kind = model.fields[field].kind
            scale = np.log(10.0) if kind == "logarithmic" else 1.0
            values = (means,) if kind == "sum" else (means, np.sqrt(variances) / scale)
            add_field(block, field, values, model.fields[field].unit)
        of_points.SetActiveScalars("counts")
        of_points.SetActiveTensors("sqrt_covariance")
        index = blocks.GetNumberOfBlocks()
        blocks.SetBlock(index, block)
        blocks.GetMetaData(index).Set(vtkCompositeDataSet.NAME(), name)
    return blocks


def particles_of(snapshot: Snapshot, facts: Mapping[str, object]) -> vtkPolyData:
    """Make points from particles.

    Parameters
    ----------
    snapshot : particlegs.Snapshot
    facts : mapping
        Other field data; see `annotate`.

    Returns
    -------
    vtkPolyData
        Vertices with the point data `masses` and `weights` (if known), fields, and `layer` if there are several;
        float64 if the origin is not 0.
    """
    positions = snapshot.positions
    if np.any(snapshot.origin):
        positions = positions + np.asarray(snapshot.origin, dtype=np.float64)
    data = vertices(positions)
    of_points = data.GetPointData()
    for name, values in (("masses", snapshot.masses), ("weights", snapshot.weights)):
        if values is not None:
            of_points.AddArray(column(name, np.broadcast_to(values, len(positions))))
    for name, values in snapshot.fields.items():
        of_points.AddArray(column(free_name(data, name), values, "XYZ" if values.ndim == 2 else ()))
    if len(snapshot.layers) > 1:
        layer = np.zeros(len(positions), dtype=np.int32)
        for number, rows in enumerate(snapshot.layers.values()):
            layer[rows] = number
        of_points.AddArray(column("layer", layer))
    annotate(data, {**facts, "layers": ", ".join(snapshot.layers)})
    return data


def contrast_of(values: np.ndarray) -> np.ndarray:
    """Take the logarithm of density / mean density, clipped so that ParaView's default colours show it well.

    Parameters
    ----------
    values : ndarray
        Densities of cells of equal size.

    Returns
    -------
    ndarray
        Logarithms to base 10 in the shape of `values`. The lower limit is five mean densities, or the density above
        which half of the mass lies, if that is less: otherwise voids would hide the rest. The upper limit is the
        density below which 99 % of the mass lies.
    """
    mean = float(values.mean()) or 1.0
    ordered = np.sort(values, axis=None)
    mass = np.cumsum(ordered, dtype=np.float64)
    half, most = (float(ordered[np.searchsorted(mass, share * mass[-1])]) / mean for share in (0.5, 0.99))
    low = min(5.0, half) or 1.0
    return np.log10(np.clip(values / mean, low, max(most, 1.01 * low)))


def density_of(grid: Grid, facts: Mapping[str, object], fields: Iterable[tuple[Grid, Grid]] = ()) -> vtkImageData:
    """Make an image with the cell data `density` (averages over cells, float64) and `contrast`, which is shown.

    Parameters
    ----------
    grid : particlegs.Grid
        Indexed [i, j, k] along x, y, z.
    facts : mapping
        Other field data; see `annotate`.
    fields : iterable of two particlegs.Grid
        Means and dispersions of fields in the same cells.

    Returns
    -------
    vtkImageData
        With field data `unit` and `total`, the sum over cells times the volume of a cell. For `contrast` see
        `contrast_of`.
    """
    image = vtkImageData()
    image.SetOrigin(*map(float, grid.origin))
    image.SetSpacing(*map(float, grid.spacing))
    image.SetDimensions(*(int(n) + 1 for n in grid.shape))
    values = np.asarray(grid)
    image.GetCellData().AddArray(column("density", values.ravel(order="F")))
    image.GetCellData().SetScalars(column("contrast", contrast_of(values).ravel(order="F")))
    total = float(values.sum() * np.prod(grid.spacing))
    annotate(image, {**facts, "unit": grid.unit, "total": total})
    for grids in fields:
        # x is the fastest; the components of a vector stay together.
        values = (np.moveaxis(np.asarray(v), (0, 1, 2), (2, 1, 0)).reshape(-1, *v.shape[3:]) for v in grids)
        add_field(image, str(grids[0].field), values, grids[0].unit or None)
    return image


# The reader


class _Stopped(Exception):
    """The user stopped the work."""


def asked_time(about: Any) -> float | None:
    """Give the time that the information of an output asks for, or None."""
    key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
    return float(about.Get(key)) if about.Has(key) else None


PROPERTIES = """
<OutputPort name="Density" index="0"/>
<OutputPort name="Recovered particles" index="1"/>
<OutputPort name="Gaussians" index="2"/>
<StringVectorProperty name="FileName" command="SetFileName" number_of_elements="1" panel_visibility="never">
  <FileListDomain name="files"/>
  <Documentation>Model file or series written by particlegs.</Documentation>
</StringVectorProperty>
<DoubleVectorProperty name="TimestepValues" repeatable="1" information_only="1" si_class="vtkSITimeStepsProperty">
  <Documentation>Scale factor, time, time step or number of each frame of a series.</Documentation>
</DoubleVectorProperty>
<StringVectorProperty name="LayersInfo" command="GetLayers" number_of_elements_per_command="2"
    information_only="1" si_class="vtkSIDataArraySelectionProperty"/>
<StringVectorProperty name="Layers" command="GetLayers" information_property="LayersInfo" repeat_command="1"
    number_of_elements_per_command="2" element_types="2 0" si_class="vtkSIDataArraySelectionProperty">
  <ArraySelectionDomain name="array_list">
    <RequiredProperties><Property function="ArrayList" name="LayersInfo"/></RequiredProperties>
  </ArraySelectionDomain>
  <Documentation>Layers of the model to show in all outputs.</Documentation>
</StringVectorProperty>
<IntVectorProperty name="RecoverParticles" label="Recover Particles" command="SetRecoverParticles"
    number_of_elements="1" default_values="0">
  <BooleanDomain name="bool"/>
  <Documentation>Draw SYNTHETIC particles from the model for the second output.</Documentation>
</IntVectorProperty>
<IntVectorProperty name="NumberOfParticles" label="Number Of Particles" command="SetNumberOfParticles"
    number_of_elements="1" default_values="0">
  <IntRangeDomain name="range" min="0"/>
  <Documentation>Number of particles to draw; 0 means as many as in the snapshot.</Documentation>
</IntVectorProperty>
<IntVectorProperty name="Method" command="SetMethod" number_of_elements="1" default_values="0">
  <EnumerationDomain name="enum">{methods}</EnumerationDomain>
  <Documentation>Method of drawing particles, as in `particlegs recover`.</Documentation>
</IntVectorProperty>
<IntVectorProperty name="Seed" command="SetSeed" number_of_elements="1" default_values="42"
    panel_visibility="advanced">
  <IntRangeDomain name="range" min="0"/>
  <Documentation>Random seed; the same seed gives the same particles.</Documentation>
</IntVectorProperty>
<IntVectorProperty name="ComputeDensity" label="Compute Density" command="SetComputeDensity"
    number_of_elements="1" default_values="1">
  <BooleanDomain name="bool"/>
  <Documentation>Compute the density on a grid for the first output.</Documentation>
</IntVectorProperty>
<IntVectorProperty name="Resolution" command="SetResolution" number_of_elements="1" default_values="128">
  <IntRangeDomain name="range" min="1" max="4096"/>
  <Documentation>Number of cells along the longest edge of the grid.</Documentation>
</IntVectorProperty>
<IntVectorProperty name="ComputeFields" label="Compute Fields" command="SetComputeFields"
    number_of_elements="1" default_values="0">
  <BooleanDomain name="bool"/>
  <Documentation>Add mean and dispersion of every field, such as velocity, to the first output.</Documentation>
</IntVectorProperty>
<Property name="Refresh" command="Refresh" panel_visibility="never"/>
<PropertyGroup label="Recovered Particles (synthetic)">
  <Property name="RecoverParticles"/><Property name="NumberOfParticles"/><Property name="Method"/>
  <Property name="Seed"/>
</PropertyGroup>
<PropertyGroup label="Density">
  <Property name="ComputeDensity"/><Property name="Resolution"/><Property name="ComputeFields"/>
</PropertyGroup>
""".format(methods="".join(f'<Entry value="{i}" text="{name}"/>' for i, name in enumerate(METHODS)))


@smproxy.reader(
    name="ParticlegsReader",
    label="Particlegs Reader",
    extensions="pgs",
    file_description="particlegs models",
    support_reload=False,
)
@smhint.xml('<ReloadFiles property="Refresh"/>')
@smhint.xml('<RepresentationType view="RenderView" port="0" type="Volume"/>')
@smhint.xml('<RepresentationType view="RenderView" port="1" type="Point Gaussian"/>')
@smhint.xml('<View type="None" port="2"/>')
@smproperty.xml(PROPERTIES)
class ParticlegsReader(VTKPythonAlgorithmBase):
    """Reads a `.pgs` model, or a series, whose frames are time steps.

    Output 0 is the density on a grid, unless it is switched off by `SetComputeDensity`. Output 1 contains particles
    drawn from the Gaussians if `SetRecoverParticles` is on; it is off by default because ParaView updates all outputs
    of a source before it shows one. Output 2 contains the Gaussians, as a block of points for each layer. An output is
    computed again only if its options have changed. In parallel, the first process has all data.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=3, outputType=PORTS[DENSITY])
        self._path: str | None = None
        self._options: dict[str, Any] = {
            "recover": False,
            "number": 0,
            "method": 0,
            "seed": 42,
            "density": True,
            "cells": 128,
            "fields": False,
        }
        self._layers = vtkDataArraySelection()
        self._layers.AddObserver(vtkCommand.ModifiedEvent, self._layers_changed)
        self._listing = False
        self._made: dict[int, tuple[object, vtkDataObject]] = {}
        self._said: object = None

    # Properties

    def SetFileName(self, path: str | None) -> None:
        """Set the model file or series."""
        if path != self._path:
            self._path = path
            self._layers.RemoveAllArrays()
            self._made.clear()
            self.Modified()

    def GetLayers(self) -> vtkDataArraySelection:
        """Give the selection of layers."""
        return self._layers

    def SetRecoverParticles(self, wanted: int) -> None:
        """Switch the particles of the second output on or off."""
        self._set("recover", bool(wanted))

    def SetNumberOfParticles(self, number: int) -> None:
        """Set the number of particles to draw; 0 means as many as in the snapshot."""
        self._set("number", int(number))

    def SetMethod(self, method: int) -> None:
        """Set the method of drawing particles, an index in `METHODS`."""
        self._set("method", int(method))

    def SetSeed(self, seed: int) -> None:
        """Set the random seed."""
        self._set("seed", int(seed))

    def SetComputeDensity(self, wanted: int) -> None:
        """Switch the density of the first output on or off."""
        self._set("density", bool(wanted))

    def SetResolution(self, cells: int) -> None:
        """Set the number of cells along the longest edge."""
        self._set("cells", int(cells))

    def SetComputeFields(self, compute: int) -> None:
        """Add fields to the density's cells, or not."""
        self._set("fields", bool(compute))

    def Refresh(self) -> None:
        """Read the file again if it has changed."""
        self.Modified()

    def _set(self, option: str, value: Any) -> None:
        if self._options[option] != value:
            self._options[option] = value
            self.Modified()

    # The pipeline

    def FillOutputPortInformation(self, port: int, info: Any) -> int:
        """Tell the type of an output."""
        info.Set(vtkDataObject.DATA_TYPE_NAME(), PORTS[port])
        return 1

    def ProcessRequest(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Answer a request of the pipeline; data are made only for the output that requests them."""
        if request.Has(vtkDemandDrivenPipeline.REQUEST_DATA_NOT_GENERATED()):
            asking = request.Get(vtkDemandDrivenPipeline.FROM_OUTPUT_PORT())
            for port in range(3):
                if asking >= 0 and port != asking:
                    outputs.GetInformationObject(port).Set(vtkDemandDrivenPipeline.DATA_NOT_GENERATED(), 1)
            return 1
        return super().ProcessRequest(request, inputs, outputs)

    def RequestInformation(self, _request: Any, _inputs: Any, outputs: Any) -> int:
        """Find the time steps, the layers and the extent of the grid."""
        times: list[float] = []
        extent: tuple[int, ...] = (0, -1) * 3
        try:
            if self._path:
                series = read_series(self._path)
                times = [] if series is None else times_of(series).tolist()
                image = self._make(DENSITY, asked_time(outputs.GetInformationObject(DENSITY)))
                assert isinstance(image, vtkImageData)
                extent = image.GetExtent()
        except Exception as error:
            self._tell(error)
        pipeline = vtkStreamingDemandDrivenPipeline
        for port in range(3):
            about = outputs.GetInformationObject(port)
            about.Remove(pipeline.TIME_STEPS())
            about.Remove(pipeline.TIME_RANGE())
            if times:
                about.Set(pipeline.TIME_STEPS(), times, len(times))
                about.Set(pipeline.TIME_RANGE(), [times[0], times[-1]], 2)
            if port != DENSITY:
                about.Set(vtkAlgorithm.CAN_HANDLE_PIECE_REQUEST(), 1)
        outputs.GetInformationObject(DENSITY).Set(pipeline.WHOLE_EXTENT(), extent, 6)
        return 1

    def RequestData(self, request: Any, _inputs: Any, outputs: Any) -> int:
        """Make the requested data; if that fails, empty data and an error of one line."""
        asking = request.Get(vtkDemandDrivenPipeline.FROM_OUTPUT_PORT())
        for port in range(3) if asking < 0 else (asking,):
            about = outputs.GetInformationObject(port)
            output = about.Get(vtkDataObject.DATA_OBJECT())
            output.Initialize()
            if about.Get(vtkStreamingDemandDrivenPipeline.UPDATE_PIECE_NUMBER()) > 0:
                continue
            try:
                if not self._path:
                    raise ValueError("no file is chosen: set FileName to a .pgs file")
                time = asked_time(about)
                output.ShallowCopy(self._make(port, time))
                series = read_series(self._path)
                if series is not None:
                    output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), moment_of(series, time))
            except _Stopped:
                pass
            except Exception as error:
                self._tell(error)
        return 1

    def _layers_changed(self, *_: object) -> None:
        if not self._listing:
            self.Modified()

    def _list_layers(self, model: Model) -> None:
        """Add the layers to the selection; the state of known layers is kept."""
        self._listing = True
        for layer in model.layers:
            self._layers.AddArray(layer["name"])
        self._listing = False

    def _make(self, port: int, time: float | None) -> vtkDataObject:
        """Give the data of an output at a time of a series, cached until its options or the frame change."""
        assert self._path is not None
        series = read_series(self._path)
        moment = None if series is None else moment_of(series, time)
        listed = map(self._layers.GetArrayName, range(self._layers.GetNumberOfArrays()))
        off = tuple(name for name in listed if not self._layers.ArrayIsEnabled(name))
        o = self._options
        depends = {
            DENSITY: (o["density"], o["cells"], o["fields"]),
            PARTICLES: (o["recover"], o["number"], o["method"], o["seed"]),
            GAUSSIANS: (),
        }[port]
        key = (self._path, stamp(self._path), moment, off, depends)
        known = self._made.get(port)
        if known is None or known[0] != key:
            model = read_model(self._path, moment)
            # A particle type may appear in a later frame.
            self._list_layers(model)
            facts = facts_of(model)
            if series is not None and moment is not None:
                facts["frame"] = frames_of(series, moment)
            names = [layer["name"] for layer in model.layers]
            layers = [name for name in names if name not in off]
            self._made.pop(port, None)
            self._made[port] = known = (key, self._compute(port, model, None if layers == names else layers, facts))
        return known[1]

    def _compute(self, port: int, model: Model, layers: list[str] | None, facts: Mapping[str, object]) -> vtkDataObject:
        """Compute the data of an output."""
        o = self._options
        if port == GAUSSIANS:
            return gaussians_of(model, layers, facts)
        if layers == []:
            return vtkPolyData() if port == PARTICLES else vtkImageData()
        if port == PARTICLES:
            if not o["recover"]:
                return vtkPolyData()
            method = METHODS[o["method"]]
            snapshot = model.recover(
                o["number"] or None, method, seed=o["seed"], layers=layers, progress=self._progress
            )
            words = f"drawn from the model {model.name} by method {method}, seed {o['seed']}: not simulated"
            units = {f"{name}_unit": field.unit for name, field in model.fields.items()}
            return particles_of(snapshot, {"SYNTHETIC": words, **units, **facts})
        # Alpha-blend models have opacities, not masses.
        if not o["density"] or model.law == "alpha-blend":
            return vtkImageData()
        here = [name for name in (model.fields if o["fields"] else ()) if has_field(model, name, layers)]
        # A sum over particles has no dispersion.
        what = ((n,) if model.fields[n].kind == "sum" else (n, f"dispersion.{n}") for n in here)
        assert self._path is not None
        cells = cells_of(self._path, o["cells"])
        fields = (tuple(model.grid(n, cells, layers=layers) for n in names) for names in what)
        return density_of(model.density_grid(cells, layers=layers), facts, fields)

    def _progress(self, _phase: str, done: int, total: int) -> None:
        if total > 0:
            self.UpdateProgress(min(1.0, done / total))
        if self.GetAbortExecute():
            raise _Stopped

    def _tell(self, error: Exception) -> None:
        """Report an error once until something changes."""
        words = (one_line(error), self.GetMTime())
        if words == self._said:
            return
        self._said = words
        report(error)


# In ParaView: the initial look of representations of a reader's outputs.


def look_of(representation: Any) -> None:
    """Style a new representation of a reader's output.

    Recovered particles are white, with the model's radius and opacity; the density is coloured by its contrast.
    """
    port = representation.Input
    if port is None or port.SMProxy.GetXMLName() != ParticlegsReader.__name__:
        return
    known = getattr(port, "Port", 0)
    about = port.GetDataInformation(known) if known else port.GetDataInformation()
    model = read_model(port.FileName)
    if known == PARTICLES:
        representation.SetScalarColoring(None, 0)
        for name, value in {
            "AmbientColor": [1.0, 1.0, 1.0],
            "DiffuseColor": [1.0, 1.0, 1.0],
            "ShaderPreset": "Gaussian Blur",
            "GaussianRadius": model.radius,
            "Opacity": model.opacity,
        }.items():
            if name in representation.ListProperties():
                setattr(representation, name, value)
    elif known == DENSITY and about.GetNumberOfCells() > 0:
        from paraview import simple

        simple.ColorBy(representation, ("CELLS", "contrast"))
        colors = simple.GetColorTransferFunction("contrast")
        colors.ApplyPreset("Plasma (matplotlib)", True)
        representation.ScalarOpacityUnitDistance = float(np.max(model.bounds[1] - model.bounds[0])) / 100.0


_seen: set[int] = set()


def _registered(*_: object) -> None:
    """Style new representations; ParaView does not say which proxy it has registered."""
    from paraview import servermanager

    for proxy in list(servermanager.ProxyManager().GetProxiesInGroup("representations").values()):
        number = proxy.SMProxy.GetGlobalID()
        if number in _seen or not hasattr(proxy, "Input") or proxy.Input is None:
            continue
        _seen.add(number)
        try:
            look_of(proxy)
        except Exception as error:  # ParaView would show a traceback.
            report(error)


def watch() -> None:
    """Style representations of models from now on."""
    from paraview import servermanager

    manager = servermanager.vtkSMProxyManager.GetProxyManager()
    if manager is not None and not hasattr(servermanager, "_particlegs_watches"):
        servermanager._particlegs_watches = manager.AddObserver("RegisterEvent", _registered)


# In scripts


def load() -> None:
    """Load this plug-in into the running ParaView of any version.

    Raises
    ------
    RuntimeError
        If ParaView refuses it.
    """
    from paraview import simple

    folder = os.path.dirname(os.path.abspath(__file__))
    if folder not in sys.path:
        # Macros import `particlegs_views` from this folder.
        sys.path.append(folder)
    simple.LoadPlugin(os.path.abspath(__file__), remote=True, ns=vars(simple))
    watch()


if __name__ == "__main__":
    load()
else:
    # Plain VTK has no representations.
    with contextlib.suppress(ImportError):
        watch()
