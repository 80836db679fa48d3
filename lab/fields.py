#!/usr/bin/env python3
"""What a model's velocities are good for: particles drawn from it against the snapshot's, as a table in Markdown.

Usage: lab/fields.py PROGRAM SNAPSHOT MODEL [--draws N]
  PROGRAM   the command particlegs
  SNAPSHOT  a folder with xx yy zz vx vy vz .f32 (Mpc/h; peculiar km/s), a periodic cube and a = 1 in meta.json, and
            haloes.csv: x, y, z, particles (optional)
  MODEL     made by `particlegs compress SNAPSHOT --fields velocity`

Needs numpy and scipy. Redshift space: s = x + v / 100 along each axis in turn; power on 128^3 cells, cloud in cell, shot
noise subtracted. Haloes: of 300 particles and more, within R200c of the snapshot's particles (Omega_m = 0.315).
"""

import argparse
import csv
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

CELLS = 128
EDGES = np.array([0.15, 0.4, 0.7, 1.05, 1.5, 2.0, 2.8, 4.0, 5.9])
OMEGA_MATTER = 0.315192
AXES = "xyz"


def columns(folder: Path, names: list[str]) -> np.ndarray:
    return np.stack([np.fromfile(folder / f"{name}.f32", "<f4").astype(float) for name in names], axis=1)


