"""Notes for the user as Python warnings."""

from __future__ import annotations

import os
import sys
import warnings

_OWN = os.path.dirname(__file__) + os.sep


def warn(note: str) -> None:
    """Warns, pointing to the line that called this package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OWN):
        level, frame = level + 1, frame.f_back
    warnings.warn(note, UserWarning, stacklevel=level)
