"""Draws pictures of a model for a paper with ParaView, without a window.

    pvbatch figure.py model.pgs -o figures
    xvfb-run -a pvbatch figure.py model.pgs --snapshot snapshot.vtp -o figures

Draws `ellipsoids.png` (Gaussians as ellipsoids), `recovered.png` (synthetic particles as Point Gaussian),
`density.png` (a volume) and `compared.png` (all particles beside the picture of the model).
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from typing import Any

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np
from paraview import simple

import particlegs_reader
import particlegs_views as views

INK = {"black": [0.85, 0.85, 0.85], "white": [0.0, 0.0, 0.0]}
PAPER = {"black": [0.0, 0.0, 0.0], "white": [1.0, 1.0, 1.0]}
# Factor on the camera distance for pictures with axes.
WITH_AXES = 1.25
PICTURES = ("ellipsoids", "recovered", "density", "compared")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="figure.py", description="Pictures of a model for a paper, drawn by ParaView."
    )
    parser.add_argument("model", metavar="M.pgs", help="model file")
    parser.add_argument("-o", "--output", default=".", metavar="DIR", help="folder for the pictures [default: here]")
    parser.add_argument(
        "--snapshot", metavar="FILE", help="all particles, in any format that ParaView or particlegs reads"
    )
    parser.add_argument(
        "--pictures", nargs="+", choices=PICTURES, default=PICTURES, help="pictures to draw [default: all four]"
    )
    parser.add_argument(
        "--size", default="1600x1200", metavar="WxH", help="size of a picture in pixels [default: 1600x1200]"
    )
    parser.add_argument("--azimuth", type=float, default=30.0, help="degrees about the vertical axis [default: 30]")
    parser.add_argument("--elevation", type=float, default=20.0, help="degrees above the horizon [default: 20]")
    parser.add_argument(
        "--distance", type=float, default=1.2, help="as in `particlegs render`; smaller is nearer [default: 1.2]"
    )
    parser.add_argument("--radius", type=float, help="radius of a particle, world units [default: the model's]")
    parser.add_argument("--opacity", type=float, help="opacity of a particle [default: the model's]")
    parser.add_argument(
        "--particles", type=int, default=0, help="number of recovered particles [default: as in the snapshot]"
    )
    parser.add_argument(
        "--method",
        default="count",
        choices=particlegs_reader.METHODS,
        help="method of recovering particles [default: count]",
    )
    parser.add_argument("--grid", type=int, default=256, help="cells along the longest edge [default: 256]")
    parser.add_argument(
        "--sigmas", type=float, default=1.0, help="semi-axes of ellipsoids in standard deviations [default: 1]"
    )
    parser.add_argument(
        "--overdensity",
        type=float,
        default=5.0,
        help="lowest density of ellipsoids and volume, in mean densities [default: 5]",
    )
    parser.add_argument(
        "--background",
        choices=tuple(PAPER),
        default="white",
        help="background of ellipsoids and density; particles are white on black [default: white]",
    )
    return parser.parse_args()


@dataclass
class Scene:
    """Shared by all pictures."""

    model: Any
    reader: Any
    options: argparse.Namespace
    size: tuple[int, int]

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of the particles, (2, 3)."""
        return np.asarray(self.model.bounds, dtype=np.float64)

    @property
    def mean_density(self) -> float:
        """Particles per volume, averaged over the bounds."""
        return self.model.count / max(float(np.prod(self.bounds[1] - self.bounds[0])), 1e-300)

    @property
    def axes_unit(self) -> str:
        """The caption about the axes."""
        return f"\naxes in {self.model.length_unit}" if self.model.length_unit else ""

    @property
    def extent(self) -> str:
        """The caption about the box, for pictures without axes."""
        lengths = np.ptp(self.bounds, axis=0) if self.model.box is None else np.linalg.norm(self.model.box, axis=-1)
        if np.ptp(lengths) < 1e-3 * np.max(lengths):
            lengths = lengths[:1]
        return f"\nbox {' x '.join(f'{length:.4g}' for length in lengths)} {self.model.length_unit or ''}".rstrip()

    @property
    def radius(self) -> float:
        """Radius of a particle, world units."""
        return self.options.radius or self.model.radius

    @property
    def opacity(self) -> float:
        """Opacity of a particle."""
        return self.options.opacity or self.model.opacity

    def letters(self, share: float = 0.022) -> int:
        """Font size for the height of the pictures."""
        return max(6, round(share * self.size[1]))

    def view(self, away: float = 1.0) -> Any:
        """Make a view with the camera of all pictures; `away` scales the distance."""
        view = simple.CreateView("RenderView")
        view.ViewSize = list(self.size)
        views.dress(view)
        o = self.options
        views.place_camera(view, self.bounds, o.azimuth, o.elevation, away * o.distance)
        return view

    def save(self, name: str, what: Any, size: tuple[int, int] | None = None) -> None:
        """Write a picture."""
        path = os.path.join(self.options.output, f"{name}.png")
        simple.SaveScreenshot(path, what, ImageResolution=list(size or self.size))
        print(path, flush=True)

    def caption(self, view: Any, text: str, ink: list[float]) -> None:
        """Write text into the lower left corner."""
        words = simple.Show(simple.Text(Text=text), view)
        words.WindowLocation = "Lower Left Corner"
        words.FontSize = self.letters()
        words.Color = ink
        words.Justification = "Left"

    def axes(self, view: Any, ink: list[float]) -> None:
        """Draw axes about the particles."""
        grid = view.AxesGrid
        grid.Visibility = 1
        grid.UseCustomBounds = 1
        grid.CustomBounds = [float(v) for pair in zip(*self.bounds) for v in pair]
        for axis, low, high in zip("XYZ", *self.bounds):
            setattr(grid, f"{axis}Title", axis.lower())
            setattr(grid, f"{axis}AxisUseCustomLabels", 1)
            setattr(grid, f"{axis}AxisLabels", ticks(low, high))
            for part in ("Title", "Label"):
                setattr(grid, f"{axis}{part}Color", ink)
                setattr(grid, f"{axis}{part}FontSize", self.letters())
        grid.GridColor = ink


