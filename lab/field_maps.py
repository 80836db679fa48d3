#!/usr/bin/env python3
"""Maps of v_z, along z, against other maps of the same: one line a comparison.

Usage: lab/field_maps.py codes  PROGRAM SNAPSHOT                `reference --field` against yt and swiftsimio
       lab/field_maps.py halves PROGRAM SNAPSHOT [--depth D]    values of half the particles against the other half's
       lab/field_maps.py draws  PROGRAM MODEL [--pixels N]      a model's map against 64 drawn particles for each of its own
  PROGRAM   the command particlegs
  SNAPSHOT  a folder with xx yy zz vx vy vz .f32 (km/s) and a periodic cube in meta.json
  MODEL     made by `particlegs compress SNAPSHOT --fields velocity`

Needs numpy, and h5py for `halves`; `codes` compares with those of yt and swiftsimio that are installed.
"""

import argparse
import json
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from fields import columns

DRAWS = 64
CORNERS = [(-1, -1), (-1, 1), (1, -1), (1, 1)]


def run(program: str, *words: object) -> None:
    subprocess.run([program, *map(str, words), "--quiet"], check=True, stdout=subprocess.DEVNULL)


def picture(
    program: str,
    command: str,
    source: Path,
    box: float,
    pixels: int,
    depth: float | None = None,
    field: str = "velocity.z",
) -> np.ndarray:
    """The program's map, indexed by pixels along x and y; with `depth` of z from 0 to there."""
    with tempfile.TemporaryDirectory() as folder:
        middle = (depth or box) / 2
        view = ["--projection", "orthographic", "--center", f"{box / 2},{box / 2},{middle}", "--width", box]
        view += ["--size", f"{pixels}x{pixels}", *(["--depth", depth] if depth else [])]
        run(program, command, source, "--field", field, *view, "--raw", "-o", f"{folder}/map")
        values = np.fromfile(next(Path(folder, "map").glob("*.f32")), "<f4").reshape(pixels, pixels)
    return values[::-1].T.astype(float)  # Rows come from the top.


def sums(place: np.ndarray, velocity: np.ndarray, box: float, pixels: int) -> np.ndarray:
    """Number of particles, sum of v_z and sum of its squares in each pixel."""
    cell = np.floor(place[:, :2] / box % 1 * pixels).astype(int).clip(0, pixels - 1)
    number = cell[:, 0] * pixels + cell[:, 1]
    powers = [velocity[:, 2] ** k for k in range(3)]
    return np.stack([np.bincount(number, p, pixels**2).reshape(pixels, pixels) for p in powers])


