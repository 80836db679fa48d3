"""Statistics of particles and models."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np

from . import _coerce, _particlegs
from ._model import Model
from ._snapshot import as_snapshot


def _middle(edges):
    """Geometric middles of bins."""
    edges = np.asarray(edges)
    return np.sqrt(edges[:-1] * edges[1:])


def _numbers(values):
    """Floats, with NaN where nothing is known."""
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


class Stats:
    """What was measured: attributes for the common measures, `data` for all.

    Attributes
    ----------
    data : dict
        As the command's stats.json has it; docs/guide/statistics.md defines every figure.
    notes : list of str
        What to know of the figures.
    length_unit : str or None
        Unit of lengths.
    """

    def __init__(self, data, length_unit):
        self.data = data
        self.notes = list(data["notes"])
        self.length_unit = length_unit

    @property
    def summary(self) -> dict:
        """One figure a question, those alone that were measured."""
        return {name: value for name, value in self.data["summary"].items() if value is not None}

    @property
    def power(self):
        """Power spectra: ``k``, ``truth``, ``other``, ``ratio``, ``r``, ``modes`` as arrays; None where not measured.

        `k` in 1 over the unit of length, powers in the unit of length cubed, shot noise subtracted.
        """
        spectra = self.data["spectra"]
        if spectra is None:
            return None
        shells = spectra["shells"]
        power = np.array([_numbers(s["power"]) for s in shells])
        return SimpleNamespace(
            k=_numbers(s["k"] for s in shells),
            modes=np.array([s["modes"] for s in shells]),
            truth=power[:, 0],
            other=power[:, 1],
            ratio=_numbers(s["ratio"] for s in shells),
            r=_numbers(s["r"] for s in shells),
            shot_noise=tuple(spectra["shot_noise"]),
        )

    @property
    def xi(self):
        """Two-point correlation by pair counts: ``r``, ``truth``, ``other``, ``ratio``; None where not measured."""
        found = self.data["xi_by_pairs"]
        if found is None:
            return None
        truth, other = found["counts"]
        return SimpleNamespace(
            r=_middle(truth["edges"]),
            edges=_numbers(truth["edges"]),
            truth=_numbers(truth["xi"]),
            other=_numbers(other["xi"]),
            ratio=_numbers(found["ratio"]),
        )

    @property
    def rdf(self):
        """Radial distribution function: ``r`` and ``truth``, ``other``; None where not measured."""
        found = self.data["rdf"]
        if found is None:
            return None
        edges = _numbers(found["edges"])
        return SimpleNamespace(
            r=0.5 * (edges[:-1] + edges[1:]), truth=_numbers(found["g"][0]), other=_numbers(found["g"][1])
        )

    @property
    def groups(self):
        """Friends-of-friends groups: ``size`` (least of a class), ``truth``, ``other``, ``ratio``; None where not measured."""
        found = self.data["groups"]
        if found is None:
            return None
        classes = found["histogram"]
        numbers = np.array([c["groups"] for c in classes], dtype=np.float64).reshape(-1, 2)
        return SimpleNamespace(
            size=np.array([c["from"] for c in classes]),
            truth=numbers[:, 0],
            other=numbers[:, 1],
            ratio=_numbers(c["ratio"] for c in classes),
        )

    @property
    def likelihood(self):
        """Bits a particle under the model, with their error; None where not measured."""
        found = self.data["likelihood"]
        return None if found is None else SimpleNamespace(**found)

    def plot(self, figure=None):
        """Draws what was measured: power spectra, correlation, groups, g(r); each with its ratio.

        Parameters
        ----------
        figure : matplotlib.figure.Figure, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.figure.Figure
        """
        import matplotlib.pyplot as plt

        unit = self.length_unit or "length"
        inverse = f"1/({unit})" if "/" in unit else f"1/{unit}"
        panels = []
        if self.power is not None:
            p = self.power
            volume = f"({unit})$^3$" if "/" in unit else f"{unit}$^3$"
            panels.append((p.k, p.truth, p.other, p.ratio, f"k ({inverse})", f"P(k) ({volume})", "log"))
        if self.xi is not None:
            x = self.xi
            panels.append((x.r, x.truth, x.other, x.ratio, f"r ({unit})", "ξ(r)", "log"))
        if self.groups is not None:
            g = self.groups
            panels.append((g.size, g.truth, g.other, g.ratio, "particles a group", "groups", "log"))
        if self.rdf is not None and len(panels) < 4:
            d = self.rdf
            with np.errstate(divide="ignore", invalid="ignore"):
                panels.append((d.r, d.truth, d.other, d.other / d.truth, f"r ({unit})", "g(r)", "linear"))
        if not panels:
            raise ValueError("nothing was measured that is drawn: power spectra, correlations, groups or g(r)")
        figure = figure or plt.figure(figsize=(4.2 * len(panels), 4.4), layout="constrained")
        axes = figure.subplots(
            2, len(panels), squeeze=False, sharex="col", gridspec_kw={"height_ratios": [2.2, 1]}
        )
        for (x, truth, other, ratio, x_label, y_label, scale), (above, below) in zip(panels, axes.T):
            above.plot(x, truth, color="black", label="truth")
            above.plot(x, other, color="tab:orange", linestyle="--", label="model")
            if scale == "log":
                above.set_xscale("log")
                above.set_yscale("log")
            above.set_ylabel(y_label)
            below.axhspan(0.99, 1.01, color="0.85", zorder=0)
            below.axhline(1.0, color="0.5", linewidth=0.8)
            below.plot(x, ratio, color="tab:orange")
            finite = ratio[np.isfinite(ratio)]
            reach = min(1.0, max(0.03, 1.1 * np.max(np.abs(finite - 1.0)))) if finite.size else 0.1
            below.set_ylim(1.0 - reach, 1.0 + reach)
            below.set_xlabel(x_label)
            below.set_ylabel("model / truth")
            above.legend(frameon=False)
        return figure

    def __repr__(self):
        figures = ", ".join(
            f"{name}={value:.4g}" for name, value in self.summary.items() if isinstance(value, (int, float))
        )
        return f"<Stats: {figures}>"


def stats(
    truth,
    other,
    *,
    only=(),
    convention="correct",
    grid=256,
    assignment="ngp",
    spectrum_grid=256,
    spectrum_assignment="tsc",
    interlacing=True,
    k_max=None,
    separations=None,
    pairs=300_000_000,
    rdf_max=None,
    profile_bins=200,
    centers=None,
    halo_radius=None,
    halo_bins=20,
    linking=0.2,
    aperture=0.128,
    neighbours=500_000,
    open=False,  # noqa: A002
    seed=42,
    threads=None,
    progress=None,
) -> Stats:
    """Measures particles or a model against others.

    Parameters
    ----------
    truth, other : Snapshot, Model or array_like
        The truth, and what is compared with it. A model is measured from its Gaussians: density, profiles, P(k),
        r(k); pairs, groups, neighbours and g(r) need particles (`Model.recover`). A model and particles also give
        the likelihood of those under it.
    only : sequence of str
        Measures: density, spectrum, pairs, groups, neighbours, moments, likelihood, rdf, profile, haloes; all by
        default.
    convention : {"correct", "paper"}
        Definitions to measure by.
    grid, spectrum_grid : int
        Cells along the longest edge, of the density and of P(k).
    assignment, spectrum_assignment : {"ngp", "cic", "tsc"}
        Mass assignment.
    k_max : float, optional
        Largest wave number; the particles' Nyquist frequency by default.
    separations : (float, float), optional
        Smallest and largest separation of xi(r).
    centers : array_like, shape (n, 3), optional
        Centres of haloes; the truth's largest groups by default.
    linking, aperture : float
        Linking length of groups and radius of the apertures about their centres, in mean spacings.
    open : bool
        Treat no axis as periodic.
    seed, threads, progress
        As for `compress`.

    Returns
    -------
    Stats
    """
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
        "centers": None if centers is None else _coerce.points(centers).tolist(),
        "halo_radius": halo_radius,
        "halo_bins": halo_bins,
        "linking": linking,
        "aperture": aperture,
        "neighbours": neighbours,
        "open": open,
        "seed": seed,
    }
    sides = [s if isinstance(s, Model) else as_snapshot(s) for s in (truth, other)]
    natives = [s._native for s in sides]
    found = _particlegs.stats(*natives, asked, threads, _coerce.progress(progress))
    return Stats(json.loads(found), sides[0].length_unit)
