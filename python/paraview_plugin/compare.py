"""Macro for ParaView: the picture of a model beside all particles as Point Gaussian, with linked cameras.

Open a model (.pgs) and the snapshot that it was made from, select the snapshot, then run this (Macros, Import New
Macro; or Python Shell, Run Script; or `paraview --script=compare.py`). Rotate either view. The picture follows the
Gaussian Radius and Opacity of the particles. Without a snapshot, recovered particles of the model are shown.
"""

from paraview import print_error, simple

try:
    import particlegs_reader
    import particlegs_views
except ImportError:
    print_error(
        "particlegs: first load the plug-in particlegs_reader.py, or start ParaView with its folder in PYTHONPATH"
    )
else:
    sources = list(simple.GetSources().values())
    active = simple.GetActiveSource()
    models = [s for s in sources if particlegs_views.is_model(s)]
    others = [s for s in sources if s not in models]
    if not models:
        print_error("particlegs: no model is open: open a .pgs file first")
    else:
        model = active if active in models else models[-1]
        if active in others:
            truth = active
        elif others:
            truth = others[-1]
        else:
            model.RecoverParticles = 1
            truth = simple.OutputPort(model, particlegs_reader.PARTICLES)
        layout = simple.CreateLayout("particlegs")
        views = [simple.CreateView("RenderView") for _ in range(2)]
        layout.SplitHorizontal(0, 0.5)
        for place, view in enumerate(views, start=1):
            layout.AssignView(place, view)
        try:
            simple.Show(truth, views[0])
            views[0].ResetCamera(False)
            particlegs_views.compare(model, truth, *views)
            for view in views:
                simple.Render(view)
        except Exception as error:
            print_error(particlegs_reader.one_line(error))
