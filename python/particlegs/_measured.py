"""Results of statistics, one class per measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Optional

from ._types import Float64, Numbers


@dataclass(frozen=True)
class Power:
    """Power spectra by shells of wave numbers, shot noise subtracted.

    Attributes
    ----------
    k : numpy.ndarray, float64, shape (n,)
        Wave numbers, 1 over the unit of length.
    modes : numpy.ndarray, shape (n,)
        Number of modes in each shell.
    truth, other : numpy.ndarray, float64, shape (n,)
        Power, unit of length cubed.
    ratio : numpy.ndarray, float64, shape (n,)
        `other` / `truth`.
    ratio_error : numpy.ndarray, float64, shape (n,)
        Standard error of `ratio` from one box of this size to another.
    sample_error : numpy.ndarray, float64, shape (n,)
        Relative standard error of `truth` from box to box, sqrt(2 / modes): cosmic variance.
    r : numpy.ndarray, float64, shape (n,)
        Correlation of the phases, at most 1.
    shot_noise : tuple of float
        The shot noise subtracted from `truth` and `other`.
    """

    k: Float64
    modes: Numbers
    truth: Float64
    other: Float64
    ratio: Float64
    ratio_error: Float64
    sample_error: Float64
    r: Float64
    shot_noise: tuple[float, float]


@dataclass(frozen=True)
class JointHistogram:
    """How the mass of a particle type is spread over the values of two fields.

    Attributes
    ----------
    particle_type : str
        Name of the particle type.
    fields : (str, str)
        Names of the fields, x and y.
    units : (str or None, str or None)
        Their units.
    x, y : numpy.ndarray, float64, shape (n + 1,)
        Edges of the bins.
    truth, other : numpy.ndarray, float64, shape (n, n)
        Share of the mass in each cell, x first; of the particles where these have no masses.
    difference : float
        Share of the mass that lies in other cells.
    noise : float
        What `difference` is on average between two samples of one distribution.
    correlation : (float, float)
        Pearson's coefficient of both, of the logarithms along logarithmic axes; NaN where a field does not vary.
    """

    particle_type: str
    fields: tuple[str, str]
    units: tuple[Optional[str], Optional[str]]
    x: Float64
    y: Float64
    truth: Float64
    other: Float64
    difference: float
    noise: float
    correlation: tuple[float, float]


@dataclass(frozen=True)
class Correlation:
    """Two-point correlation by pair counts.

    Attributes
    ----------
    r : numpy.ndarray, float64, shape (n,)
        Geometric middles of the bins, unit of length.
    edges : numpy.ndarray, float64, shape (n + 1,)
        Edges of the bins, unit of length.
    truth, other, ratio : numpy.ndarray, float64, shape (n,)
        xi(r) of both, and `other` / `truth`.
    """

    r: Float64
    edges: Float64
    truth: Float64
    other: Float64
    ratio: Float64


@dataclass(frozen=True)
class RadialDistribution:
    """Radial distribution functions g(r).

    Attributes
    ----------
    r : numpy.ndarray, float64, shape (n,)
        Middles of the bins, unit of length.
    truth, other : numpy.ndarray, float64, shape (n,)
        g(r) of both.
    """

    r: Float64
    truth: Float64
    other: Float64


@dataclass(frozen=True)
class Groups:
    """Friends-of-friends groups in bins of size.

    Attributes
    ----------
    size : numpy.ndarray, shape (n,)
        Smallest number of particles of each bin.
    truth, other, ratio : numpy.ndarray, float64, shape (n,)
        Numbers of groups of both, and `other` / `truth`.
    """

    size: Numbers
    truth: Float64
    other: Float64
    ratio: Float64


@dataclass(frozen=True)
class Likelihood:
    """The likelihood of particles under a model.

    Attributes
    ----------
    bits : float
        Bits per particle gained over a uniform density.
    error : float
        Standard error of `bits`.
    sampled : int
        Number of particles scored.
    missed : float
        Share of particles where the model's density is below a thousandth of the uniform one.
    volume : float
        Volume of the box, unit of length cubed.
    gaussians : int
        Number of Gaussians in the model.
    needles : float
        Share of Gaussians whose longest axis is more than five times the middle one.
    """

    bits: float
    error: float
    sampled: int
    missed: float
    volume: float
    gaussians: int
    needles: float


class Field(NamedTuple):
    """A field that a model has."""

    kind: str
    """``"scalar"``, ``"vector"``, ``"logarithmic"`` (a positive scalar over decades) or ``"sum"`` (a charge)."""
    unit: Optional[str]
    """Its unit, where it is known."""
    weighting: str
    """What weighs its means: ``"mass"`` or ``"count"``."""


class Panel(NamedTuple):
    """A plot of two curves and their ratio."""

    x: Numbers
    truth: Float64
    other: Float64
    ratio: Float64
    x_label: str
    y_label: str
    scale: str
