"""Arrays that know their unit and where they lie."""

from __future__ import annotations

import numpy as np


class _Placed(np.ndarray):
    """An array with names of its own; parts of it are plain arrays where the place no longer fits."""

    _names: tuple[str, ...] = ()

    @classmethod
    def _of(cls, values, **named):
        array = np.asarray(values).view(cls)
        for name in cls._names:
            setattr(array, name, named[name])
        return array

    def __array_finalize__(self, other):
        for name in self._names:
            setattr(self, name, getattr(other, name, None))

    def __getitem__(self, index):
        part = super().__getitem__(index)
        if isinstance(part, _Placed) and part.shape != self.shape:
            return part.view(np.ndarray)
        return part

    def __array_wrap__(self, array, context=None, return_scalar=False):
        if array.ndim == 0:
            return array[()]
        if array.shape != self.shape:
            return array.view(np.ndarray)
        placed = array.view(type(self))
        for name in self._names:
            setattr(placed, name, getattr(self, name))
        return placed

    def __reduce__(self):
        build, arguments, state = super().__reduce__()
        return build, arguments, (state, {name: getattr(self, name) for name in self._names})

    def __setstate__(self, state):
        super().__setstate__(state[0])
        for name, value in state[1].items():
            setattr(self, name, value)


class Map(_Placed):
    """Values over a plane, float64, shape (height, width), rows from the top.

    Attributes
    ----------
    extent : tuple of float or None
        Left, right, bottom, top in world units, as ``plt.imshow(m, extent=m.extent)`` takes it; ``None`` of a
        perspective picture.
    unit : str
        Unit of the values, such as ``Msun/h / (Mpc/h)^2``.
    length_unit : str or None
        Unit of the extent.
    axes : tuple of str or None
        Names of the axes across and up.
    """

    _names = ("extent", "unit", "length_unit", "axes")

    def plot(self, ax=None, *, cmap="inferno", vmin=None, vmax=None, colorbar=True, **options):
        """Draws the map in logarithmic colours with axes, units and a colour bar.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; the current axes by default.
        cmap : str
            Colour map of matplotlib.
        vmin, vmax : float, optional
            Values of the first and the last colour; the four decades below the brightest by default.
        colorbar : bool
            Draw a colour bar.
        **options
            For ``Axes.imshow``.

        Returns
        -------
        matplotlib.image.AxesImage
        """
        import matplotlib.pyplot as plt
        from matplotlib.colors import LogNorm

        ax = ax or plt.gca()
        values = np.asarray(self)
        lit = values[values > 0]
        top = vmax or (np.quantile(lit, 0.999) if lit.size else 1.0)
        low = vmin or (max(np.quantile(lit, 0.01), top * 1e-4) if lit.size else 0.1)
        norm = LogNorm(low, max(top, low * 1.0001))
        shown = np.maximum(values, low)
        image = ax.imshow(shown, extent=self.extent, cmap=cmap, norm=norm, **options)
        if self.extent is None:
            ax.set_axis_off()
        else:
            of = self.length_unit or "data units"
            ax.set_xlabel(f"{self.axes[0]} ({of})")
            ax.set_ylabel(f"{self.axes[1]} ({of})")
        if colorbar:
            ax.figure.colorbar(image, ax=ax, label=f"surface density ({self.unit})")
        return image


class Grid(_Placed):
    """Averages over cells, float64, shape (nx, ny, nz); ``grid[i, j, k]`` lies along x, y, z.

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
    outside : float
        Mass (or particles) that lies beyond open edges of the grid; 0 of a periodic box.
    """

    _names = ("origin", "spacing", "unit", "length_unit", "outside")

    @property
    def cell_volume(self) -> float:
        """Volume of a cell; ``grid.sum() * grid.cell_volume + grid.outside`` is the mass."""
        return float(np.prod(self.spacing))
