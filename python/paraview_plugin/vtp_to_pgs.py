"""Macro for ParaView: from the selected source to a `.pgs` beside its file, and open that.

The particles are the points that the source has now, so a filter's output works as well: its model stands beside the
file that the data come from. An array `masses`, `mass` or `Masses` becomes masses; a field datum `box` of three
lengths the periodic box, which VTP itself cannot say. The ratio is the package's default.
"""

from paraview import print_error, simple

try:
    import particlegs_reader
    import particlegs_views
except ImportError:
    print_error(
        "particlegs: load the plug-in particlegs_reader.py first, or start ParaView with its folder in PYTHONPATH"
    )
else:
    source = simple.GetActiveSource()
    try:
        if source is None:
            raise ValueError("no source is selected: open a snapshot, and select it in the Pipeline Browser")
        path = particlegs_views.compress_source(source)
        print(f"particlegs: wrote {path}")
        simple.Show(simple.OpenDataFile(path))
        simple.Render()
    except Exception as error:
        print_error(particlegs_reader.one_line(error))
