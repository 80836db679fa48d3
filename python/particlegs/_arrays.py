"""Arrays with units and positions."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, ClassVar, Optional

import numpy as np

from . import handover
from ._particlegs import InputError, density_range
from ._types import Extent, Three

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from typing_extensions import Self

_Floats = np.ndarray[Any, np.dtype[np.float64]]


# Operations on two arrays that mean something in one unit alone.
_IN_ONE_UNIT = {np.add, np.subtract, np.maximum, np.minimum, np.less, np.less_equal, np.greater, np.greater_equal}


def _quantity(array: Any) -> str:
    title, unit = getattr(array, "title", None), getattr(array, "unit", None)
    return f"{title or 'density'} in {unit or 'no unit'}"


class _Placed(_Floats):
    """An array with attributes; slices of another shape are plain arrays."""

    _names: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def _of(cls, values: Any, **named: Any) -> Self:
        array = np.asarray(values).view(cls)
        for name in cls._names:
            setattr(array, name, named[name])
        return array

    def __array_finalize__(self, other: Any) -> None:
        for name in self._names:
            setattr(self, name, getattr(other, name, None))

    def __getitem__(self, index: Any) -> Any:
        part = super().__getitem__(index)
        if isinstance(part, _Placed) and part.shape != self.shape:
            return part.view(np.ndarray)
        return part

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        if context is not None and context[0] in _IN_ONE_UNIT:
            quantities = {_quantity(a) for a in context[1] if isinstance(a, _Placed)}
            if len(quantities) > 1:
                raise InputError(f"the arrays have {' and '.join(sorted(quantities))}: convert one of them first")
        if array.ndim == 0:
            return array[()]
        if array.shape != self.shape:
            return array.view(np.ndarray)
        placed = array.view(type(self))
        for name in self._names:
            setattr(placed, name, getattr(self, name))
        return placed

    def __reduce__(self) -> Any:
        made: Any = super().__reduce__()
        build, arguments, state = made
        return build, arguments, (state, {name: getattr(self, name) for name in self._names})

    def __setstate__(self, state: Any) -> None:
        super().__setstate__(state[0])
        for name, value in state[1].items():
            setattr(self, name, value)


def _printed(unit: str) -> str:
    """A unit with its powers in matplotlib's markup."""
    return re.sub(r"\^([0-9]+)", r"$^\1$", unit)


