"""Snapshots of series for tests/decoder/run.sh: FOLDER gets moving-*, weights-* and leaning.dump."""

import json
import sys
from pathlib import Path

import numpy as np

folder = Path(sys.argv[1])
random = np.random.default_rng(3)
centres = random.random((40, 3)) * 10
member = np.arange(6000) % 40
noise = 0.25 * random.normal(size=(6000, 3))
drift = random.normal(size=(40, 3))


def write(folder, place, about):
    """A folder of raw columns."""
    folder.mkdir()
    for k, axis in enumerate("xyz"):
        place[:, k].astype("<f4").tofile(folder / f"{axis}{axis}.f32")
    (folder / "meta.json").write_text(json.dumps(about))


# A periodic box in which groups drift, cross its faces and grow; a second type from the fifth frame on makes a keyframe.
for frame in range(6):
    place = np.mod(centres[member] + 0.15 * frame * drift[member] + noise * (1 + 0.1 * frame), 10)
    layers = [{"name": "dm", "particles": 6000, "particle_mass": 1.0}]
    if frame >= 4:
        layers = [{"name": "dm", "particles": 4000, "particle_mass": 1.0}, {"name": "gas", "particles": 2000, "particle_mass": 0.5}]
    about = {"box": 10, "periodic": True, "length_unit": "Mpc/h", "comoving": True, "layers": layers}
    about["redshift"] = 1 / (0.5 + 0.02 * frame + 0.003 * (frame % 2)) - 1
    write(folder / f"moving-{frame}", place, about)

# Particles with weights and fields of their own, without a box and without a time.
for frame in range(3):
    place = centres[member] + 0.1 * frame * drift[member] + noise
    write(folder / f"weights-{frame}", place[:3000], {})
    (1 + member[:3000] % 3 + 0.1 * frame).astype("<f4").tofile(folder / f"weights-{frame}" / "ww.f32")
    own = {"temperature": np.exp(place[:3000, 0] / 4), "metals": member[:3000] / 40 + place[:3000, 1]}
    own |= {"state": (member[:3000] + frame) // 4 % 3, "still": np.full(3000, 2.5)}
    own |= {f"v{axis}": 100 * drift[member[:3000], k] + 20 * noise[:3000, k - 1] for k, axis in enumerate("xyz")}
    for name, values in own.items():
        values.astype("<f4").tofile(folder / f"weights-{frame}" / f"{name}.f32")

# A triclinic cell that grows and leans.
with open(folder / "leaning.dump", "w") as out:
    for frame in range(5):
        edge, lean = 10 * (1 + 0.02 * frame), 1 + 0.1 * frame
        part = np.mod((centres[member] + 0.05 * frame * drift[member] + noise) / 10, 1)[:4000]
        place = part * edge + np.outer(part[:, 1], [lean, 0, 0])
        out.write(f"ITEM: TIMESTEP\n{100 * frame}\nITEM: NUMBER OF ATOMS\n4000\nITEM: BOX BOUNDS xy xz yz pp pp pp\n")
        out.write(f"0 {edge + lean} {lean}\n0 {edge} 0\n0 {edge} 0\nITEM: ATOMS id type x y z\n")
        out.writelines(f"{i + 1} 1 {x:.5f} {y:.5f} {z:.5f}\n" for i, (x, y, z) in enumerate(place.tolist()))
