#!/usr/bin/env python3
"""Haloes of models against the same finder on their particles, and ours against CompaSO's: tables for
docs/results/haloes.md. Needs numpy.

  lab/haloes.py models particlegs WORK RATIO NAME=SNAPSHOT:OPTIONS ...
  lab/haloes.py compaso particlegs WORK ABACUS    (raw columns and haloes.csv)
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np


def table(path):
    """Columns of a catalogue as `haloes` writes it."""
    return np.genfromtxt(path, delimiter=",", names=True)


def run(*words):
    subprocess.run([str(w) for w in words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def models(program, work, ratio, *sets):
    print(
        f"| ratio {ratio} | haloes of 300 and more | completeness | purity | M200m: median | scatter "
        "| 100 to 300 particles, number | 300 and more, number | (M - truth) / error: rms |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for item in sets:
        name, _, rest = item.partition("=")
        snapshot, _, options = rest.partition(":")
        model, out = Path(work) / f"{name}-{ratio}.pgs", Path(work) / f"{name}-{ratio}"
        if not model.exists():
            run(program, "compress", snapshot, "-o", model, "--ratio", ratio, "--certificate", "none", "--quiet")
        found, truth = out.with_suffix(".csv"), Path(work) / f"{name}.csv"
        run(program, "haloes", snapshot, "-o", truth, "--force", "--quiet", *options.split())
        run(program, "haloes", model, "-o", found, "--truth", snapshot, "--json", out.with_suffix(".json"),
            "--force", "--quiet", *options.split())  # fmt: skip
        a = json.loads(out.with_suffix(".json").read_text())["agreement"]
        of_truth, of_model = table(truth), table(found)

        def number(low, high, of_truth=of_truth, of_model=of_model):
            count = [((t["n200m"] >= low) & (t["n200m"] < high)).sum() for t in (of_model, of_truth)]
            return f"{count[0]} / {count[1]} = {count[0] / max(count[1], 1):.3f}"

        print(
            f"| {name} | {a['truth']} | {a['completeness']:.3f} | {a['purity']:.3f} | {a['mass_median'] - 1:+.2%} "
            f"| {a['mass_scatter']:.1%} | {number(100, 300)} | {number(300, np.inf)} | {pull(of_truth, of_model):.2f} |"
        )


def pull(truth, model):
    """Root of the median square of the difference in mass over its error, times what makes that 1 of normal errors, of
    haloes of 300 particles and more that are nearest to one another."""
    large = truth[truth["n200m"] >= 300]
    pulls = []
    for h in large:
        offset = np.stack([model[k] - h[k] for k in "xyz"])
        nearest = np.argmin((offset**2).sum(0))
        if (offset[:, nearest] ** 2).sum() < h["r200m"] ** 2 and np.isfinite(model["m200m"][nearest]):
            pulls.append((model["m200m"][nearest] - h["m200m"]) / model["m200m_err"][nearest])
    return np.median(np.abs(pulls)) / 0.6745


def compaso(program, work, folder):
    found = Path(work) / "abacus.csv"
    run(program, "haloes", folder, "-o", found, "--force", "--quiet")
    ours, theirs = table(found), np.genfromtxt(Path(folder) / "haloes.csv", delimiter=",", names=True)
    box = json.loads((Path(folder) / "meta.json").read_text())["box"]
    places = np.stack([ours[k] for k in "xyz"], 1)

    def distances(points, center):
        offset = points - center
        return np.sqrt(((offset - box * np.round(offset / box)) ** 2).sum(1))

    print("| CompaSO's haloes of | number | one of ours within its R200m |")
    print("|---|---|---|")
    for least in (300, 100):
        chosen = theirs[theirs["particles"] >= least]
        inside = [np.any(distances(places, [h[k] for k in "xyz"]) <= ours["r200m"]) for h in chosen]
        print(f"| {least} particles and more | {len(chosen)} | {np.mean(inside):.3f} |")
    x = np.stack([np.fromfile(Path(folder) / f"{k}{k}.f32", "f4").astype(float) for k in "xyz"], 1)
    per_cube = 4 / 3 * np.pi * 200 * len(x) / box**3
    worst = 0.0
    for place, h in zip(places, ours, strict=True):
        if np.isfinite(h["r200m"]):
            d = np.sort(distances(x, place))
            k = np.arange(10, len(d))
            count = k[np.argmax(k < per_cube * d[k] ** 3)]
            worst = max(worst, abs(h["n200m"] / count - 1), abs(h["r200m"] / np.cbrt(count / per_cube) - 1))
    print(f"\nn200m and r200m against numpy, {np.isfinite(ours['r200m']).sum()} haloes: furthest {worst:.1e}")


if __name__ == "__main__":
    {"models": models, "compaso": compaso}[sys.argv[1]](*sys.argv[2:])
