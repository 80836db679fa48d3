"""A series' Gaussians through splat4d (PyPI splats4d), by bytes and by what is lost of a picture.

    python lab/splat4d.py SPLAT4D RUN.pgs [FRAME]

RUN.pgs is a series of one layer and one keyframe in a cubic periodic box. splat4d gets the same Gaussians, each in one
place of all frames: exact means and standard deviations, rotations in its 8 bits, no counts. A Gaussian is invisible
where it does not live. The picture of FRAME (default: the middle) is 255 (1 - exp(-depth)) along z, 512 x 512, drawn with
the series' counts and the decoded means and covariances; PSNR against that of the series itself.
"""

import itertools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests/decoder"))
from pgs import frames_of

SPLAT = np.dtype([("place", "<f4", 3), ("size", "<f4", 3), ("colour", "u1", 4), ("turn", "u1", 4)])
SETTINGS = ((2, 2, 0), (20, 2, 0), (50, 5, 2), (100, 5, 4))
CELLS = 512


def frames(path):
    """Of each frame: the Gaussians' places in all frames, means, covariances, counts; the number of places; the edge."""
    found, places, total, edge = [], None, 0, 0.0
    for model in frames_of(path.read_bytes()):
        ((_, (block,)),) = model["layers"]
        edge = model["meta"]["cell"][1][0][0]
        count = np.array(block.counts, float)
        stayed = getattr(block, "stayed", [])
        born = np.arange(total, total + len(count) - len(stayed))
        places = born if places is None else np.concatenate([places[stayed], born])
        total += len(born)
        c = np.array(block.columns["cov"], float).reshape(-1, 6)
        cov = c[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
        found.append((places, np.array(block.columns["mean"], float).reshape(-1, 3), cov, count))
    return found, total, edge


def quaternions(r):
    sign = lambda v: np.where(v < 0, -1.0, 1.0)
    d = np.diagonal(r, axis1=1, axis2=2)
    parts = [1 + d.sum(1), 1 + d[:, 0] - d[:, 1] - d[:, 2], 1 - d[:, 0] + d[:, 1] - d[:, 2], 1 - d[:, 0] - d[:, 1] + d[:, 2]]
    w, x, y, z = (np.sqrt(np.maximum(p, 0)) / 2 for p in parts)
    q = np.stack([w, x * sign(r[:, 2, 1] - r[:, 1, 2]), y * sign(r[:, 0, 2] - r[:, 2, 0]), z * sign(r[:, 1, 0] - r[:, 0, 1])], 1)
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def covariances(splats):
    q = (splats["turn"].astype(float) - 128) / 128
    w, x, y, z = (q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)).T
    r = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
                  2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], 1).reshape(-1, 3, 3)
    return np.einsum("nij,nj,nkj->nik", r, splats["size"].astype(float) ** 2, r)


def write(folder, found, total, edge):
    """Frames as splat4d reads them: axes and positions go on from frame to frame, as they would in a capture."""
    place, size, turn, axes = np.zeros((total, 3)), np.full((total, 3), 0.1), np.tile([1.0, 0, 0, 0], (total, 1)), np.tile(np.eye(3), (total, 1, 1))
    for own, mean, _, _ in reversed(found):
        place[own] = mean
    for number, (own, mean, cov, _) in enumerate(found):
        values, vectors = np.linalg.eigh(cov)
        like = np.abs(np.einsum("nij,nik->njk", axes[own], vectors))
        orders = np.array(list(itertools.permutations(range(3))))
        order = orders[np.argmax([sum(like[:, k, o[k]] for k in range(3)) for o in orders], axis=0)]
        vectors = np.take_along_axis(vectors, order[:, None, :], 2)
        vectors *= np.where(np.einsum("nij,nij->nj", axes[own], vectors) < 0, -1, 1)[:, None, :]
        vectors[np.linalg.det(vectors) < 0, :, 0] *= -1
        q = quaternions(vectors)
        q[np.einsum("ij,ij->i", q, turn[own]) < 0] *= -1
        axes[own], turn[own] = vectors, q
        size[own] = np.sqrt(np.maximum(np.take_along_axis(values, order, 1), 1e-12))
        place[own] += np.mod(mean - place[own] + edge / 2, edge) - edge / 2
        splats = np.zeros(total, SPLAT)
        splats["place"], splats["size"], splats["turn"] = place, size, np.clip(np.round(turn * 128 + 128), 0, 255)
        splats["colour"][:, :3] = 255
        splats["colour"][own, 3] = 255
        splats.tofile(folder / f"frame_{number:04}.splat")


def depth(mean, cov, count, edge):
    image, cell = np.zeros((CELLS, CELLS)), edge / CELLS
    flat = cov[:, :2, :2] + np.eye(2) * cell**2 / 12
    inverse, area = np.linalg.inv(flat), 2 * np.pi * np.sqrt(np.linalg.det(flat))
    for (x, y), (a, b), c, n, s in zip(np.mod(mean[:, :2], edge), inverse, area, count, np.sqrt(flat.max((1, 2)))):
        reach = min(int(3.5 * s / cell) + 1, CELLS // 2)
        i, j = (np.arange(int(v / cell) - reach, int(v / cell) + reach + 1) for v in (x, y))
        dx, dy = ((i + 0.5) * cell - x)[:, None], (j + 0.5) * cell - y
        image[np.ix_(i % CELLS, j % CELLS)] += n / c * np.exp(-0.5 * (a[0] * dx**2 + 2 * a[1] * dx * dy + b[1] * dy**2))
    return image


def main(program, path, frame=None):
    found, total, edge = frames(Path(path))
    frame = len(found) // 2 if frame is None else int(frame)
    own, mean, cov, count = found[frame]
    truth = depth(mean, cov, count, edge)
    scale = 0.7 / np.median(truth)
    levels = lambda d: 255 * (1 - np.exp(-scale * d))
    all_frames = sum(len(f[3]) for f in found)
    print(f"series: {Path(path).stat().st_size / all_frames:.2f} bytes per Gaussian and frame, with counts")
    with tempfile.TemporaryDirectory() as work:
        work = Path(work)
        (work / "in").mkdir()
        write(work / "in", found, total, edge)
        for millimetres, percent, steps in SETTINGS:
            out, order = work / "out.splat4d", work / "order"
            run = lambda *words: subprocess.run([program, *map(str, words)], check=True, capture_output=True)
            run("encode", "-i", work / "in", "-o", out, "--pos-mm", millimetres, "--scale-pct", percent, "--rot-steps", steps,
                "--zstd-level", 19, "--perm-out", order, "--no-verify")
            run("decode", out, "--frame", frame, "-o", work / "frame.splat")
            splats = np.empty(total, SPLAT)
            splats[np.fromfile(order, "<u4")] = np.fromfile(work / "frame.splat", SPLAT)
            shown = levels(depth(splats[own]["place"].astype(float), covariances(splats[own]), count, edge))
            lost = 10 * np.log10(255**2 / np.mean((shown - levels(truth)) ** 2))
            print(f"splat4d --pos-mm {millimetres} --scale-pct {percent} --rot-steps {steps}: "
                  f"{out.stat().st_size / all_frames:.2f} bytes per Gaussian and frame, {lost:.1f} dB")


if __name__ == "__main__":
    main(*sys.argv[1:])
