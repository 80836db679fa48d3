"""Makes snapshots and series of them for the tests."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[3]


def snapshot(path: Path, scale_factor: float, **species: np.ndarray) -> Path:
    """Write particles without a box, of the types `dm` and `stars`, as HDF5 in the layout of Gadget."""
    types = {"dm": 1, "stars": 4}
    counts = np.zeros(6, np.uint32)
    for name, points in species.items():
        counts[types[name]] = len(points)
    with h5py.File(path, "w") as file:
        header = file.create_group("Header").attrs
        header["NumPart_ThisFile"] = header["NumPart_Total"] = counts
        header["NumPart_Total_HighWord"] = np.zeros(6, np.uint32)
        header["MassTable"] = np.where(counts > 0, 1.0, 0.0)
        header["BoxSize"], header["NumFilesPerSnapshot"] = 0.0, 1
        header["Time"], header["Redshift"] = scale_factor, 1.0 / scale_factor - 1.0
        header["Omega0"], header["OmegaLambda"], header["HubbleParam"] = 0.3, 0.7, 0.7
        for name, points in species.items():
            group = file.create_group(f"PartType{types[name]}")
            group["Coordinates"] = points.astype(np.float32)
            group["ParticleIDs"] = np.arange(len(points), dtype=np.uint32)
    return path


def series_of(snapshots: list[Path], path: Path) -> Path:
    """Make a series by the command, from $PARTICLEGS or target/."""
    built = [ROOT / "target" / profile / "particlegs" for profile in ("release", "debug")]
    found = [os.environ.get("PARTICLEGS"), *(str(p) for p in built if p.exists()), shutil.which("particlegs")]
    command = next(filter(None, found), None)
    assert command, "the command particlegs is not built: cargo build --release"
    # It fails where a snapshot cannot be read, and leaves a gap.
    subprocess.run([command, "series", *snapshots, "-o", path, "--size", "4kB", "--quiet"], check=False)
    assert path.exists()
    return path
