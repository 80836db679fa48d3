"""Views in ParaView: particles in the style of the paper, and the picture of a model."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCamera, vtkImageMapper, vtkRenderer

import particlegs_reader
from particlegs_reader import package, read_model, read_series, report

if TYPE_CHECKING:
    from particlegs import Camera, Model, Snapshot


# The style of the paper: radius of a particle in mean spacings, and its opacity.
RADIUS_IN_SPACINGS = 0.0406
OPACITY = 0.05
# During rotation, pictures that take longer (seconds) are drawn coarser.
TURNING = 0.1


def default_radius(bounds: np.ndarray, number: float) -> float:
    """Give the default radius of a particle.

    Parameters
    ----------
    bounds : ndarray, (2, 3)
        Lowest and highest corner of the particles, world units.
    number : float
        Number of particles.

    Returns
    -------
    float
        0.0406 of the mean spacing (V / N)^(1/3), world units. An extent of 0 is replaced by the largest extent.
    """
    extent = np.asarray(bounds[1], dtype=np.float64) - np.asarray(bounds[0], dtype=np.float64)
    extent = np.where(extent > 0.0, extent, max(extent.max(), 1e-30))
    return float(RADIUS_IN_SPACINGS * np.cbrt(extent.prod() / max(number, 1.0)))


class Picture:
    """A picture of a model over a renderer, updated whenever the renderer draws.

    Parameters
    ----------
    model : particlegs.Model
    renderer : vtkRenderer
        The picture covers everything that it draws.
    radius, opacity : float, optional
        Radius and opacity of a particle; the model's by default. Both can be changed at any time.
    style : str
        `paraview`, `paraview-no-fxaa` or `expected`.
    like : representation proxy, optional
        A Point Gaussian representation whose radius and opacity are used instead.
    follow : function, optional
        Gives the model to draw, whenever the renderer draws.
    """

    def __init__(
        self,
        model: Model,
        renderer: vtkRenderer,
        *,
        radius: float | None = None,
        opacity: float | None = None,
        style: Literal["paraview", "paraview-no-fxaa", "expected"] = "paraview",
        like: Any = None,
        follow: Callable[[], Model] | None = None,
    ) -> None:
        self.model, self.renderer, self.style, self.like, self.follow = model, renderer, style, like, follow
        self.radius = model.radius if radius is None else radius
        self.opacity = model.opacity if opacity is None else opacity
        self.pixels = np.zeros((1, 1), dtype=np.uint8)
        self._asked: object = None
        self._seconds_a_pixel = 0.0
        self._mapper = vtkImageMapper()
        self._mapper.SetColorWindow(255.0)
        self._mapper.SetColorLevel(127.5)
        self._actor = vtkActor2D()
        self._actor.SetMapper(self._mapper)
        renderer.AddViewProp(self._actor)
        self._observer = renderer.AddObserver(vtkCommand.StartEvent, self._draw)

    def remove(self) -> None:
        """Remove the picture from its renderer."""
        self.renderer.RemoveObserver(self._observer)
        self.renderer.RemoveViewProp(self._actor)

    def _draw(self, *_: object) -> None:
        try:
            self._update()
        except Exception as error:  # ParaView would show a traceback.
            self._actor.VisibilityOff()
            report(error)

    def _update(self) -> None:
        """Draw if the model, camera, size, radius, opacity or style has changed."""
        if self.follow is not None:
            self.model = self.follow()
        if self.like is not None:
            self.radius, self.opacity = float(self.like.GaussianRadius), float(self.like.Opacity)
        # The size of the whole picture, even if it is drawn in tiles.
        width, height = self.renderer.GetSize()
        coarse = self._coarseness(width * height, self.renderer.GetRenderWindow().GetDesiredUpdateRate())
        size = (max(1, width // coarse), max(1, height // coarse))
        camera = camera_of(self.renderer.GetActiveCamera(), self.renderer.GetRenderWindow().GetTileScale()[1])
        at = (camera.position, camera.focal_point, camera.view_up, camera.fov_deg, camera.height)
        asked = (self.model, at, size, self.radius, self.opacity, self.style)
        if asked == self._asked:
            return
        # Set before drawing, so that an error is reported once.
        self._asked = asked
        begun = time.perf_counter()
        drawn = self.model.render(camera=camera, size=size, radius=self.radius, opacity=self.opacity, style=self.style)
        self._seconds_a_pixel = (time.perf_counter() - begun) / (size[0] * size[1])
        self.pixels = grey_levels(drawn)
        self._show((width, height), coarse)

    def _coarseness(self, pixels: int, update_rate: float) -> int:
        """Give the edge of the blocks of pixels that are drawn as one during rotation."""
        if update_rate < 1.0:
            return 1
        return int(np.clip(np.ceil(np.sqrt(self._seconds_a_pixel * pixels / TURNING)), 1, 8))

    def _show(self, size: tuple[int, int], coarse: int) -> None:
        """Show the pixels, enlarged by `coarse`; VTK needs the bottom row first."""
        columns, rows = (np.minimum(np.arange(n) // coarse, most - 1) for n, most in zip(size, self.pixels.shape[::-1]))
        image = vtkImageData()
        image.SetDimensions(*size, 1)
        whole = self.pixels[::-1][np.ix_(rows, columns)]
        image.GetPointData().SetScalars(numpy_to_vtk(whole.ravel(), deep=True))
        self._mapper.SetInputData(image)
        self._actor.VisibilityOn()


def grey_levels(drawn: np.ndarray) -> np.ndarray:
    """Convert a result of `Model.render` to grey levels of uint8."""
    if drawn.dtype == np.uint8:
        return drawn
    return np.rint(255.0 * np.clip(drawn, 0.0, 1.0)).astype(np.uint8)


def camera_of(camera: vtkCamera, tiles: int = 1) -> Camera:
    """Convert a VTK camera to a `particlegs.Camera`, without its clipping range.

    Parameters
    ----------
    camera : vtkCamera
    tiles : int
        Number of tiles in vertical direction: VTK narrows the camera to one of them.

    Returns
    -------
    particlegs.Camera
    """
    at = (camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp())
    if camera.GetParallelProjection():
        return package().Camera(*at, height=2.0 * tiles * camera.GetParallelScale())
    # Screenshots narrow the angle and widen it again: rounding removes the numerical error.
    angle = 2.0 * np.degrees(np.arctan(tiles * np.tan(np.radians(camera.GetViewAngle()) / 2.0)))
    return package().Camera(*at, fov_deg=round(float(angle), 5))


# Functions that need ParaView.


def dress(view: Any) -> None:
    """Set a render view to the style of the paper: black, without annotations, with FXAA."""
    for name, value in {
        "UseColorPaletteForBackground": 0,
        "BackgroundColorMode": "Single Color",
        "Background": [0.0, 0.0, 0.0],
        "OrientationAxesVisibility": 0,
        "CenterAxesVisibility": 0,
        "UseFXAA": 1,
    }.items():
        if name in view.ListProperties():
            setattr(view, name, value)


def point_gaussian(source: Any, view: Any, *, radius: float | None = None, opacity: float | None = None) -> Any:
    """Show particles in the style of the paper.

    Parameters
    ----------
    source : source proxy or output port
        Points.
    view : render view proxy
    radius : float, optional
        Radius of a particle, world units; 0.0406 of the mean spacing by default.
    opacity : float, optional
        Opacity at the centre of a particle; 0.05 by default.

    Returns
    -------
    representation proxy
    """
    from paraview import simple

    source.UpdatePipeline()
    about = source.GetDataInformation()
    number, bounds = about.GetNumberOfPoints(), np.reshape(about.GetBounds(), (3, 2)).T
    if number == 0:
        raise ValueError("the source has no points to draw")
    shown = simple.Show(source, view)
    shown.SetRepresentationType("Point Gaussian")
    shown.SetScalarColoring(None, 0)
    radius = default_radius(bounds, number) if radius is None else radius
    for name, value in {
        "AmbientColor": [1.0, 1.0, 1.0],
        "DiffuseColor": [1.0, 1.0, 1.0],
        "ShaderPreset": "Gaussian Blur",
        "Emissive": 0,
        "ScaleByArray": 0,
        "OpacityByArray": 0,
        "GaussianRadius": radius,
        "Opacity": OPACITY if opacity is None else opacity,
    }.items():
        if name in shown.ListProperties():
            setattr(shown, name, value)
    return shown


def keep_camera() -> None:
    """Prevent ParaView from resetting the camera at a view's first picture."""
    from paraview import simple

    getattr(simple, "_DisableFirstRenderCameraReset", bool)()


