"""Writes files completely or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from ._types import Path


@contextmanager
def whole(path: Path, overwrite: bool) -> Iterator[str]:
    """Yields the name of a temporary file in the same folder; it is renamed to `path` if all went well.

    Raises
    ------
    FileExistsError
        If the path exists, unless `overwrite`.
    """
    where = os.fspath(path)
    if not overwrite and os.path.lexists(where):
        raise FileExistsError(f"{where} exists already: overwrite=True replaces it")
    folder = os.path.dirname(os.path.abspath(where))
    with tempfile.TemporaryDirectory(dir=folder, prefix=".particlegs-") as own:
        begun = os.path.join(own, os.path.basename(where))
        yield begun
        os.replace(begun, where)
