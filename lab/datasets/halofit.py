#!/usr/bin/env python3
"""Power spectra of snapshots over Halofit's (jax-cosmo), in bands of k: the table in README.md.

  halofit.py particlegs NAME=SNAPSHOT:REDSHIFT[:PLANCK18] ...     PLANCK18: Abacus's cosmology instead of ours
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ["JAX_PLATFORMS"] = "cpu"

import jax_cosmo as jc
import numpy as np
from gravity import cosmology

BANDS = (0.2, 0.4, 0.8, 1.2, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0)  # h/Mpc
PLANCK18 = {"Omega_c": 0.12 / 0.6736**2, "Omega_b": 0.02237 / 0.6736**2, "h": 0.6736, "sigma8": 0.8080, "n_s": 0.9649}


def spectrum(program, snapshot):
    """k, modes and power of each shell, noise taken off."""
    with tempfile.TemporaryDirectory() as folder:
        words = [program, "stats", snapshot, snapshot, "-o", folder, "--only", "spectrum", "--no-plots", "--quiet"]
        subprocess.run(words, check=True)
        table = np.genfromtxt(Path(folder) / "power.csv", delimiter=",", names=True)
    return table["k"], table["modes"], table["power_truth"]


def main(program, *sets):
    print("| k, h/Mpc | " + " | ".join(f"{a:g} to {b:g}" for a, b in zip(BANDS, BANDS[1:], strict=False)) + " |")
    print("|---" * len(BANDS) + "|")
    for item in sets:
        name, _, rest = item.partition("=")
        snapshot, redshift, *kind = rest.split(":")
        cosmos = jc.Cosmology(**PLANCK18, Omega_k=0.0, w0=-1.0, wa=0.0) if kind else cosmology()
        k, modes, power = spectrum(program, snapshot)
        theory = jc.power.nonlinear_matter_power(cosmos, k, a=1 / (1 + float(redshift)))
        ratio = power / np.asarray(theory).ravel()
        cells = []
        for low, high in zip(BANDS, BANDS[1:], strict=False):
            band = (k >= low) & (k < high)
            cells.append(f"{np.average(ratio[band], weights=modes[band]):.2f}" if band.any() else "")
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main(*sys.argv[1:])
