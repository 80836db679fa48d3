"""The Gaussians of a model."""

from __future__ import annotations

from typing import NamedTuple, Optional

from . import _particlegs, handover
from ._types import Float64


class FieldMoments(NamedTuple):
    """What each Gaussian has of a field; NaN in layers without it."""

    means: Float64
    """Means, (n,), or (n, 3) for a vector."""
    slopes: Float64
    """Change along x, y and z, (n, 3), or (n, 3, 3) with the component second; the field's unit over a world unit."""
    covariances: Float64
    """Covariances about the mean plus slope, (n, 3, 3); variances (n,) for a scalar."""


class Gaussians:
    """The Gaussians of a model as read-only arrays, layer by layer.

    Attributes
    ----------
    means : numpy.ndarray, float64, shape (n, 3)
        World units.
    covariances : numpy.ndarray, float64, shape (n, 3, 3)
        World units squared.
    counts : numpy.ndarray, float64, shape (n,)
        Number of particles of each Gaussian; whole numbers.
    masses : numpy.ndarray, float64, shape (n,), or None
        Mass of each, in the model's unit; None if masses are unknown.
    opacities, grey_levels : numpy.ndarray, float64, shape (n,), or None
        Only for alpha-blend models.
    fields : dict of str to FieldMoments
        Means, slopes and covariances of fields.
    layers : dict of str to slice
        The Gaussians of each layer.
    """

    def __init__(self, native: _particlegs.Gaussians) -> None:
        self._native = native

    to_pyvista = handover.gaussians_to_pyvista

    def __len__(self) -> int:
        return len(self._native)

    @property
    def means(self) -> Float64:
        """Means, (n, 3), world units."""
        return self._native.means

    @property
    def covariances(self) -> Float64:
        """Covariances, (n, 3, 3), world units squared."""
        return self._native.covariances

    @property
    def counts(self) -> Float64:
        """Number of particles of each Gaussian, (n,)."""
        return self._native.counts

    @property
    def masses(self) -> Optional[Float64]:
        """Masses, (n,), or None if they are unknown."""
        return self._native.masses

    @property
    def opacities(self) -> Optional[Float64]:
        """Opacities of an alpha-blend model, (n,); None for others."""
        return self._native.opacities

    @property
    def grey_levels(self) -> Optional[Float64]:
        """Grey levels of an alpha-blend model, (n,); None for others."""
        return self._native.grey_levels

    @property
    def fields(self) -> dict[str, FieldMoments]:
        """Means, slopes and covariances of fields, by name."""
        return {name: FieldMoments(*numbers) for name, *numbers in self._native.fields}

    @property
    def layers(self) -> dict[str, slice]:
        """The Gaussians of each layer, as slices."""
        return {name: slice(first, end) for name, first, end in self._native.layer_ranges}

    def __repr__(self) -> str:
        return f"<Gaussians: {len(self)} in {len(self.layers)} layer(s)>"
