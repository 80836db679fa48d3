"""Macro for ParaView: compresses the selected source to a `.pgs` file in the folder of its file, and opens it.

The particles are the current points of the source, which may be the output of a filter. Masses are read from an array
`masses`, `mass`, `Masses` or `Mass`, and the periodic box from field data `box` with three lengths. The ratio is the
package's default.
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
    source = simple.GetActiveSource()
    try:
        if source is None:
            raise ValueError("no source is selected: open a snapshot and select it in the Pipeline Browser")
        path = particlegs_views.compress_source(source)
        print(f"particlegs: wrote {path}")
        simple.Show(simple.OpenDataFile(path))
        simple.Render()
    except Exception as error:
        print_error(particlegs_reader.one_line(error))
