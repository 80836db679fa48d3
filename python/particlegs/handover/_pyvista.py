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
    """Converts the points of any PyVista data set.

    Parameters
    ----------
    points : pyvista.DataSet
        Only points are used, not cells. Units are read from field data as written by `Snapshot.to_pyvista`.
    weight_data, mass_data : str, optional
        Names of the point data for weights or masses; by default ``mass``, if it exists.
    **known
        As for `Snapshot`; these override values of the data set. VTK has no boxes: give ``box``.

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
    """Converts the particles to PyVista.

    Returns
    -------
    pyvista.PolyData
        Points with a vertex each, ``mass`` if known, ``layer`` as a number, units as field data. Plot it with
        ``style="points_gaussian"`` to see ParaView's Point Gaussian.
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
    """Converts the Gaussians to PyVista.

    Returns
    -------
    pyvista.PolyData
        The means as points, with ``count``, ``mass`` (if known), ``covariance`` and its square root ``axes`` as
        tensors of 9 components (row by row), and ``layer`` as a number. ``data.glyph`` with a sphere oriented by
        ``axes``, or VTK's tensor glyphs, draw ellipsoids of one standard deviation.
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
    """Converts the values to PyVista.

    Returns
    -------
    pyvista.ImageData
        The grid, with ``density`` (or the field) as cell data and units as field data. To draw volumes and contours,
        use ``image.cell_data_to_point_data()``.
    """
    pyvista = needed("pyvista")
    image = pyvista.ImageData(dimensions=np.array(grid.shape[:3]) + 1, spacing=grid.spacing, origin=grid.origin)
    name = grid.field or "density"
    # x is the fastest; a vector's components stay together.
    values = np.moveaxis(np.asarray(grid), (0, 1, 2), (2, 1, 0))
    image.cell_data[name] = values.reshape(-1, *grid.shape[3:])
    image.field_data[f"{name}_unit"] = [grid.unit]
    if grid.length_unit is not None:
        image.field_data["length_unit"] = [grid.length_unit]
    return image
