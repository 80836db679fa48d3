#!/usr/bin/env python3
"""Writes docs/results/full-scale.md and docs/images/full-scale-growth.svg from the results of full-scale.py (needs matplotlib).

    scripts/full-scale-page.py docs/results/full-scale.json
"""
import json, os, sys

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "particlegs"
import matplotlib.pyplot as plt

with open(sys.argv[1]) as f:
    R = json.load(f)
DOCS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "docs")
PHASES = ("divide", "read", "fit", "code", "decode", "certificate")
out = []


def row(*cells):
    out.append("| " + " | ".join(str(c) for c in cells) + " |")


def seconds(v):
    return f"{v:.0f}" if v >= 20 else f"{v:.1f}"


def told(name):
    """A run's name; those before certificates had densities in cells are of an earlier fit."""
    return name if "densities" in R[name]["certificate"] else name + " (earlier fit)"


def run_table(names):
    row("run", "Gaussians", "bytes", "wall, s", "CPU, s", *(p + ", s" for p in PHASES), "peak anonymous, MiB")
    row(*["---"] * (6 + len(PHASES)))
    for name in names:
        if name in R:
            r = R[name]
            phases = [seconds(r["seconds_by_phase"].get(p, 0)) for p in PHASES]
            row(told(name), f'{r["gaussians"]:,}', f'{r["model_bytes"]:,}', seconds(r["wall_seconds"]), seconds(r["cpu_seconds"]),
                *phases, r["peak_anonymous_mib"])


def score_table(names):
    row("run", *(f"{o} {look}" for o in ("far", "mid", "near") for look in ("paraview", "no-fxaa", "expected")))
    row(*["---"] * 10)
    for name in names:
        if name in R and R[name]["certificate"]:
            cells = []
            for orbit in R[name]["certificate"]["orbits"]:
                for look in ("paraview", "paraview_no_fxaa", "expected"):
                    s = orbit[look]
                    beside = s["noise_free"]["masked_psnr"]
                    cells.append(f'{s["masked_psnr"]:.2f}' + (f" ({beside:.2f})" if beside else ""))
            row(told(name), *cells)


FULL = [f"ratio-{r}-blocks-{b}" for r in (290, 65, 3000) for b in (1, 8)]
FAST = ["fast-290-blocks-1", "fast-290-blocks-8", "fast-290-memory-1G"]
GROWTH = [("2.1M", 1 << 21), ("16.8M", 1 << 24), ("67M", 1 << 26)]

out.append("""# Full scale: nbody128 tiled 2x8x8 (268 435 456 particles, 3.2 GB)

Two Xeon cores, 24 GiB. Every run: `scripts/full-scale.py PARTICLEGS nbody128 WORK docs/results/full-scale.json`; this page:
`scripts/full-scale-page.py docs/results/full-scale.json`. The commands stand in the JSON. Other work shared the machine during
some runs (`load_average` in the JSON): CPU seconds compare them, wall-clock seconds do not. Peak anonymous memory is RssAnon, mapped
files and scratch files apart.

## Time by phase and memory
""")
run_table(FULL + FAST)
out.append("""
## Scores
Masked PSNR, dB, 1920 x 1080, one frame an orbit, default radius, opacity 0.05 (the files' certificates); in brackets the noise-free picture of
all particles against the same target, which no model can expect to pass ([scores](../law/scores.md): `paraview` holds the shot noise of single
particles). `expected` is the noise-free picture itself.
""")
score_table(FULL + FAST)
out.append("""
## Growth from 0.26 M to 268 M particles
`--ratio 290`, one block. Snapshots: nbody64 (0.26 M), nbody128 (2.1 M), nbody128 tiled.

![time, memory and size by particles](../images/full-scale-growth.svg)
""")
row("particles", "effort", "wall, s", "CPU, s", "peak anonymous, MiB", "bytes")
row(*["---"] * 6)
series = {}
for effort, prefix, last in (("fast", "growth-fast-", "fast-290-blocks-1"), ("default", "growth-", "ratio-290-blocks-1")):
    for name in [prefix + s for s in ("0.26M", "2.1M", "16.8M", "67M")] + [last]:
        if name in R:
            r = R[name]
            n = r["particles"]
            series.setdefault(effort, []).append((n, r))
            row(f"{n:,}", effort, seconds(r["wall_seconds"]), seconds(r["cpu_seconds"]), r["peak_anonymous_mib"], f'{r["model_bytes"]:,}')

fig, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
for ax, key, label, scale in zip(axes, ("cpu_seconds", "peak_anonymous_mib", "model_bytes"),
                                 ("CPU time, s", "peak anonymous memory, MiB", "model file, MB"), (1, 1, 1e-6)):
    for effort, points in series.items():
        ax.plot([n for n, _ in points], [r[key] * scale for _, r in points], "o-", label=effort)
    if key == "peak_anonymous_mib":
        ns = [n for n, _ in series["fast"]]
        ax.plot(ns, [12 * n / 2**20 for n in ns], "k:", label="12 bytes a particle")
    ax.set(xscale="log", yscale="log", xlabel="particles", ylabel=label)
    ax.grid(True, which="major", alpha=0.3)
    ax.legend(frameon=False)
fig.savefig(os.path.join(DOCS, "images", "full-scale-growth.svg"), metadata={"Date": None})
fig.savefig("/tmp/full-scale-growth.png", dpi=80) if os.environ.get("LOOK") else None

with open(os.path.join(DOCS, "results", "full-scale.md"), "w") as f:
    f.write("\n".join(out) + "\n")
