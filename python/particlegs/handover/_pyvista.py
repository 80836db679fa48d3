"""PyVista: points and images of VTK."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .._particlegs import InputError
from ._common import mass_of_each, needed

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .._arrays import Grid
    from .._gaussians import Gaussians
    from .._snapshot import Snapshot
    from .._types import Known


def from_pyvista(
    cls: type[Snapshot],
    /,
    points: Any,
    *,
    weight_data: Optional[str] = None,
    mass_data: Optional[str] = None,
    **known: Unpack[Known],
) -> Snapshot:
    """Takes the points of any data set of PyVista.

    Parameters
    ----------
    points : pyvista.DataSet
        Its points; cells do not matter. The field data that `Snapshot.to_pyvista` writes (units) is understood.
    weight_data, mass_data : str, optional
        Names of the point data to take as weights, or masses; ``mass`` by default where there is one.
    **known
        As for `Snapshot`; in place of what the data set says. VTK has no boxes: say ``box``.

    Returns
    -------
    Snapshot
    """
    said: dict[str, Any] = {}
    for key, field in (("units", "length_unit"), ("mass_units", "mass_unit")):
        if field in points.field_data:
            said[key] = str(points.field_data[field][0])
    if mass_data is None and weight_data is None and "mass" in points.point_data:
        mass_data = "mass"
    for key, name in (("masses", mass_data), ("weights", weight_data)):
        if name is not None and name not in points.point_data:
            raise InputError(f'no point data "{name}": there are {", ".join(points.point_data)}')
        if name is not None:
            said[key] = np.asarray(points.point_data[name])
    return cls(np.asarray(points.points), **{**said, **known})


def to_pyvista(snapshot: Snapshot) -> Any:
    """Hands the particles to PyVista.

    Returns
    -------
    pyvista.PolyData
        Points with a vertex each, ``mass`` where it is known, ``layer`` as a number, the units as field data. Drawn as
        ParaView's Point Gaussian by ``style="points_gaussian"``.
    """
    pyvista = needed("pyvista")
    data = pyvista.PolyData(np.array(snapshot.positions))
    each = mass_of_each(snapshot)
    if each is not None:
        data.point_data["mass"] = np.array(each)
    layer = np.zeros(len(snapshot), dtype=np.uint8)
    for number, part in enumerate(snapshot.layers.values()):
        layer[part] = number
    data.point_data["layer"] = layer
    data.field_data["layers"] = list(snapshot.layers)
    for name, text in (("length_unit", snapshot.length_unit), ("mass_unit", snapshot.mass_unit)):
        if text is not None:
            data.field_data[name] = [text]
    if snapshot.synthetic:
        data.field_data["synthetic"] = [str(snapshot.notes["synthetic"])]
    return data


def gaussians_to_pyvista(gaussians: Gaussians) -> Any:
    """Hands the Gaussians to PyVista.

    Returns
    -------
    pyvista.PolyData
        Their means as points, with ``count``, ``mass`` (where known), ``covariance`` and its square root
        ``axes`` as tensors of 9 components (row by row), ``layer`` as a number. ``data.glyph`` of a sphere oriented
        by ``axes``, or VTK's tensor glyphs, draw ellipsoids of one standard deviation.
    """
    pyvista = needed("pyvista")
    data = pyvista.PolyData(np.array(gaussians.means))
    data.point_data["count"] = np.array(gaussians.counts)
    if gaussians.masses is not None:
        data.point_data["mass"] = np.array(gaussians.masses)
    values, vectors = np.linalg.eigh(gaussians.covariances)
    roots = np.einsum("nij,nj,nkj->nik", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)
    data.point_data["covariance"] = np.array(gaussians.covariances).reshape(-1, 9)
    data.point_data["axes"] = roots.reshape(-1, 9)
    layer = np.zeros(len(gaussians), dtype=np.uint8)
    for number, part in enumerate(gaussians.layers.values()):
        layer[part] = number
    data.point_data["layer"] = layer
    data.field_data["layers"] = list(gaussians.layers)
    return data


def grid_to_pyvista(grid: Grid) -> Any:
    """Hands the density to PyVista.

    Returns
    -------
    pyvista.ImageData
        The grid, with ``density`` as cell data and the units as field data. ``image.cell_data_to_point_data()``
        makes what volumes and contours are drawn of.
    """
    pyvista = needed("pyvista")
    image = pyvista.ImageData(dimensions=np.array(grid.shape) + 1, spacing=grid.spacing, origin=grid.origin)
    image.cell_data["density"] = np.asarray(grid).ravel(order="F")
    image.field_data["density_unit"] = [grid.unit]
    if grid.length_unit is not None:
        image.field_data["length_unit"] = [grid.length_unit]
    return image
