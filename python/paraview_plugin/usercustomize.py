"""What ParaView 5.11 needs under Python 3.11 and newer before it can load any plug-in written in Python.

Python imports a module of this name at its start. With this folder in PYTHONPATH ParaView's plug-in manager loads
`particlegs_reader.py` as any other plug-in, and macros find `particlegs_views`.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec
