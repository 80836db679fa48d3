"""Lets ParaView 5.11 with Python 3.11 or newer load plug-ins written in Python.

Python imports a module of this name when it starts. With this folder in PYTHONPATH, ParaView's plug-in manager can load
`particlegs_reader.py`, and macros can import `particlegs_views`.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec
