"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from ._types import Path


@contextmanager
def whole(path: Path, overwrite: bool) -> Iterator[str]:
    """Gives the name of a file to write, beside `path`; it gets its name when all went well.

    Raises
    ------
    FileExistsError
        Where something is, unless `overwrite`.
    """
    where = os.fspath(path)
    if not overwrite and os.path.lexists(where):
        raise FileExistsError(f"{where}: is there already; overwrite=True replaces it")
    folder = os.path.dirname(os.path.abspath(where))
    with tempfile.TemporaryDirectory(dir=folder, prefix=".particlegs-") as own:
        begun = os.path.join(own, os.path.basename(where))
        yield begun
        os.replace(begun, where)
