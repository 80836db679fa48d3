"""Statistics of particles and models."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _coerce, _particlegs
from ._measured import Correlation, Groups, JointHistogram, Likelihood, Panel, Power, RadialDistribution
from ._model import Model
from ._snapshot import Snapshot, as_snapshot
from ._types import Assignment, Convention, Float64, Names, Numbers, Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _middle(edges: ArrayLike) -> Float64:
    """Geometric means of the edges of bins."""
    both = np.asarray(edges, dtype=np.float64)
    return np.asarray(np.sqrt(both[:-1] * both[1:]))


def _numbers(values: Iterable[Optional[float]]) -> Float64:
    """Floats, with NaN for None."""
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def _joint(found: dict[str, Any]) -> JointHistogram:
    x, y = (_numbers(edges) for edges in found["edges"])
    truth, other = (_numbers(share).reshape(len(x) - 1, len(y) - 1) for share in found["share"])
    return JointHistogram(
        particle_type=found["layer"],
        fields=tuple(found["fields"]),
        units=tuple(found["units"]),
        x=x,
        y=y,
        truth=truth,
        other=other,
        difference=found["difference"],
        noise=found["noise"],
        correlation=tuple(_numbers(found["correlation"])),
    )


class Stats:
    """Results: attributes for the common measures, `data` for all.

    The attributes `power`, `xi`, `rdf`, `groups` and `likelihood` are None if they were not measured; `joint` is empty.

    Attributes
    ----------
    data : dict
        The contents of the command's stats.json; docs/guide/statistics.md defines every number.
    notes : list of str
        Remarks on the results.
    length_unit : str or None
        Unit of lengths.
    """

    def __init__(self, data: dict[str, Any], length_unit: Optional[str]) -> None:
        self.data = data
        self.notes: list[str] = list(data["notes"])
        self.length_unit = length_unit

    @property
    def summary(self) -> dict[str, Any]:
        """The most important numbers that were measured."""
        return {name: value for name, value in self.data["summary"].items() if value is not None}

    @property
    def power(self) -> Union[Power, Any]:
        """Power spectra: ``k``, ``truth``, ``other``, ``ratio``, its error, ``r``, ``modes``; None if not measured.

        `k` is in 1 / unit of length, power in unit of length cubed. Shot noise is subtracted.
        """
        spectra = self.data["spectra"]
        if spectra is None:
            return None
        shells = spectra["shells"]
        power = np.array([_numbers(s["power"]) for s in shells])
        return Power(
            k=_numbers(s["k"] for s in shells),
            modes=np.array([s["modes"] for s in shells]),
            truth=power[:, 0],
            other=power[:, 1],
            ratio=_numbers(s["ratio"] for s in shells),
            ratio_error=_numbers(s["ratio_error"] for s in shells),
            sample_error=_numbers(s["sample_error"] for s in shells),
            r=_numbers(s["r"] for s in shells),
            shot_noise=(float(spectra["shot_noise"][0]), float(spectra["shot_noise"][1])),
        )

    @property
    def xi(self) -> Union[Correlation, Any]:
        """Two-point correlation by pair counts: ``r``, ``truth``, ``other``, ``ratio``; None if not measured."""
        found = self.data["xi_by_pairs"]
        if found is None:
            return None
        truth, other = found["counts"]
        return Correlation(
            r=_middle(truth["edges"]),
            edges=_numbers(truth["edges"]),
            truth=_numbers(truth["xi"]),
            other=_numbers(other["xi"]),
            ratio=_numbers(found["ratio"]),
        )

    @property
    def rdf(self) -> Union[RadialDistribution, Any]:
        """Radial distribution function: ``r``, ``truth``, ``other``; None if not measured."""
        found = self.data["rdf"]
        if found is None:
            return None
        edges = _numbers(found["edges"])
        return RadialDistribution(
            r=0.5 * (edges[:-1] + edges[1:]), truth=_numbers(found["g"][0]), other=_numbers(found["g"][1])
        )

    @property
    def groups(self) -> Union[Groups, Any]:
        """Friends-of-friends groups: ``size``, ``truth``, ``other``, ``ratio``; None if not measured."""
        found = self.data["groups"]
        if found is None:
            return None
        classes = found["histogram"]
        numbers = np.array([c["groups"] for c in classes], dtype=np.float64).reshape(-1, 2)
        return Groups(
            size=np.array([c["from"] for c in classes]),
            truth=numbers[:, 0],
            other=numbers[:, 1],
            ratio=_numbers(c["ratio"] for c in classes),
        )

    @property
    def likelihood(self) -> Union[Likelihood, Any]:
        """Bits per particle under the model, and their error; None if not measured."""
        found = self.data["likelihood"]
        return None if found is None else Likelihood(**found)

    @property
    def joint(self) -> list[JointHistogram]:
        """Joint histograms of two fields, one for each particle type; empty if not measured."""
        return [_joint(j) for j in self.data["joint"] or []]

    def plot(self, figure: Optional[Figure] = None, *, labels: tuple[str, str] = ("truth", "model")) -> Figure:
        """Plots the power spectra, correlation, groups and g(r) that were measured, each with its ratio.

        Parameters
        ----------
        figure : matplotlib.figure.Figure, optional
            Where to draw; a new figure by default.
        labels : (str, str)
            Labels of the truth and of the other.

        Returns
        -------
        matplotlib.figure.Figure
            Lengths and wave numbers are in the truth's unit of length; the grey band of a ratio is 1 %.
        """
        import matplotlib.pyplot as plt

        panels = self._panels()
        if not panels:
            raise ValueError("nothing to plot: measure power spectra, correlations, groups or g(r)")
        figure = figure or plt.figure(figsize=(4.2 * len(panels), 4.4), layout="constrained")
        heights = {"height_ratios": [2.2, 1]}
        axes = figure.subplots(2, len(panels), squeeze=False, sharex="col", gridspec_kw=heights)
        for panel, (above, below) in zip(panels, axes.T):
            _draw(panel, above, below, labels)
        return figure

    def _panels(self) -> list[Panel]:
        """The plots of the results."""
        unit = self.length_unit or "length"
        panels = []
        if (p := self.power) is not None:
            k_label, p_label = f"k ({_inverse(unit)})", f"P(k) ({_cubed(unit)})"
            panels.append(Panel(p.k, p.truth, p.other, p.ratio, k_label, p_label, "log"))
        if (x := self.xi) is not None:
            panels.append(Panel(x.r, x.truth, x.other, x.ratio, f"r ({unit})", "ξ(r)", "log"))
        if (g := self.groups) is not None:
            panels.append(Panel(g.size, g.truth, g.other, g.ratio, "particles per group", "groups", "log"))
        if (d := self.rdf) is not None and len(panels) < 4:
            with np.errstate(divide="ignore", invalid="ignore"):
                panels.append(Panel(d.r, d.truth, d.other, d.other / d.truth, f"r ({unit})", "g(r)", "linear"))
        return panels

    def __repr__(self) -> str:
        figures = ", ".join(
            f"{name}={value:.4g}" for name, value in self.summary.items() if isinstance(value, (int, float))
        )
        return f"<Stats: {figures}>"


def _inverse(unit: str) -> str:
    """1 / unit: ``h/Mpc`` for ``Mpc/h``."""
    above, _, below = unit.partition("/")
    return f"{below or 1}/{above}"


def _cubed(unit: str) -> str:
    """A unit cubed."""
    above, _, below = unit.partition("/")
    return f"{above}$^3$/{below}$^3$" if below else f"{above}$^3$"


def _label_decades(axis: Any, x: Numbers) -> None:
    """Ticks of a logarithmic axis that do not overlap: 1, 2, 5 for a short axis, powers of ten for a long one."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_minor_formatter(NullFormatter())
    lit = np.asarray(x)[np.asarray(x) > 0]
    if lit.size and np.log10(lit.max() / lit.min()) < 2.0:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _draw(panel: Panel, above: Any, below: Any, labels: tuple[str, str]) -> None:
    """Draws two curves, and their ratio below."""
    x, ratio = panel.x, panel.ratio
    marker = "." if len(x) < 40 else ""
    above.plot(x, panel.truth, color="black", marker=marker, label=labels[0])
    above.plot(x, panel.other, color="tab:orange", marker=marker, linestyle="--", label=labels[1])
    above.set_xscale(panel.scale)
    if panel.scale == "log":
        above.set_yscale("log", nonpositive="mask")
        _label_decades(below.xaxis, x)
    above.set_ylabel(panel.y_label)
    above.legend(frameon=False)
    below.axhspan(0.99, 1.01, color="0.85", zorder=0)
    below.axhline(1.0, color="0.5", linewidth=0.8)
    below.plot(x, ratio, color="tab:orange", marker=marker)
    finite = ratio[np.isfinite(ratio)]
    reach = min(1.0, max(0.03, 1.1 * np.max(np.abs(finite - 1.0)))) if finite.size else 0.1
    below.set_ylim(1.0 - reach, 1.0 + reach)
    below.set_xlabel(panel.x_label)
    below.set_ylabel(f"{labels[1]} /\n{labels[0]}")


