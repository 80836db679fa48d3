"""Macro for ParaView: shows the active source in the style of the paper.

White Gaussian splats on black, radius 0.0406 of the mean particle spacing, opacity 0.05. Open a snapshot, select it,
then run this (Macros, Import New Macro; or Python Shell, Run Script; or `paraview --script=point_gaussian.py`).
"""

from paraview import print_error, simple

try:
    import particlegs_views
except ImportError:
    print_error(
        "particlegs: first load the plug-in particlegs_reader.py, or start ParaView with its folder in PYTHONPATH"
    )
else:
    source = simple.GetActiveSource()
    if source is None:
        print_error("particlegs: no source is selected: open a snapshot and select it in the Pipeline Browser")
    else:
        view = simple.GetActiveViewOrCreate("RenderView")
        try:
            for other in simple.GetSources().values():
                simple.Hide(other, view)
            particlegs_views.dress(view)
            particlegs_views.point_gaussian(source, view)
            view.ResetCamera(False)
            simple.Render(view)
        except ValueError as error:
            print_error(f"particlegs: {error}")