class Map(_Placed):
    """Values over a plane, float64, shape (height, width); row 0 is the top.

    Attributes
    ----------
    extent : tuple of float or None
        Left, right, bottom, top in world units, for ``plt.imshow(m, extent=m.extent)``; ``None`` for a perspective
        picture.
    unit : str
        Unit of the values, such as ``Msun/h / (Mpc/h)^2``.
    length_unit : str or None
        Unit of the extent.
    axes : tuple of str or None
        Names of the horizontal and the vertical axis.
    hubble : float or None
        Value of h in the units, if known.
    title : str or None
        What is shown, if the values are not densities, such as ``velocity along x``.
    scale : str or None
        Scale of a field's colours: ``linear``, ``log`` or ``signed``.
    """

    _names = ("extent", "unit", "length_unit", "axes", "hubble", "title", "scale")

    extent: Optional[Extent]
    unit: str
    length_unit: Optional[str]
    axes: Optional[tuple[str, str]]
    hubble: Optional[float]
    title: Optional[str]
    scale: Optional[str]

    @property
    def pixel_area(self) -> float:
        """Area of a pixel, unit of length squared; ``m.sum() * m.pixel_area`` is the mass in the window."""
        if self.extent is None:
            raise ValueError("pixels of a perspective picture have different areas")
        left, right, bottom, top = self.extent
        return (right - left) * (top - bottom) / self.size

    def plot(
        self,
        ax: Optional[Axes] = None,
        *,
        cmap: Optional[str] = None,
        vmin: Optional[float] = None,
        vmax: Optional[float] = None,
        colorbar: bool = True,
        **options: Any,
    ) -> AxesImage:
        """Draws the map with axes, units and a colour bar.

        Densities have logarithmic colours, fields those of their `scale`; pixels of these without mass are transparent.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; the current axes by default.
        cmap : str, optional
            Colour map of matplotlib; by default ``inferno`` for densities, ``viridis`` for fields and ``coolwarm`` for
            signed ones.
        vmin, vmax : float, optional
            Values of the lowest and the highest colour. By default the 5th and the 99.5th percentile of a density's
            pixels that are not empty; empty ones have the map's first colour. Of a field the 1st and the 99th
            percentile, or as far as the 99th of the sizes on either side of zero.
        colorbar : bool
            Draw a colour bar.
        **options
            For ``Axes.imshow``.

        Returns
        -------
        matplotlib.image.AxesImage
        """
        import matplotlib.pyplot as plt

        ax = ax or plt.gca()
        shown, colors, norm = self._field_colors(cmap, vmin, vmax) if self.scale else self._colors(cmap, vmin, vmax)
        image = ax.imshow(shown, extent=self.extent, cmap=colors, norm=norm, **options)
        if self.extent is None or self.axes is None:
            ax.set_axis_off()
        else:
            of = self.length_unit or "data units"
            across, up = self.axes
            ax.set_xlabel(f"{across} ({of})")
            ax.set_ylabel(f"{up} ({of})")
        if colorbar:
            # Makes the colour bar as tall as the map.
            beside = ax.inset_axes((1.03, 0.0, 0.045, 1.0))
            ax.figure.colorbar(image, cax=beside, label=self._label())
        return image

    def _label(self) -> str:
        unit = f" ({_printed(self.unit)})" if self.unit else ""
        return (self.title or "surface density") + unit

    def _colors(self, cmap: Optional[str], vmin: Optional[float], vmax: Optional[float]) -> tuple[Any, Any, Any]:
        """A density's values, colours and their norm."""
        import matplotlib.pyplot as plt
        from matplotlib.colors import ListedColormap, LogNorm

        values = np.asarray(self)
        found, lowest = density_range(values)
        low, top = found or (0.1, 1.0)
        low, top = vmin or low, vmax or top
        top = max(top, low * 1.0001)
        whole = plt.get_cmap(cmap or "inferno")
        colors = ListedColormap(whole(np.linspace(lowest, 1.0, 255))).with_extremes(bad=whole(0.0))
        # Very low densities (tails of Gaussians) count as empty.
        empty = ~(values > low * (low / top) ** (lowest / (1.0 - lowest)))
        return np.ma.masked_where(empty, np.maximum(values, low)), colors, LogNorm(low, top)

    def _field_colors(self, cmap: Optional[str], vmin: Optional[float], vmax: Optional[float]) -> tuple[Any, Any, Any]:
        """A field's values, colours and their norm; pixels without mass are masked."""
        import matplotlib.pyplot as plt
        from matplotlib.colors import LogNorm, Normalize

        values, logarithmic = np.asarray(self), self.scale == "log"
        there = values[np.isfinite(values) & (values > 0.0) if logarithmic else np.isfinite(values)]
        if self.scale == "signed":
            far = float(np.percentile(np.abs(there), 99.0)) if there.size else 1.0
            low, top = -far, far
        else:
            low, top = (float(v) for v in np.percentile(there, (1.0, 99.0))) if there.size else (1.0, 10.0)
        low, top = low if vmin is None else vmin, top if vmax is None else vmax
        if not low < top:
            half = 0.5 * (abs(low) or 1.0)
            low, top = (low / 1.5, low * 1.5) if logarithmic else (low - half, low + half)
        colors = plt.get_cmap(cmap or ("coolwarm" if self.scale == "signed" else "viridis"))
        return np.ma.masked_invalid(values), colors, LogNorm(low, top) if logarithmic else Normalize(low, top)

    to_astropy = handover.to_astropy


class Grid(_Placed):
    """Averages over cells, float64, shape (nx, ny, nz), indexed ``grid[i, j, k]`` along x, y, z.

    Attributes
    ----------
    origin : tuple of float
        Lowest corner, world units.
    spacing : tuple of float
        Edges of a cell, world units.
    unit : str
        Unit of the values, such as ``Msun/h / (Mpc/h)^3``.
    length_unit : str or None
        Unit of origin and spacing.
    periodic : tuple of bool
        Along which axes the grid is periodic.
    hubble : float or None
        Value of h in the units, if known.
    outside : float
        Mass (or number of particles) beyond open edges of the grid; 0 for a periodic box.
    field : str or None
        Name of the field, if the values are not densities.
    """

    _names = ("origin", "spacing", "unit", "length_unit", "periodic", "hubble", "outside", "field")

    origin: Three
    spacing: Three
    unit: str
    length_unit: Optional[str]
    periodic: tuple[bool, bool, bool]
    hubble: Optional[float]
    outside: float
    field: Optional[str]

    to_astropy = handover.to_astropy
    to_pyvista = handover.grid_to_pyvista
    to_yt = handover.grid_to_yt

    @property
    def cell_volume(self) -> float:
        """Volume of a cell; ``grid.sum() * grid.cell_volume + grid.outside`` is the mass."""
        return float(np.prod(self.spacing))