def variance(number: np.ndarray, total: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """The variance of v_z in each pixel, without bias."""
    return (squares - total**2 / number) / (number - 1)


def snapshot(folder: Path) -> tuple[np.ndarray, np.ndarray, float]:
    box = float(json.loads((folder / "meta.json").read_text())["box"])
    return columns(folder, ["xx", "yy", "zz"]) % box, columns(folder, ["vx", "vy", "vz"]), box


def codes(program: str, folder: Path, pixels: int = 256) -> None:
    place, velocity, box = snapshot(folder)
    ours = picture(program, "reference", folder, box, pixels)
    theirs = {}
    if find_spec("yt"):
        import yt

        yt.set_log_level(50)
        data = {f"particle_position_{a}": place[:, k] for k, a in enumerate("xyz")}
        data |= {"particle_mass": np.ones(len(place)), "v": velocity[:, 2]}
        loaded = yt.load_particles(data, length_unit=1.0, bbox=np.array([[0, box]] * 3))
        options = {"weight_field": ("io", "particle_mass"), "width": (box, "code_length"), "deposition": "ngp"}
        plot = yt.ParticleProjectionPlot(loaded, 2, ("io", "v"), **options)
        plot.set_buff_size(pixels)
        theirs[f"yt {yt.__version__}"] = np.array(plot.frb[("io", "v")]).T
    if find_spec("swiftsimio"):
        import swiftsimio
        from swiftsimio.visualisation.projection_backends import backends

        def histogram(weight: np.ndarray) -> np.ndarray:
            x, y = (place[:, :2] / box).T
            return backends["histogram"](x=x, y=y, m=weight, h=np.ones(len(x)), res=pixels, box_x=0.0, box_y=0.0)

        mass = np.ones(len(place))
        with np.errstate(invalid="ignore"):
            theirs[f"swiftsimio {swiftsimio.__version__}"] = histogram(velocity[:, 2]) / histogram(mass)
    # A particle on an edge, in single precision, may fall on either side.
    edges = sum(sums(place + np.array([a, b, 0]) * 1e-5 * box / pixels, velocity, box, pixels)[0] for a, b in CORNERS)
    clear = edges == len(CORNERS) * sums(place, velocity, box, pixels)[0]
    for name, other in theirs.items():
        both = np.isfinite(ours) & np.isfinite(other)
        one = (np.isfinite(ours) != np.isfinite(other)) & clear
        error = np.abs(ours - other) / np.sqrt(np.mean(other[both] ** 2))
        largest = error[both & clear].max()
        print(f"{name}: {both.sum()} pixels with values, |difference| / rms: median {np.median(error[both]):.1e}")
        print(
            f"  without {np.sum(~clear)} with a particle on an edge: at most {largest:.1e}; {one.sum()} in one map alone"
        )


def halves(program: str, folder: Path, ratios: list[float], depth: float, pixels: int = 256) -> None:
    import h5py

    place, velocity, box = snapshot(folder)
    first = np.random.default_rng(0).random(len(place)) < 0.5
    inside = place[:, 2] < depth
    whole = sums(place[inside], velocity[inside], box, pixels)
    other = sums(place[inside & ~first], velocity[inside & ~first], box, pixels)
    kept = (whole[0] >= 8) & (other[0] > 0)
    whole, (number, total, _) = whole[:, kept], other[:, kept]
    truth, spread = total / number, variance(*whole)
    noises = [np.mean(2 * spread / whole[0]), np.mean(spread / number)]
    print(f"slab z < {depth:g}: {kept.sum()} pixels, rms of the other half's map {np.std(truth):.1f} km/s")
    with tempfile.TemporaryDirectory() as scratch:
        # All particles shape the Gaussians, half of them have values: v_z goes as a temperature, which
        # `--star-forming drop` takes from the other half.
        with h5py.File(f"{scratch}/half.hdf5", "w") as file:
            count = np.array([len(place), 0, 0, 0, 0, 0], "u4")
            header = {"NumPart_ThisFile": count, "NumPart_Total": count, "NumPart_Total_HighWord": 0 * count}
            header |= {"MassTable": np.array([1.0, 0, 0, 0, 0, 0]), "BoxSize": box, "Time": 1.0, "Redshift": 0.0}
            file.create_group("Header").attrs.update({**header, "NumFilesPerSnapshot": 1})
            gas = {"Coordinates": place, "Temperature": velocity[:, 2], "StarFormationRate": ~first}
            for name, values in gas.items():
                file[f"PartType0/{name}"] = values.astype("f4")
        for ratio in ratios:
            model = Path(scratch, "m.pgs")
            fields = ["--fields", "temperature", "--star-forming", "drop", "--ratio", ratio]
            run(program, "compress", f"{scratch}/half.hdf5", *fields, "-o", model, "--force")
            error = np.mean((picture(program, "render", model, box, pixels, depth, "temperature")[kept] - truth) ** 2)
            print(f"ratio {ratio:g}: rms error {np.sqrt(error):.1f} km/s; without noise of", end=" ")
            print(", ".join(f"{np.sqrt(n):.1f}: {np.sqrt(max(error - n, 0)):.1f}" for n in noises))


def window_sums(place: np.ndarray, velocity: np.ndarray, box: float, pixels: int) -> np.ndarray:
    """Sums at pixels' centres of w, w v, w^2, w^2 v, w^2 v^2 with the map's window w, a normal of a pixel's own variance."""
    scaled = place[:, :2] / box % 1 * pixels
    cell = np.floor(scaled).astype(int)
    out = np.zeros((5, pixels**2))
    v = velocity[:, 2]
    for step in np.ndindex(5, 5):
        at = cell + step - 2
        weight = np.exp(-6 * np.sum((scaled - at - 0.5) ** 2, axis=1))
        number = at[:, 0] % pixels * pixels + at[:, 1] % pixels
        terms = [weight, weight * v, weight**2, weight**2 * v, weight**2 * v**2]
        out += [np.bincount(number, term, pixels**2) for term in terms]
    return out.reshape(5, pixels, pixels)


def draws(program: str, model: Path, pixels: int) -> None:
    names = ["xx", "yy", "zz", *(f"velocity_{a}" for a in "xyz")]
    with tempfile.TemporaryDirectory() as folder:
        run(program, "info", model, "--json", f"{folder}/info")
        particles = json.loads(Path(folder, "info").read_text())["metadata"]["particles"]
        # All at once: each draw has whole numbers of particles for every Gaussian.
        run(program, "recover", model, "-o", f"{folder}/drawn", "--particles", DRAWS * particles)
        drawn = Path(folder, "drawn")
        box = float(json.loads((drawn / "meta.json").read_text())["box"][0])
        read = {name: np.memmap(drawn / f"{name}.f32", "<f4", "r") for name in names}
        total = np.zeros((5, pixels, pixels))
        for first in range(0, DRAWS * particles, particles):
            part = np.stack([read[name][first : first + particles].astype(float) for name in names], axis=1)
            total += window_sums(part[:, :3], part[:, 3:], box, pixels)
    closed = picture(program, "render", model, box, pixels)
    weight, first, squared, second, third = total
    number, mean = weight**2 / squared, first / weight
    # About the map's own mean: without bias, however few the draws.
    error = (third - 2 * closed * second + closed**2 * squared) / weight**2
    chi2 = (mean - closed) ** 2 / error
    for least in (8, 128):
        some = chi2[number >= least]
        print(f"{len(some)} pixels of {least} draws and more: chi^2 {some.mean():.3f}, median {np.median(some):.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["codes", "halves", "draws"])
    parser.add_argument("program")
    parser.add_argument("source", type=Path, metavar="SNAPSHOT or MODEL")
    parser.add_argument("--ratios", type=float, nargs="+", default=[300, 100])
    parser.add_argument("--depth", type=float, default=12.5)
    parser.add_argument("--pixels", type=int, default=256)
    a = parser.parse_args()
    if a.what == "codes":
        codes(a.program, a.source)
    elif a.what == "halves":
        halves(a.program, a.source, a.ratios, a.depth)
    else:
        draws(a.program, a.source, a.pixels)


if __name__ == "__main__":
    main()
