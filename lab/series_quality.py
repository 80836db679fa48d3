#!/usr/bin/env python3
"""A series against models of its frames' own, and its statistics across keyframes: tables for docs/results/series.md.
Needs numpy, scipy and h5py. Snapshots are Gadget HDF5 of one species in a cubic periodic box.

  lab/series_quality.py equal particlegs RUN.pgs SNAPSHOTS FRAME ...     SNAPSHOTS: a name such as snap_%03d.hdf5
  lab/series_quality.py jumps STATS INTERVAL                            what `stats RUN.pgs -o STATS` wrote
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


def jumps(stats, interval):
    """Changes across keyframes over those of the frames about them."""
    power, frames = rows(Path(stats) / "power_frames.csv"), rows(Path(stats) / "frames.csv")
    last, interval = len(frames) - 1, int(interval)
    by_frame = [[r for r in power if int(r["frame"]) == frame] for frame in range(last + 1)]
    k = np.array([float(r["k"]) for r in by_frame[0]])
    values = np.log(np.abs([[float(r["power"]) for r in own] for own in by_frame]))
    for key in range(interval, last + 1, interval):
        for low, high in BANDS:
            change = np.abs(np.diff(values, axis=0))[:, (k >= low) & (k < high)].mean(1)
            usual = change[[key - 3, key - 2, key, key + 1]].mean()
            print(f"keyframe {key}, k {low} to {high}: {change[key - 1] / usual:.2f}")
        for least in (20, 100, 1000):
            number = np.array([float(r[f"groups_{least}"] or 0) for r in frames])
            with np.errstate(divide="ignore", invalid="ignore"):
                change = np.abs(np.diff(np.log(number)))
            ratio = change[key - 1] / change[[key - 4, key - 3, key - 2, key, key + 1, key + 2]].mean()
            print(f"keyframe {key}, groups of {least}: {number[key - 1]:.0f}, {number[key]:.0f}, {ratio:.1f}")


if __name__ == "__main__":
    {"equal": equal, "jumps": jumps}[sys.argv[1]](*sys.argv[2:])