def ticks(low: float, high: float) -> list[float]:
    """Choose round coordinates above `low` and up to `high`, with a tolerance of a thousandth.

    `low` is left out, because the labels of several axes would overlap there.
    """
    extent = max(high - low, 1e-30)
    power = 10.0 ** np.floor(np.log10(extent / 3.0))
    step = max(s * power for s in (1.0, 2.0, 5.0) if s * power <= extent / 3.0)
    slack = 1e-3 * extent
    return [float(n * step) for n in range(int((low + slack) // step) + 1, int((high + slack) // step) + 1)]


def colours(shown: Any, view: Any, scene: Scene, array: str, limits: tuple[float, float], title: str) -> Any:
    """Colour a representation by an array within limits, with a colour bar; give transfer function and bar."""
    ink = INK[scene.options.background]
    table = simple.GetColorTransferFunction(array)
    dark = scene.options.background == "black"
    table.ApplyPreset("Inferno (matplotlib)" if dark else "Plasma (matplotlib)", True)
    table.RescaleTransferFunction(*limits)
    shown.LookupTable = table
    bar = simple.GetScalarBar(table, view)
    bar.Title, bar.ComponentTitle = title, ""
    bar.TitleColor = bar.LabelColor = ink
    bar.TitleFontSize = bar.LabelFontSize = scene.letters()
    bar.WindowLocation = "Any Location"
    bar.Orientation, bar.Position, bar.ScalarBarLength = "Horizontal", [0.33, 0.9], 0.34
    bar.ScalarBarThickness = max(6, scene.size[1] // 60)
    bar.AutomaticLabelFormat, bar.LabelFormat, bar.AddRangeLabels = 0, "%g", 0
    bar.UseCustomLabels = 1
    bar.CustomLabels = ticks(*limits)
    bar.Visibility = 1
    return table, bar


def highest_colour(model: Any, least: float) -> float:
    """Give the density below which 98 % of the Gaussians above `least` lie.

    Gaussians of single particles can have any density, and would use up all colours.
    """
    gaussians = model.gaussians
    deviations = particlegs_reader.square_roots(gaussians.covariances)[1]
    volumes = (2.0 * np.pi) ** 1.5 * deviations.prod(axis=1)
    found = gaussians.counts / np.maximum(volumes, particlegs_reader.LEAST_VOLUME)
    return max(float(np.percentile(found[found >= least], 98.0)), 10.0 * least)


def ellipsoids(scene: Scene) -> None:
    """Draw the dense Gaussians as ellipsoids."""
    o, ink = scene.options, INK[scene.options.background]
    over = simple.Calculator(Input=scene.reader)
    over.AttributeType = "Point Data"
    over.ResultArrayName = "overdensity"
    over.Function = f"number_density/{scene.mean_density!r}"
    dense = simple.Threshold(Input=over)
    dense.Scalars = ["POINTS", "overdensity"]
    dense.ThresholdMethod = "Above Upper Threshold"
    dense.UpperThreshold = o.overdensity
    dense.UpdatePipeline()
    number = dense.GetDataInformation().GetNumberOfPoints()
    if number == 0:
        raise ValueError(f"no Gaussian is denser than {o.overdensity:g} mean densities: choose a lower --overdensity")
    highest = highest_colour(scene.model, o.overdensity * scene.mean_density) / scene.mean_density
    glyphs = simple.TensorGlyph(Input=dense, GlyphType="Sphere")
    glyphs.Tensors = ["POINTS", "sqrt_covariance"]
    glyphs.Scalars = ["POINTS", "overdensity"]
    # The radius of VTK's sphere is 0.5.
    glyphs.ScaleFactor = 2.0 * o.sigmas
    glyphs.LimitScalingByEigenvalues = 0
    finest = 24 if number < 20_000 else 10
    glyphs.GlyphType.ThetaResolution = glyphs.GlyphType.PhiResolution = finest
    view = scene.view(WITH_AXES)
    view.Background = PAPER[o.background]
    shown = simple.Show(glyphs, view)
    simple.ColorBy(shown, ("POINTS", "overdensity"))
    limits = (o.overdensity, highest)
    table, bar = colours(shown, view, scene, "overdensity", limits, "peak density / mean density")
    bar.CustomLabels = [10.0**n for n in range(-30, 31) if limits[0] <= 10.0**n <= limits[1]]
    table.MapControlPointsToLogSpace()
    table.UseLogScale = 1
    shown.Ambient, shown.Specular = 0.25, 0.2
    scene.axes(view, ink)
    known = scene.reader.GetDataInformation().GetNumberOfPoints()
    words = f"{number:,} of {known:,} Gaussians\nsemi-axes: {o.sigmas:g} standard deviation{'s' * (o.sigmas != 1)}"
    scene.caption(view, words + scene.axes_unit, ink)
    scene.save("ellipsoids", view)


def recovered(scene: Scene) -> None:
    """Draw synthetic particles in the style of the paper."""
    scene.reader.RecoverParticles = 1
    scene.reader.NumberOfParticles = scene.options.particles
    scene.reader.Method = scene.options.method
    view = scene.view()
    port = simple.OutputPort(scene.reader, particlegs_reader.PARTICLES)
    views.point_gaussian(port, view, radius=scene.radius, opacity=scene.opacity)
    number = port.GetDataInformation().GetNumberOfPoints()
    words = f"{number:,} synthetic particles, recovered by method {scene.options.method}"
    scene.caption(view, words + scene.extent, INK["black"])
    scene.save("recovered", view)


def density(scene: Scene) -> None:
    """Draw the density as a volume."""
    o, ink = scene.options, INK[scene.options.background]
    scene.reader.ComputeDensity = 1
    scene.reader.Resolution = o.grid
    port = simple.OutputPort(scene.reader, particlegs_reader.DENSITY)
    port.UpdatePipeline()
    about = port.GetDataInformation()
    bounds = np.reshape(about.GetBounds(), (3, 2))
    mean = port.FieldData["total"].GetRange()[0] / float(np.prod(bounds[:, 1] - bounds[:, 0]))
    peak = port.CellData["density"].GetRange()[1]
    view = scene.view(WITH_AXES)
    view.Background = PAPER[o.background]
    over = simple.Calculator(Input=port)
    over.AttributeType = "Cell Data"
    over.ResultArrayName = "contrast"
    over.Function = f"log10(max(density/{mean!r},1e-30))"
    low, highest = np.log10(o.overdensity), np.log10(max(peak / mean, 10.0 * o.overdensity))
    shown = simple.Show(over, view)
    shown.SetRepresentationType("Volume")
    simple.ColorBy(shown, ("CELLS", "contrast"))
    colours(shown, view, scene, "contrast", (low, highest), "log10(density / mean density)")
    opacity = simple.GetOpacityTransferFunction("contrast")
    opacity.Points = [low, 0.0, 0.5, 0.0, 0.5 * (low + highest), 0.4, 0.5, 0.0, highest, 1.0, 0.5, 0.0]
    shown.ScalarOpacityFunction = opacity
    shown.ScalarOpacityUnitDistance = float(np.max(scene.bounds[1] - scene.bounds[0])) / o.grid * 3.0
    scene.axes(view, ink)
    cells = " x ".join(str(n) for n in np.diff(np.reshape(about.GetExtent(), (3, 2)))[:, 0])
    scene.caption(view, f"{cells} cells{scene.axes_unit}", ink)
    scene.save("density", view)


def truth_of(scene: Scene) -> Any:
    """Open all particles with ParaView, or with particlegs for other formats."""
    path = scene.options.snapshot
    if os.path.isfile(path) and path.endswith((".vtp", ".vtu", ".vtk")):
        return simple.OpenDataFile(path)
    data = particlegs_reader.particles_of(particlegs_reader.package().open(path), {})
    source = simple.TrivialProducer()
    source.GetClientSideObject().SetOutput(data)
    return source


def compared(scene: Scene) -> None:
    """Draw all particles beside the picture of the model."""
    truth_view, picture_view = scene.view(), scene.view()
    if scene.options.snapshot:
        truth = truth_of(scene)
    else:
        print("no --snapshot: comparing the model's picture with recovered particles", flush=True)
        scene.reader.RecoverParticles = 1
        truth = simple.OutputPort(scene.reader, particlegs_reader.PARTICLES)
    picture = views.compare(scene.reader, truth, truth_view, picture_view)
    picture.like.GaussianRadius, picture.like.Opacity = scene.radius, scene.opacity
    number = truth.GetDataInformation().GetNumberOfPoints()
    kind = "all {:,} particles" if scene.options.snapshot else "{:,} synthetic particles"
    scene.caption(truth_view, f"{kind.format(number)}, Point Gaussian{scene.extent}", INK["black"])
    layout = simple.CreateLayout("compared")
    layout.SplitHorizontal(0, 0.5)
    layout.AssignView(1, truth_view)
    layout.AssignView(2, picture_view)
    width, height = scene.size
    layout.SetSize(2 * width, height)
    words = f"the model: {scene.model.nbytes / 1000:,.0f} kB, ratio {scene.model.ratio:.0f}"
    scene.caption(picture_view, words, INK["black"])
    scene.save("compared", layout, (2 * width, height))


def main() -> None:
    """Draw the requested pictures."""
    options = arguments()
    try:
        width, height = (int(n) for n in options.size.split("x"))
        if not (16 <= width <= 16384 and 16 <= height <= 16384):
            raise ValueError
    except ValueError:
        sys.exit(f"--size {options.size} is not a size: give WIDTHxHEIGHT, 16 to 16384 pixels each, such as 1600x1200")
    try:
        model = particlegs_reader.read_model(options.model)
        os.makedirs(options.output, exist_ok=True)
        particlegs_reader.load()
        reader = simple.OpenDataFile(options.model)
        scene = Scene(model, reader, options, (width, height))
        for name in PICTURES:
            if name in options.pictures:
                globals()[name](scene)
    except Exception as error:
        sys.exit(particlegs_reader.one_line(error))


if __name__ == "__main__":
    main()
