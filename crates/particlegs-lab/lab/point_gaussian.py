"""VTK's Point Gaussian timed for the laboratory: one request on standard input, one answer on standard output.

The request is JSON: `folder` with xx.f32, yy.f32 and zz.f32 (little-endian float32), `width` and `height` in pixels,
`first` (a view), `cameras` and `settings` (lists of views), `pictures` (a folder or null), `limit` (seconds after which
no further frame is started, after one of each kind). A view has position, focal_point, view_up, clipping_range,
fov_deg, radius and opacity. The answer is JSON with seconds. The last line of standard error says why it failed.

The mapper is set up as in ParaView 6.0 for the representation "Point Gaussian" with the shader "Gaussian Blur":
emissive off, white, no multisampling, dual depth peeling in four peels, FXAA with its settings. Every frame is drawn
and its pixels are fetched.
"""

import json
import os
import sys
import time

# Import modules only from this Python, not from the current folder.
sys.path = [p for p in sys.path if p not in ("", os.getcwd())]
# Only the answer goes to standard output; what libraries print goes to standard error.
ANSWER = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

OPENGL = "on Debian: apt install libegl1 libgl1 libgl1-mesa-dri, or libosmesa6"


def fail(words):
    sys.stderr.write("\n%s\n" % " ".join(words.split()))
    sys.stderr.flush()
    os._exit(3)


try:
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules import vtkCommonCore, vtkCommonDataModel, vtkRenderingCore
    import vtkmodules.vtkRenderingOpenGL2
except ModuleNotFoundError as error:
    package = "vtk" if error.name.startswith("vtk") else error.name
    fail("%s is missing %s: install the packages of lab/requirements.txt" % (sys.executable, package))
except ImportError as error:
    fail("VTK cannot be loaded: %s (%s)" % (error, OPENGL))


def load(folder):
    """Reads float32 columns as points for the mapper."""
    columns = [np.fromfile(os.path.join(folder, name), "<f4") for name in ("xx.f32", "yy.f32", "zz.f32")]
    xyz = np.stack(columns, 1)
    points = vtkCommonCore.vtkPoints()
    points.SetData(numpy_to_vtk(xyz, deep=0))
    data = vtkCommonDataModel.vtkPolyData()
    data.SetPoints(points)
    return data, xyz


class Scene:
    def __init__(self, data, width, height):
        self.mapper = vtkRenderingCore.vtkPointGaussianMapper()
        self.mapper.SetInputData(data)
        self.mapper.SetScalarVisibility(0)
        self.mapper.SetEmissive(0)
        self.mapper.SetBoundScale(3.0)
        actor = vtkRenderingCore.vtkActor()
        actor.SetMapper(self.mapper)
        self.look = actor.GetProperty()
        self.look.SetColor(1, 1, 1)
        self.look.SetAmbient(0)
        self.look.SetDiffuse(1)
        self.look.SetSpecular(0)
        self.renderer = vtkRenderingCore.vtkRenderer()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.AddActor(actor)
        self.renderer.SetUseDepthPeeling(1)
        self.renderer.SetUseDepthPeelingForVolumes(1)
        self.renderer.SetMaximumNumberOfPeels(4)
        self.renderer.SetFXAAOptions(self.fxaa())
        self.window = vtkRenderingCore.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetAlphaBitPlanes(1)
        self.window.SetSize(width, height)
        self.window.AddRenderer(self.renderer)

    @staticmethod
    def fxaa():
        options = vtkRenderingCore.vtkFXAAOptions()
        options.SetRelativeContrastThreshold(0.125)
        options.SetHardContrastThreshold(0.045)
        options.SetSubpixelBlendLimit(0.75)
        options.SetSubpixelContrastThreshold(0.25)
        options.SetUseHighQualityEndpoints(True)
        options.SetEndpointSearchIterations(12)
        return options

    def frame(self, view, fxaa=True):
        """Grey levels from the top row down, and their seconds."""
        camera = self.renderer.GetActiveCamera()
        camera.SetViewAngle(view["fov_deg"])
        camera.SetPosition(view["position"])
        camera.SetFocalPoint(view["focal_point"])
        camera.SetViewUp(view["view_up"])
        camera.SetClippingRange(view["clipping_range"])
        # Set only what changed, since setting a value makes the mapper rebuild its buffers.
        if self.mapper.GetScaleFactor() != view["radius"]:
            self.mapper.SetScaleFactor(view["radius"])
        if self.look.GetOpacity() != view["opacity"]:
            self.look.SetOpacity(view["opacity"])
        self.renderer.SetUseFXAA(1 if fxaa else 0)
        start = time.perf_counter()
        self.window.Render()
        levels = vtkCommonCore.vtkUnsignedCharArray()
        width, height = self.window.GetSize()
        self.window.GetPixelData(0, 0, width - 1, height - 1, 0, levels, 0)
        rgb = vtk_to_numpy(levels).reshape(height, width, 3)
        took = time.perf_counter() - start
        return rgb[::-1, :, 0], took

    def renderer_name(self):
        """The name of the OpenGL renderer."""
        lines = [line.split(":", 1) for line in self.window.ReportCapabilities().splitlines() if ":" in line]
        return {name.strip(): value.strip() for name, value in lines}.get("OpenGL renderer string", "")


def check_opengl():
    """Tries OpenGL in a child, since VTK crashes if it cannot draw off-screen."""
    child = os.fork() if hasattr(os, "fork") else None
    if child == 0:
        Scene(vtkCommonDataModel.vtkPolyData(), 16, 16).window.Render()
        os._exit(0)
    if child and os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0:
        fail("VTK found no OpenGL that can draw off-screen (%s)" % OPENGL)


def answer(request):
    check_opengl()
    began = time.perf_counter()
    data, _kept = load(request["folder"])
    loaded = time.perf_counter() - began
    scene = Scene(data, request["width"], request["height"])
    picture, first = scene.frame(request["first"])
    name = scene.renderer_name()
    if not name or not picture.any():
        fail("VTK drew nothing off-screen, so OpenGL is missing (%s)" % OPENGL)
    if request["pictures"]:
        picture.tofile(os.path.join(request["pictures"], "fxaa.gray"))
        scene.frame(request["first"], fxaa=False)[0].tofile(os.path.join(request["pictures"], "plain.gray"))
    seconds = {"cameras": [], "settings": []}
    began = time.perf_counter()
    # First new cameras with the same radius and opacity, then new radii and opacities with one camera.
    for kind, limit in (("cameras", 0.5), ("settings", 1.0)):
        for view in request[kind]:
            if seconds[kind] and time.perf_counter() - began > limit * request["limit"]:
                break
            seconds[kind].append(scene.frame(view)[1])
    version = vtkCommonCore.vtkVersion.GetVTKVersion()
    return dict(version=version, opengl=name, load=loaded, first=first, **seconds)


ANSWER.write(json.dumps(answer(json.load(sys.stdin))))
ANSWER.flush()
# Exit at once: closing the window may crash if its OpenGL is incomplete.
os._exit(0)