def stats(
    truth: Union[Snapshot, Model, ArrayLike],
    other: Union[Snapshot, Model, ArrayLike],
    *,
    only: Names = (),
    convention: Convention = "correct",
    grid: Optional[int] = None,
    assignment: Assignment = "ngp",
    spectrum_grid: int = 256,
    spectrum_assignment: Assignment = "tsc",
    interlacing: bool = True,
    k_max: Optional[float] = None,
    separations: Optional[Sequence[float]] = None,
    pairs: int = 300_000_000,
    rdf_max: Optional[float] = None,
    profile_bins: int = 200,
    centers: Optional[ArrayLike] = None,
    halo_radius: Optional[float] = None,
    halo_bins: int = 20,
    linking: float = 0.2,
    linking_length: Union[float, str, None] = None,
    aperture: float = 0.128,
    neighbours: int = 500_000,
    open: bool = False,  # noqa: A002
    joint: Optional[Sequence[str]] = None,
    joint_bins: int = 50,
    fields: Sequence[Optional[Mapping[str, ArrayLike]]] = (None, None),
    velocities: Sequence[Optional[ArrayLike]] = (None, None),
    seed: int = 42,
    threads: Optional[int] = None,
    progress: Progress = None,
) -> Stats:
    """Compares particles or models.

    Parameters
    ----------
    truth, other : Snapshot, Model or array_like
        The truth, and what to compare with it. A model's density, profiles, P(k) and r(k) are measured from its
        Gaussians; pairs, groups, neighbours and g(r) need particles (`Model.recover`). For a model and particles,
        the likelihood of the particles under the model is measured too.
    only : sequence of str
        Measures: density, spectrum, pairs, groups, neighbours, moments, likelihood, rdf, profile, haloes, multipoles,
        momentum, dispersion, joint; all by default.
    convention : {"correct", "paper"}
        Definitions of the measures.
    grid : int, optional
        Cells of the density along the longest edge; cells of 8 particles by default, as in certificates.
    spectrum_grid : int
        Cells of P(k) along the longest edge.
    assignment, spectrum_assignment : {"ngp", "cic", "tsc"}
        Mass assignment.
    interlacing : bool
        Measure P(k) on two grids half a cell apart, to reduce aliasing.
    k_max : float, optional
        Largest wave number, 1 over the unit of length; the particles' Nyquist frequency by default.
    separations : (float, float), optional
        Smallest and largest separation of xi(r), unit of length.
    pairs : int
        Maximum number of pairs to count for xi(r); beyond it pairs are sampled.
    rdf_max : float, optional
        Largest distance of g(r), unit of length.
    profile_bins : int
        Bins of the profiles along the axes.
    halo_radius : float, optional
        Radius of the haloes' profiles, unit of length.
    halo_bins : int
        Bins of the haloes' profiles.
    centers : array_like, shape (n, 3), optional
        Centres of haloes; the truth's largest groups by default.
    linking, aperture : float
        Linking length of groups and radius of the apertures about their centres, in mean spacings.
    linking_length : float or str, optional
        The linking length in the truth's unit, or with a unit as in ``"0.02Mpc"``; overrides `linking`.
    neighbours : int
        Number of particles to find the nearest neighbours of.
    open : bool
        Treat no axis as periodic.
    joint : (str, str), optional
        Two scalar fields for `joint`, their joint histogram; by default the first two that both sides have.
    joint_bins : int
        Bins along either axis of the joint histogram.
    fields : (mapping or None, mapping or None)
        Fields of the snapshots `truth` and `other`, as for `compress`. Models and recovered particles have their own.
    velocities : (array_like or None, array_like or None)
        Peculiar velocities of the snapshots `truth` and `other`, shape (n, 3), km/s, for `multipoles`, `momentum` and
        `dispersion`. Models and recovered particles have their own.
    seed, threads, progress
        As for `compress`.

    Returns
    -------
    Stats
    """
    sides = [s if isinstance(s, Model) else as_snapshot(s) for s in (truth, other)]
    asked = {
        "only": _coerce.texts(only),
        "convention": convention,
        "grid": grid,
        "assignment": assignment,
        "spectrum_grid": spectrum_grid,
        "spectrum_assignment": spectrum_assignment,
        "interlacing": interlacing,
        "k_max": k_max,
        "separations": None if separations is None else [float(v) for v in separations],
        "pairs": pairs,
        "rdf_max": rdf_max,
        "profile_bins": profile_bins,
        "centers": None if centers is None else _coerce.points(centers, sides[0].length_unit).tolist(),
        "halo_radius": halo_radius,
        "halo_bins": halo_bins,
        "linking": linking,
        "linking_length": None if linking_length is None else str(linking_length),
        "aperture": aperture,
        "neighbours": neighbours,
        "joint": None if joint is None else _coerce.texts(joint),
        "joint_bins": joint_bins,
        "open": open,
        "seed": seed,
    }
    own = [[(name, *_coerce.field(values, name)) for name, values in (f or {}).items()] for f in fields]
    for arrays, v in zip(own, velocities):
        if v is not None:
            unit, values = _coerce.field(v, "velocity")
            arrays.append(("velocity", unit or "km/s", values))
    record, shown = _coerce.record(asked), _coerce.progress(progress)
    found = _particlegs.stats(sides[0]._native, sides[1]._native, record, own, threads, shown)
    return Stats(json.loads(found), sides[0].length_unit)