def place_camera(view: Any, bounds: np.ndarray, azimuth: float, elevation: float, distance: float) -> None:
    """Place a view's camera as `particlegs render --azimuth --elevation --distance` does.

    Parameters
    ----------
    view : render view proxy
    bounds : ndarray, (2, 3)
        Bounds of the particles, world units.
    azimuth, elevation : float
        Degrees.
    distance : float
        In base distances (docs/guide/pictures.md).
    """
    camera = package().Camera.around(bounds, azimuth, elevation, distance)
    keep_camera()
    view.CameraViewAngle = camera.fov_deg
    view.CameraFocalPoint = list(camera.focal_point)
    view.CameraPosition = list(camera.position)
    view.CameraViewUp = list(camera.view_up)
    view.CenterOfRotation = list(camera.focal_point)


# Pictures by the id of their view: ParaView's proxies cannot keep Python objects.
_pictures: dict[int, Picture] = {}


def show_picture(model: Model | str, view: Any, **options: Any) -> Picture:
    """Draw the picture of a model over a render view, following its camera.

    Parameters
    ----------
    model : particlegs.Model or str
        A model, its path, or the path of a series, which is drawn at the view's time.
    view : render view proxy
    **options
        Keywords of `Picture`.

    Returns
    -------
    Picture
    """
    hide_picture(view)
    dress(view)
    # The picture is already antialiased.
    view.UseFXAA = 0
    if isinstance(model, str):
        path = model

        def now() -> Model:
            return read_model(path, float(view.ViewTime))

        if read_series(path) is not None:
            options["follow"] = now
        model = now()
    picture = Picture(model, view.SMProxy.GetRenderer(), **options)
    _pictures[view.SMProxy.GetGlobalID()] = picture
    return picture


