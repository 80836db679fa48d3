#!/usr/bin/env python3
"""A series against models of its frames' own, and its statistics across keyframes: tables for docs/results/series.md.
Needs numpy, scipy and h5py. Snapshots are Gadget HDF5 of one species in a cubic periodic box.

  lab/series_quality.py equal particlegs RUN.pgs SNAPSHOTS FRAME ...     SNAPSHOTS: a name such as snap_%03d.hdf5
  lab/series_quality.py jumps particlegs RUN.pgs SNAPSHOTS KEYFRAME ...  from three frames before to two after each
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
from scipy.spatial import cKDTree

RATIOS = (300, 330, 365)
SAMPLE = 40_000
LEAST = (20, 100, 1000)
BANDS = ((0, 0.5), (0.5, 1), (1, 2), (2, 4), (4, 8))


def run(*words):
    """Runs a command in silence."""
    subprocess.run([str(w) for w in words], check=True, capture_output=True)


def bits(program, model, extra, places, edge, work):
    """Mean binary logarithm of the model's density at particles, over that of a uniform box."""
    one, arrays = work / "one.pgs", work / "one.npz"
    run(program, "extract", model, *extra, "-o", one, "--force", "-q")
    run(program, "export", one, "-o", arrays, "--force", "-q")
    z = np.load(arrays)
    mean, count = z["mean"].astype(float), z["count"].astype(float)
    cov = z["covariance"].astype(float)
    if cov.ndim == 2:
        cov = cov[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    inverse = np.linalg.inv(cov)
    peak = count / count.sum() / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(cov))
    reach = np.minimum(6 * np.sqrt(np.linalg.eigvalsh(cov)[:, 2]), 0.49 * edge)
    tree, density = cKDTree(np.mod(places, edge), boxsize=edge), np.zeros(len(places))
    for i, near in enumerate(tree.query_ball_point(np.mod(mean, edge), reach)):
        if near:
            d = places[near] - mean[i]
            d -= edge * np.round(d / edge)
            density[near] += peak[i] * np.exp(-0.5 * np.einsum("nj,jk,nk->n", d, inverse[i], d))
    return np.mean(np.log2(np.maximum(density, 1e-30) * edge**3))


def equal(program, series, snapshots, *frames):
    """Bytes of models of frames' own that have the same quality, by each measure."""
    print("| frame | `paraview`, dB | `expected`, dB | bits | bytes of equal `paraview` | `expected` | bits |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as work:
        work, random, all_equal = Path(work), np.random.default_rng(1), []
        for frame in map(int, frames):
            snapshot = snapshots % frame
            with h5py.File(snapshot) as f:
                places, edge = f["PartType1/Coordinates"][:].astype(float), float(f["Header"].attrs["BoxSize"])
            places = places[random.choice(len(places), SAMPLE, replace=False)]

            def score(model, extra=(), snapshot=snapshot, places=places, edge=edge):
                out = work / "score.json"
                out.unlink(missing_ok=True)
                how = ["--frames", 2, "--size", "960x540", "--json", out, "-q"]
                run(program, "eval", model, snapshot, *extra, *how)
                views = json.loads(out.read_text())["views"]
                decibels = [np.mean([v[look]["masked_psnr"] for v in views]) for look in ("paraview", "expected")]
                return [*decibels, bits(program, model, extra, places, edge, work)]

            own = []
            for ratio in RATIOS:
                model = work / "own.pgs"
                how = ["--ratio", ratio, "--certificate", "none", "--force", "-q"]
                run(program, "compress", snapshot, "-o", model, *how)
                own.append([np.log(model.stat().st_size), *score(model)])
            own, of_frame = np.array(own), score(series, ("--frame", frame))
            same = [np.exp(np.polyval(np.polyfit(own[:, k + 1], own[:, 0], 1), of_frame[k])) for k in range(3)]
            all_equal.append(same)
            lost = " | ".join(f"{a - b:+.3f}" for a, b in zip(of_frame, own[0, 1:], strict=True))
            print(f"| {frame} | {lost} | " + " | ".join(f"{v:.0f}" for v in same) + " |", flush=True)
    print("| mean | | | | " + " | ".join(f"{v:.0f}" for v in np.mean(all_equal, 0)) + " |")


def rows(path):
    """A table whose remarks stand behind `#`."""
    return list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))


def over_truth(program, series, snapshot, frame, work):
    """P(k) of a frame, and numbers of groups of particles drawn from it, over those of its particles."""
    out, drawn = work / str(frame), work / f"{frame}.hdf5"
    run(program, "stats", snapshot, series, "--frame", frame, "-o", out / "power", "--only", "spectrum", "--no-plots")
    run(program, "recover", series, "--frame", frame, "-o", drawn)
    run(program, "stats", snapshot, drawn, "-o", out / "groups", "--only", "groups", "--no-plots")
    shells, groups = rows(out / "power" / "power.csv"), rows(out / "groups" / "groups.csv")
    power = np.array([[float(r["k"]), float(r["ratio"])] for r in shells if r["ratio"]])
    bands = [power[(power[:, 0] >= low) & (power[:, 0] < high), 1].mean() for low, high in BANDS]

    def number(side, least):
        return sum(float(r[f"groups_{side}"]) for r in groups if float(r["from"]) >= least)

    return np.array([*bands, *(number("other", n) / (number("truth", n) or np.nan) for n in LEAST)])


def jumps(program, series, snapshots, *keyframes):
    """Changes from frame to frame of what a series has over its particles, in %: what grows in both is no change."""
    names = [f"k {low} to {high}" for low, high in BANDS] + [f"groups of {least}" for least in LEAST]
    print("| keyframe | | at the frame before | at it | change | usual change |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as work:
        for key in map(int, keyframes):
            frames = range(key - 3, key + 3)
            ratios = np.array([over_truth(program, series, snapshots % f, f, Path(work)) for f in frames])
            changes = 100 * np.abs(np.diff(np.log(ratios), axis=0))
            usual = np.delete(changes, 2, axis=0).mean(0)
            for name, (previous, at), change, other in zip(names, ratios[2:4].T, changes[2], usual, strict=True):
                print(f"| {key} | {name} | {previous:.4f} | {at:.4f} | {change:.2f} % | {other:.2f} % |", flush=True)


if __name__ == "__main__":
    {"equal": equal, "jumps": jumps}[sys.argv[1]](*sys.argv[2:])
