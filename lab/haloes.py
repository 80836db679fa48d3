#!/usr/bin/env python3
"""Haloes of models against the same finder on their particles, and ours against CompaSO's: tables for
docs/results/haloes.md. Needs numpy.

  lab/haloes.py models particlegs WORK RATIO NAME=SNAPSHOT:OPTIONS ...
  lab/haloes.py compaso particlegs WORK ABACUS            (raw columns and haloes.csv)
  lab/haloes.py enclosed particlegs WORK ABACUS MODEL ...
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
    """Haloes of draws with three seeds: the median, and how far the draws lie apart."""
    print(
        f"| ratio {ratio} | haloes | completeness | purity | M200m: median | scatter "
        "| number of 100 to 300 particles | of 300 and more "
        "| (M - truth) / error: robust; mean, sd, beyond 3 | the same, centre | num_p |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for item in sets:
        name, _, rest = item.partition("=")
        snapshot, _, options = rest.partition(":")
        model, truth = Path(work) / f"{name}-{ratio}.pgs", Path(work) / f"{name}.csv"
        if not model.exists():
            run(program, "compress", snapshot, "-o", model, "--ratio", ratio, "--certificate", "none", "--quiet")
        run(program, "haloes", snapshot, "-o", truth, "--force", "--quiet", *options.split())
        of_truth, rows = table(truth), []
        for seed in (42, 1, 2):
            found, result = (Path(work) / f"{name}-{ratio}-{seed}.{end}" for end in ("csv", "json"))
            run(program, "haloes", model, "-o", found, "--truth", snapshot, "--json", result, "--seed", seed,
                "--force", "--quiet", *options.split())  # fmt: skip
            a, of_model = json.loads(result.read_text())["agreement"], table(found)

            def number(low, high, of_truth=of_truth, of_model=of_model):
                count = [((t["n200m"] >= low) & (t["n200m"] < high)).sum() for t in (of_model, of_truth)]
                return count[0] / max(count[1], 1)

            masses = [a["completeness"], a["purity"], a["mass_median"], a["mass_scatter"]]
            rows.append([*masses, number(100, 300), number(300, np.inf), *pulls(of_truth, of_model)])
        middle, low, high = np.median(rows, 0), np.min(rows, 0), np.max(rows, 0)
        cells = [f"{m:.3f} ({a:.3f} to {b:.3f})" for m, a, b in zip(middle[:6], low, high, strict=False)]
        cells += [f"{r:.2f}; {m:+.2f}, {sd:.2f}, {share:.1%}" for r, m, sd, share in middle[6:].reshape(3, 4)]
        print(f"| {name} | {a['truth']} | " + " | ".join(cells) + " |")


def pulls(truth, model):
    """The difference over its error, of haloes of 300 particles and more that are nearest to one another, with masses
    within a factor of 2: root of the median square times what makes that 1 of normal errors, mean, standard deviation and
    share beyond 3, of mass (or number, without masses), centre and linked particles."""
    mass = "m200m" if "m200m" in truth.dtype.names else "n200m"
    values = {"mass": [], "center": [], "linked": []}
    for h in truth[truth["n200m"] >= 300]:
        offset = np.stack([model[k] - h[k] for k in "xyz"])
        m = model[np.argmin((offset**2).sum(0))]
        if sum((m[k] - h[k]) ** 2 for k in "xyz") < h["r200m"] ** 2 and 0.5 <= m[mass] / h[mass] <= 2:
            values["mass"].append((m[mass] - h[mass]) / m[f"{mass}_err"])
            values["center"].extend((m[k] - h[k]) / m["position_err"] for k in "xyz")
            values["linked"].append((m["num_p"] - h["num_p"]) / m["num_p_err"])
    numbers = [
        [np.median(np.abs(v)) / 0.6745, np.mean(v), np.std(v), np.mean(np.abs(v) > 3)] for v in map(np.array, values.values())
    ]
    return np.concatenate(numbers)


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
    worst, number = 0.0, 0
    for place, h in zip(places, ours, strict=True):
        # A sphere that overlaps another may lack what that has; smaller spheres have no radii in the table.
        if np.isfinite(h["r200m"]) and np.sum(distances(places, place) < h["r200m"] + np.nan_to_num(ours["r200m"])) == 1:
            number += 1
            d = np.sort(distances(x, place))
            k = np.arange(10, len(d))
            count = k[np.argmax(k < per_cube * d[k] ** 3)]
            worst = max(worst, abs(h["n200m"] / count - 1), abs(h["r200m"] / np.cbrt(count / per_cube) - 1))
    print(f"\nn200m and r200m against numpy, {number} haloes whose spheres overlap no other: furthest {worst:.1e}")


def enclosed(program, work, folder, *models):
    """Mass about CompaSO's centres of 300 particles and more, model over particles."""
    theirs = np.genfromtxt(Path(folder) / "haloes.csv", delimiter=",", names=True)
    centres = Path(work) / "centres.txt"
    np.savetxt(centres, np.stack([theirs[k] for k in "xyz"], 1)[theirs["particles"] >= 300], header="x y z")
    print("| model | r, Mpc/h | haloes | median | quartiles about it |")
    print("|---|---|---|---|---|")
    for model in models:
        out = Path(work) / "stats"
        run(program, "stats", folder, model, "-o", out, "--only", "haloes", "--centres", centres, "--halo-radius", "1",
            "--no-plots", "--quiet")  # fmt: skip
        rows = np.genfromtxt(out / "halo_mass.csv", delimiter=",", names=True)
        for r in (1.0, 0.31, 0.096):
            h = rows[np.argmin(np.abs(np.log(rows["r"] / r)))]
            around = [h[f"quartile_{end}"] / h["median"] - 1 for end in ("low", "high")]
            print(f"| {Path(model).stem} | {h['r']:.3f} | {h['haloes']:.0f} | {h['median'] - 1:+.1%} | {around[0]:+.1%}, {around[1]:+.1%} |")


if __name__ == "__main__":
    {"models": models, "compaso": compaso, "enclosed": enclosed}[sys.argv[1]](*sys.argv[2:])