def hide_picture(view: Any) -> None:
    """Remove a model's picture from a view, if it has one."""
    picture = _pictures.pop(view.SMProxy.GetGlobalID(), None)
    if picture is not None:
        picture.remove()


def is_model(source: Any) -> bool:
    """Whether a source is this plug-in's reader."""
    return source.SMProxy.GetXMLName() == particlegs_reader.ParticlegsReader.__name__


def compare(reader: Any, truth: Any, truth_view: Any, picture_view: Any) -> Picture:
    """Show particles as Point Gaussian in one view and a model's picture in another, with linked cameras.

    The picture uses the radius and opacity of the particles' representation, and the camera of `truth_view`.

    Parameters
    ----------
    reader : source proxy
        A model opened by this plug-in.
    truth : source proxy or output port
        All particles.
    truth_view, picture_view : render view proxies

    Returns
    -------
    Picture
    """
    from paraview import simple

    dress(truth_view)
    shown = point_gaussian(truth, truth_view)
    # An invisible outline, so that Reset Camera works.
    extent = simple.Show(reader, picture_view)
    extent.SetRepresentationType("Outline")
    extent.Opacity = 0.0
    picture = show_picture(reader.FileName, picture_view, like=shown)
    shown.SMProxy.AddObserver("PropertyModifiedEvent", lambda *_: simple.Render(picture_view))
    keep_camera()
    for name in ("Position", "FocalPoint", "ViewUp", "ViewAngle", "ParallelProjection", "ParallelScale"):
        setattr(picture_view, f"Camera{name}", getattr(truth_view, f"Camera{name}"))
    picture_view.CenterOfRotation = truth_view.CenterOfRotation
    link = f"particlegs {picture_view.SMProxy.GetGlobalID()}"
    simple.AddCameraLink(truth_view, picture_view, link)
    return picture


# From ParaView to models

MASSES = ("masses", "mass", "Masses", "Mass")


def snapshot_of(data: Any, *, name: str, box: Any = None) -> Snapshot:
    """Make a snapshot from a VTK data set.

    Parameters
    ----------
    data : vtkDataSet
        Its points are the particles. Masses are read from the first point data named in `MASSES`, the periodic box
        from the field data `box`, and units from `length_unit` and `mass_unit`.
    name : str
        Name of the snapshot.
    box : optional
        As in `particlegs.Snapshot`; overrides the box of the data.

    Returns
    -------
    particlegs.Snapshot
    """
    if not hasattr(data, "GetPoint") or data.GetNumberOfPoints() == 0:
        raise ValueError(f"{name} has no points to compress")
    points = data.GetPoints() if hasattr(data, "GetPoints") else None
    if points is None:
        raise ValueError(f"{name} is a grid, not particles")
    known: dict[str, Any] = {"name": name, "box": box}
    for mass in MASSES:
        if data.GetPointData().HasArray(mass):
            known["masses"] = vtk_to_numpy(data.GetPointData().GetArray(mass))
            break
    fields = data.GetFieldData()
    if box is None and fields.HasArray("box"):
        known["box"] = vtk_to_numpy(fields.GetArray("box")).squeeze()
    for field, argument in (("length_unit", "units"), ("mass_unit", "mass_units")):
        if fields.HasArray(field):
            known[argument] = fields.GetAbstractArray(field).GetValue(0)
    return package().Snapshot(vtk_to_numpy(points.GetData()), **known)


def file_of(source: Any) -> str:
    """Find the file from which a source, or its input, was read."""
    while source is not None:
        for name in ("FileName", "FileNames"):
            if name in source.ListProperties():
                value = getattr(source, name)
                path = value if isinstance(value, str) else next(iter(value), "")
                if path:
                    return path
        source = getattr(source, "Input", None)
    raise ValueError("the source was not read from a file: save it as .vtp, then open and select that file")


def compress_source(source: Any, **options: Any) -> str:
    """Compress the particles of a source to a `.pgs` file in the folder of its file.

    Parameters
    ----------
    source : source proxy
    **options
        Keywords of `particlegs.compress`, and `box`.

    Returns
    -------
    str
        The path of the model.

    Raises
    ------
    FileExistsError
        If the path exists.
    """
    from paraview import servermanager

    file = file_of(source)
    stem = os.path.splitext(file)[0]
    path = f"{stem}.pgs"
    if os.path.exists(path):
        raise FileExistsError(f"{path} exists already: move or delete it first")
    source.UpdatePipeline()
    data = servermanager.Fetch(source)
    snapshot = snapshot_of(data, name=os.path.basename(stem), box=options.pop("box", None))
    package().compress(snapshot, **options).save(path)
    return path
