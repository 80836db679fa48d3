"""The display of a model in a notebook: a picture with a table, and the viewer."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Mapping
from typing import Any

from ._files import whole
from ._particlegs import InputError
from ._types import Path


class View:
    """The viewer of a model, shown in a notebook cell.

    Attributes
    ----------
    page : str
        The page as HTML.
    height : int
        Height of the cell in pixels.
    """

    def __init__(self, page: str, height: int) -> None:
        self.page = page
        self.height = height

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Writes the page as one file that works offline."""
        with whole(path, overwrite) as begun, open(begun, "w", encoding="utf-8") as file:
            file.write(self.page)
            file.flush()

    def __repr__(self) -> str:
        return f"<View: a page of {len(self.page):,} bytes, shown in a notebook>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe title="particlegs viewer" style="width:100%;height:{self.height}px;border:0" '
            f'srcdoc="{html.escape(self.page, quote=True)}"></iframe>'
        )


def opening_of(options: Mapping[str, Any]) -> str:
    """The keywords of `Model.view` as JSON for the page."""
    said = {name: value for name, value in options.items() if value is not None}
    background = said.pop("background", None)
    if background is not None:
        if background not in ("black", "white"):
            raise InputError(f"background must be 'black' or 'white', not {background!r}")
        said["white"] = background == "white"
    camera = said.pop("camera", None)
    if camera is not None:
        said["views"] = {"views": [camera._record()]}
    return json.dumps(said, default=list)


def summary(name: str, table: Iterable[tuple[str, str]], png: bytes) -> str:
    """A picture of 480 x 270 pixels and a table of names and values, as HTML."""
    coded = base64.b64encode(png).decode()
    left = "style='text-align:left'"
    rows = "".join(
        f"<tr><th {left}>{html.escape(key)}</th><td {left}>{html.escape(value)}</td></tr>" for key, value in table
    )
    name = html.escape(name)
    return (
        "<div style='display:flex;gap:1em;align-items:flex-start;flex-wrap:wrap'>"
        f"<img width='480' height='270' alt='{name}: picture of the model' src='data:image/png;base64,{coded}'>"
        f"<table><caption style='text-align:left;font-weight:bold'>{name}</caption>{rows}</table></div>"
    )
