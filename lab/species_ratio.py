#!/usr/bin/env python3
"""Whether two random halves of a snapshot look different in a model: the ratio of their densities, cell by cell.

Usage: lab/species_ratio.py PROGRAM SNAPSHOT [--ratio R] [--grid N]
  PROGRAM   the command particlegs
  SNAPSHOT  a folder with xx yy zz .f32 of a periodic cube, its edge as `box` in meta.json

Makes models of the halves as two particle types, with Gaussians that they share and without. For cells by their number of
particles (in the model): root mean square of ln(A / B) over its sampling noise, sqrt(4 / particles). Needs numpy.
"""

import argparse
import itertools
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np

CLASSES = [2, 4, 8, 16, 32, 64, 128, np.inf]


def halves(source: Path, folder: Path) -> float:
    """Writes the halves as two layers of a folder; returns the edge of the box."""
    box = json.loads((source / "meta.json").read_text())["box"]
    columns = [np.fromfile(source / f"{axis}{axis}.f32", "<f4") for axis in "xyz"]
    order = np.random.default_rng(1).permutation(len(columns[0]))
    count = len(order) // 2
    # Within each half the snapshot's order.
    order = np.concatenate([np.sort(order[:count]), np.sort(order[count:])])
    folder.mkdir()
    for axis, column in zip("xyz", columns, strict=True):
        column[order].tofile(folder / f"{axis}{axis}.f32")
    layers = [{"name": "a", "particles": count}, {"name": "b", "particles": len(order) - count}]
    (folder / "meta.json").write_text(json.dumps({"box": box, "periodic": True, "layers": layers}))
    return box


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("snapshot", type=Path)
    parser.add_argument("--ratio", default="300")
    parser.add_argument("--grid", type=int, default=128)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        box = halves(asked.snapshot, work / "halves")
        run = lambda *words: subprocess.run([asked.program, *map(str, words), "--quiet"], check=True)
        print(f"cells of {box / asked.grid:.3f}; " + ", ".join(f"from {n}" for n in CLASSES[:-1]) + " particles")
        for sharing in ("no", "yes", "auto"):
            model = work / f"{sharing}.pgs"
            run(
                "compress",
                work / "halves",
                "-o",
                model,
                "--ratio",
                asked.ratio,
                "--share-gaussians",
                sharing,
                "--certificate",
                "none",
            )
            count = []
            for layer in "ab":
                run("export", model, "-o", work / "grid.npy", "--layer", layer, "--grid", asked.grid, "--force")
                count.append(np.load(work / "grid.npy").astype(float) * (box / asked.grid) ** 3)
            total = count[0] + count[1]
            scaled = np.log(count[0] / count[1]) / np.sqrt(4 / total)
            inside = [(total >= low) & (total < high) for low, high in itertools.pairwise(CLASSES)]
            rms = [np.sqrt(np.mean(scaled[cells] ** 2)) for cells in inside]
            print(f"{sharing:5} {model.stat().st_size} bytes: " + ", ".join(f"{v:.2f}" for v in rms))


if __name__ == "__main__":
    main()
