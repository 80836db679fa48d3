#!/usr/bin/env python3
"""A field of two phases: a model of half the particles against the other half, as a table in Markdown.

Usage: lab/two_phases.py paint SNAPSHOT DIR [--seed N]     halves DIR/a and DIR/b of the snapshot, with temperatures
       lab/two_phases.py compare PROGRAM DIR MODEL ...     models of DIR/a against DIR/b
  SNAPSHOT  a folder with xx yy zz .f32 and a periodic cube in meta.json
  MODEL     made by `particlegs compress DIR/a --fields temperature`

`paint` gives each particle 1e4 or 1e7 K, 0.3 in ln about that; the hot ones are likelier where it is dense. `compare`
gives the mean of values drawn from the model (8 draws a particle) over that of DIR/b, the share of hot ones, and the
share between the phases; then the error of the map of a slab of 9.4 length units (pixels of 1/86 box, of 8 particles and
more) over the map's own scatter, without the noise of DIR/b's values. Needs numpy and scipy.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

BETWEEN = (5e4, 5e6)
HOT = 3e5
PIXELS = 86
DEPTH = 9.4
FEWEST = 8


def columns(folder, *names):
    return [np.fromfile(Path(folder) / f"{name}.f32", "<f4").astype(float) for name in names]


def paint(snapshot, folder, seed=1):
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(int(seed))
    meta = json.loads((Path(snapshot) / "meta.json").read_text())
    x = np.stack(columns(snapshot, "xx", "yy", "zz"), 1) % meta["box"]
    distance = cKDTree(x, boxsize=meta["box"] * (1 + 1e-12)).query(x, 17)[0][:, -1]
    density = 16 / (4 / 3 * np.pi * distance**3) * meta["box"] ** 3 / len(x)
    hot = rng.random(len(x)) < 1 / (1 + (np.median(density) / density))
    temperature = np.where(hot, 1e7, 1e4) * np.exp(0.3 * rng.normal(size=len(x)))
    half = rng.random(len(x)) < 0.5
    for name, chosen in (("a", half), ("b", ~half)):
        out = Path(folder) / name
        out.mkdir(parents=True, exist_ok=True)
        for k, column in enumerate(("xx", "yy", "zz")):
            x[chosen, k].astype("<f4").tofile(out / f"{column}.f32")
        temperature[chosen].astype("<f4").tofile(out / "temperature.f32")
        (out / "meta.json").write_text(json.dumps({"box": meta["box"], "periodic": True, "length_unit": "Mpc/h"}))


def compare(program, folder, *models):
    folder = Path(folder) / "b"
    box = json.loads((folder / "meta.json").read_text())["box"]
    x, y, z, t = columns(folder, "xx", "yy", "zz", "temperature")
    slab = z < DEPTH
    cell = (x[slab] / box * PIXELS).astype(int).clip(0, PIXELS - 1) * PIXELS
    cell += (y[slab] / box * PIXELS).astype(int).clip(0, PIXELS - 1)
    number, total, square = (
        np.bincount(cell, t[slab] ** power, PIXELS**2).reshape(PIXELS, PIXELS) for power in range(3)
    )
    enough = number >= FEWEST
    n, mean = number[enough], total[enough] / number[enough]
    noise = np.mean((square[enough] / n - mean**2) / (n - 1))
    signal = np.var(mean) - noise
    print("| model | bytes | mean of drawn values | hot share (truth) | between (truth) | map: error over signal | correlation |")
    print("|---|---|---|---|---|---|---|")
    for model in models:
        with tempfile.TemporaryDirectory() as out:
            run = lambda *words: subprocess.run([program, *map(str, words), "--quiet"], check=True, stdout=-3)
            run("recover", model, "-o", f"{out}/drawn", "--particles", 8 * len(x))
            drawn = columns(f"{out}/drawn", "temperature")[0]
            view = ["--projection", "orthographic", "--center", f"{box / 2},{box / 2},{DEPTH / 2}", "--width", box]
            run("render", model, "--field", "temperature", *view, "--size", f"{PIXELS}x{PIXELS}", "--depth", DEPTH,
                "--raw", "-o", f"{out}/map")  # fmt: skip
            values = np.fromfile(next(Path(out, "map").glob("*.f32")), "<f4").reshape(PIXELS, PIXELS)[::-1].T[enough]
        share = [np.mean(v > HOT) for v in (drawn, t)]
        between = [np.mean((v > BETWEEN[0]) & (v < BETWEEN[1])) for v in (drawn, t)]
        error = np.sqrt(max(np.mean((values - mean) ** 2) - noise, 0) / signal)
        print(
            f"| {Path(model).stem} | {Path(model).stat().st_size} | {drawn.mean() / t.mean():.4f} "
            f"| {share[0]:.4f} ({share[1]:.4f}) | {between[0]:.4f} ({between[1]:.4f}) | {error:.3f} "
            f"| {np.corrcoef(values, mean)[0, 1]:.3f} |"
        )


if __name__ == "__main__":
    {"paint": paint, "compare": compare}[sys.argv[1]](*sys.argv[2:])