class Spectrum:
    """Multipoles of the power of particles in a periodic cube."""

    def __init__(self, length: float) -> None:
        self.length = length
        full = 2 * np.pi * np.fft.fftfreq(CELLS, length / CELLS)
        half = 2 * np.pi * np.fft.rfftfreq(CELLS, length / CELLS)
        self.axes = [full[:, None, None], full[None, :, None], half[None, None, :]]
        self.k = np.sqrt(sum(a**2 for a in self.axes))
        sides = [np.sinc(a * length / CELLS / 2 / np.pi) for a in np.broadcast_arrays(*self.axes)]
        self.window = np.prod(sides, axis=0) ** 2
        self.modes = np.full(self.k.shape, 2.0)
        self.modes[:, :, [0, -1]] = 1.0
        self.shell = np.digitize(self.k.ravel(), EDGES)

    def grid(self, place: np.ndarray) -> np.ndarray:
        scaled = place / self.length * CELLS
        first = np.floor(scaled).astype(int)
        share = scaled - first
        sums = np.zeros(CELLS**3)
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, share, 1 - share), axis=1)
            cell = np.ravel_multi_index(tuple(((first + corner) % CELLS).T), (CELLS,) * 3)
            sums += np.bincount(cell, weight, CELLS**3)
        return sums.reshape((CELLS,) * 3)

    def multipoles(self, place: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
        delta = self.grid(place)
        delta = delta / delta.mean() - 1
        volume = self.length**3
        power = np.abs(np.fft.rfftn(delta) / CELLS**3) ** 2 * volume / self.window**2 - volume / len(place)
        mu2 = np.where(self.k > 0, (self.axes[axis] / np.where(self.k > 0, self.k, 1)) ** 2, 0)

        def mean(values: np.ndarray) -> np.ndarray:
            of = lambda weight: np.bincount(self.shell, weight.ravel(), len(EDGES) + 1)[1:-1]
            return of(self.modes * values) / of(self.modes)

        return mean(power), mean(power * 2.5 * (3 * mu2 - 1))

    def in_redshift_space(self, place: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = []
        for axis in range(3):
            moved = place.copy()
            moved[:, axis] = (moved[:, axis] + velocity[:, axis] / 100) % self.length
            found.append(self.multipoles(moved, axis))
        return np.mean([f[0] for f in found], axis=0), np.mean([f[1] for f in found], axis=0)


def momentum(place: np.ndarray, velocity: np.ndarray, length: float, edge: float, axis: int, flat: bool) -> np.ndarray:
    n = round(length / edge)
    cell = np.floor(place / length % 1 * n).astype(int).clip(0, n - 1)
    kept = [k for k in range(3) if not (flat and k == axis)]
    number = np.ravel_multi_index(tuple(cell[:, k] for k in kept), (n,) * len(kept))
    return np.bincount(number, velocity[:, axis], n ** len(kept))


class Haloes:
    def __init__(self, path: Path, place: np.ndarray, length: float) -> None:
        self.length, tree = length, cKDTree(place, boxsize=length)
        critical = len(place) / length**3 / OMEGA_MATTER
        self.spheres = []
        for row in csv.DictReader(path.open()):
            if float(row["particles"]) < 300:
                continue
            center = np.array([float(row[a]) for a in AXES]) % length
            near = place[tree.query_ball_point(center, 2.5)]
            distance = np.sort(np.linalg.norm((near - center + length / 2) % length - length / 2, axis=1))
            dense = np.arange(1, len(distance) + 1) >= 200 * critical * 4 / 3 * np.pi * np.maximum(distance, 1e-9) ** 3
            self.spheres.append((center, distance[np.flatnonzero(dense).max()] if dense.any() else 0.0))

    def dispersions(self, place: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        tree = cKDTree(place, boxsize=self.length)
        inside = [velocity[tree.query_ball_point(center, radius)] for center, radius in self.spheres]
        return np.array([np.sqrt(v.var(axis=0).sum()) if len(v) > 5 else np.nan for v in inside])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("snapshot", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--draws", type=int, default=8)
    a = parser.parse_args()
    length = float(json.loads((a.snapshot / "meta.json").read_text())["box"])
    place = columns(a.snapshot, ["xx", "yy", "zz"]) % length
    velocity = columns(a.snapshot, ["vx", "vy", "vz"])
    spectrum = Spectrum(length)
    haloes = Haloes(a.snapshot / "haloes.csv", place, length) if (a.snapshot / "haloes.csv").exists() else None
    p0, p2 = spectrum.in_redshift_space(place, velocity)
    truth = haloes.dispersions(place, velocity) if haloes else None
    monopole, quadrupole, dispersion, correlation, square = [], [], [], [], []
    for seed in range(a.draws):
        with tempfile.TemporaryDirectory() as folder:
            command = [a.program, "recover", a.model, "-o", f"{folder}/drawn", "--seed", str(seed), "--quiet"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            drawn = columns(Path(folder, "drawn"), ["xx", "yy", "zz"]) % length
            moving = columns(Path(folder, "drawn"), [f"velocity_{a}" for a in AXES])
        own = spectrum.in_redshift_space(drawn, moving)
        square.append((moving**2).sum() / len(moving) / ((velocity**2).sum() / len(velocity)))
        monopole.append(own[0] / p0)
        quadrupole.append((own[1] - p2) / p0)
        if haloes:
            dispersion.append(haloes.dispersions(drawn, moving) / truth)
        maps = [(1.0, False), (0.25, True)]
        sides = [(place, velocity), (drawn, moving)]
        pairs = [[momentum(*s, length, edge, k, flat) for s in sides] for edge, flat in maps for k in range(3)]
        correlation.append([np.corrcoef(*pair)[0, 1] for pair in pairs])
    rows = [("k up to, h/Mpc", EDGES[1:], None), ("P0 / truth", np.mean(monopole, 0), np.std(monopole, 0))]
    rows.append(("(P2 - truth) / P0", np.mean(quadrupole, 0), np.std(quadrupole, 0)))
    for name, values, spread in rows:
        shown = [f"{v:.3f}" for v in values]
        if spread is not None:
            shown = [f"{v} ± {s:.3f}" for v, s in zip(shown, spread)]
        print(f"| {name} | {' | '.join(shown)} |")
        if spread is None:
            print("|---" * (len(values) + 1) + "|")
    cells = np.mean(correlation, 0)
    print(f"\nMean square of velocities, drawn / particles: {np.mean(square):.4f} ± {np.std(square):.4f}")
    print(f"Momentum of drawn particles in cells of 1 Mpc/h, correlation along x, y, z: {np.round(cells[:3], 4)}")
    print(f"Line-of-sight momentum map at 0.25 Mpc/h: {np.round(cells[3:], 4)}")
    if haloes:
        median = np.nanmedian(dispersion, 0)
        low, middle, high = np.percentile(median, [25, 50, 75])
        print(f"Dispersion in R200c of {len(median)} haloes, over the particles':")
        print(f"median {middle:.4f}, quartiles {low:.4f} to {high:.4f}")


if __name__ == "__main__":
    main()
